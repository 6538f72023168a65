"""`eddyscan jog`: keys move the virtual stage, touched points become the placing."""

import io
import json
import os
from pathlib import Path

import numpy as np
import pytest

from eddyscan import pipeline
from eddyscan.cli.jog import _named
from eddyscan.core.errors import InputError
from eddyscan.core.parts import PARTS
from eddyscan.formats.meshes import write_mesh


def keys_of(data: bytes) -> list[str]:
    reader, writer = os.pipe()
    with io.FileIO(writer, "w") as pipe:
        pipe.write(data)
    keys = []
    for key in _named(reader):
        keys.append(key)
        if key == "q":
            break
    os.close(reader)
    return keys


def test_escape_sequences_become_key_names() -> None:
    assert keys_of(b"\x1b[C\x1b[A\x1b[5~ \r+q") == ["right", "up", "pageup", "space", "enter", "+", "q"]


def test_a_closed_pipe_ends_the_session() -> None:
    assert keys_of(b"h") == ["h", "q"]


def test_one_touched_corner_places_the_surfaces_origin_there(tmp_path: Path) -> None:
    folder = tmp_path / "case"
    inspection = pipeline.new_inspection(folder, part="plate")
    inspection.step_folder("surface").mkdir()
    write_mesh(PARTS["plate"].top_mesh(10.0), inspection.file("surface", "surface.ply"))
    with pipeline.jog_session(folder) as session:
        for key in ("h", "right", "enter"):
            session.press(key)
        touched = session.state.points_mm
    pipeline.keep_touched(folder, touched, [])
    T = np.array(json.loads((folder / "alignment.json").read_text())["T_stage_part"])
    np.testing.assert_allclose(T @ [0, 0, 30, 1], [*touched[0], 1], atol=1e-9)


def test_points_and_their_names_must_match(tmp_path: Path) -> None:
    folder = tmp_path / "case"
    pipeline.new_inspection(folder, part="plate")
    with pytest.raises(InputError, match="2 points were touched and 0 named"):
        pipeline.keep_touched(folder, [np.zeros(3), np.ones(3)], [])
