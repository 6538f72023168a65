"""Depth images on disk: a 16-bit PNG beside a `camera.json`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from eddyscan.core.depth import DepthImage, PinholeCamera
from eddyscan.core.errors import FileError
from eddyscan.core.frames import Array, checked_transform

CAMERA_FILE = "camera.json"
POSES_FILE = "poses.json"
MAX_COUNT = 65535


def read_depth_image(path: Path | str, *, T_world_camera: Array | None = None) -> DepthImage:
    """Read a depth PNG with its camera.

    Parameters
    ----------
    path : the PNG; `camera.json` (or ``<stem>.camera.json``) lies beside it
    T_world_camera : (4, 4) or None
        Its pose when known.

    Raises
    ------
    FileError
        Missing, empty or truncated file, not a 16-bit single-channel PNG, missing or wrong `camera.json`.
    """
    import cv2

    path = Path(path)
    data = _bytes(path)
    counts = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if counts is None:
        raise FileError(
            f"{path} is not a readable PNG ({len(data)} bytes): truncated or of another kind. Export it again."
        )
    if counts.dtype != np.uint16 or counts.ndim != 2:
        raise FileError(
            f"{path} holds {counts.dtype} pixels with {1 if counts.ndim == 2 else counts.shape[2]} channel(s); a depth "
            "image is a 16-bit single-channel PNG. Save the raw depth, not its colour picture."
        )
    camera = read_camera(path)
    depth = np.where(counts > 0, counts * camera.depth_scale_mm, np.nan)
    return DepthImage(depth, camera, path.name, T_world_camera, intensity=_intensity(path, counts.shape))


def write_depth_image(image: DepthImage, path: Path | str) -> None:
    """Write a depth PNG, its `camera.json` and, when there is one, its intensity picture and pose.

    Depths are rounded to the camera's `depth_scale_mm`; NaN becomes 0.

    Raises
    ------
    FileError
        When a depth does not fit 16 bits at that scale.
    """
    import cv2

    path = Path(path)
    counts = np.rint(np.nan_to_num(image.depth_mm, nan=0.0) / image.camera.depth_scale_mm)
    if counts.min() < 0 or counts.max() > MAX_COUNT:
        raise FileError(
            f"{image.name}: depths up to {np.nanmax(image.depth_mm):.0f} mm do not fit 16 bits at "
            f"{image.camera.depth_scale_mm} mm per count (limit {MAX_COUNT * image.camera.depth_scale_mm:.0f} mm). "
            "Use a larger depth_scale_mm."
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    _, png = cv2.imencode(".png", counts.astype(np.uint16))
    path.write_bytes(png.tobytes())
    (path.parent / CAMERA_FILE).write_text(image.camera.model_dump_json(indent=1) + "\n", encoding="utf-8")
    if image.intensity is not None:
        _, png = cv2.imencode(".png", image.intensity)
        _intensity_path(path).write_bytes(png.tobytes())
    if image.T_world_camera is not None:
        poses = json.loads((path.parent / POSES_FILE).read_text()) if (path.parent / POSES_FILE).exists() else {}
        poses[path.name] = image.T_world_camera.tolist()
        (path.parent / POSES_FILE).write_text(json.dumps(poses, indent=1) + "\n", encoding="utf-8")


def read_camera(depth_path: Path) -> PinholeCamera:
    """Read the camera that belongs to a depth PNG.

    Raises
    ------
    FileError
        When neither ``<stem>.camera.json`` nor `camera.json` lies beside it, or it does not describe a camera.
    """
    own = depth_path.with_name(depth_path.stem + ".camera.json")
    path = own if own.exists() else depth_path.parent / CAMERA_FILE
    if not path.exists():
        raise FileError(
            f"no {CAMERA_FILE} beside {depth_path}: a depth image needs "
            '{"fx", "fy", "cx", "cy", "width", "height", "depth_scale_mm"} in that file.'
        )
    try:
        return PinholeCamera.model_validate_json(path.read_text(encoding="utf-8"))
    except (ValidationError, UnicodeDecodeError) as error:
        raise FileError(
            f"{path} does not describe a camera: {_first_fault(error)}. Needed: fx, fy, cx, cy [px], width, "
            "height [px], depth_scale_mm [mm per count], nothing else."
        ) from None


def read_poses(folder: Path) -> dict[str, Array]:
    """Read `poses.json` ({"file name": 4x4 T_world_camera in mm}) of a folder; empty when there is none.

    Raises
    ------
    FileError
        When it is not JSON of that form.
    GeometryError
        When a pose is not rigid.
    """
    path = folder / POSES_FILE
    if not path.exists():
        return {}
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(table, dict):
            raise ValueError("not an object of file names")
        arrays = {str(name): np.asarray(value, dtype=np.float64) for name, value in table.items()}
    except (ValueError, UnicodeDecodeError) as error:
        raise FileError(
            f'{path} is not {{"file name": 4x4 matrix [mm], ...}}: {error}. Correct or remove it.'
        ) from None
    return {name: checked_transform(T, f"pose of {name} in {path}") for name, T in arrays.items()}


def _first_fault(error: Exception) -> str:
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        return f"{'.'.join(str(p) for p in first['loc']) or 'file'}: {first['msg']}"
    return str(error)


def _bytes(path: Path) -> bytes:
    if not path.exists():
        raise FileError(f"{path} does not exist. Check the name.")
    if path.is_dir():
        raise FileError(f"{path} is a folder; name the files in it.")
    data = path.read_bytes()
    if not data:
        raise FileError(f"{path} is empty (0 bytes). Export it again.")
    return data


def _intensity_path(path: Path) -> Path:
    return path.with_name(path.stem + ".intensity.png")


def _intensity(path: Path, shape: tuple[int, ...]) -> np.ndarray | None:
    import cv2

    beside = _intensity_path(path)
    if not beside.exists():
        return None
    image = cv2.imread(str(beside), cv2.IMREAD_GRAYSCALE)
    if image is None or image.shape != shape:
        size = "unreadable" if image is None else f"{image.shape[1]} x {image.shape[0]} px"
        raise FileError(
            f"{beside} is {size}, its depth image is {shape[1]} x {shape[0]} px. They must share their pixels."
        )
    return np.asarray(image)
