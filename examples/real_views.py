"""A mesh and a scan plan from real structured-light views of one object, with a robot arm's own camera poses.

    python examples/real_views.py DATA-FOLDER OUT.png

DATA-FOLDER holds `scene-0000` of the Amazon Picking Challenge sample (andyzeng/apc-vision-toolbox,
BSD-2-Clause): depth frames of a RealSense F200 and the object masks that come with them. The object
stands in a shelf, not on a table, so the views are merged by the arm's poses alone.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

from eddyscan.core.depth import PinholeCamera
from eddyscan.core.frames import apply
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.open3d_loader import load_open3d
from eddyscan.core.plan import ScanPlan
from eddyscan.core.technique import Plan, Technique
from eddyscan.planning import plan
from eddyscan.surface import deproject

CAMERA = PinholeCamera(fx=615.195, fy=615.195, cx=298.443, cy=247.519, width=640, height=480, depth_scale_mm=0.1)
LABEL = 114  # a book
LEAST_POINTS = 5000


def pose(text: str, frame: str) -> np.ndarray:
    """Return T_world_camera (4, 4) [mm] of a frame from cam.info.txt."""
    rows = text.split(f"for {frame}", 1)[1].splitlines()[1:5]
    T = np.array([[float(number) for number in row.split()] for row in rows])
    T[:3, 3] *= 1000.0
    return T


def merged_surface(scene: Path) -> tuple[SurfaceMesh, int]:
    """Return the Poisson surface of the object's points where they support it, and the number of views used."""
    o3d, text = load_open3d(), (scene / "cam.info.txt").read_text()
    cloud, used = o3d.geometry.PointCloud(), 0
    for path in sorted(scene.glob("frame-*.depth.png")):
        counts = cv2.imread(str(path), cv2.IMREAD_UNCHANGED).astype(np.uint16)
        mask = cv2.imread(str(scene / "segm" / path.name.replace("depth", "segm")), cv2.IMREAD_UNCHANGED)
        depth = ((counts >> 3) | (counts << 13)).astype(float) / 10.0  # stored rotated right by three bits
        depth[(mask != LABEL) | (depth < 150) | (depth > 900)] = np.nan
        if np.isfinite(depth).sum() < LEAST_POINTS:
            continue
        T_world_camera = pose(text, path.name[:12])
        points = apply(T_world_camera, deproject(depth, CAMERA))
        one = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)).voxel_down_sample(1.5)
        one.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(40))
        one.orient_normals_towards_camera_location(T_world_camera[:3, 3])
        cloud, used = cloud + one, used + 1
    cloud = cloud.voxel_down_sample(2.0).remove_statistical_outlier(40, 1.0)[0]
    labels = np.asarray(cloud.cluster_dbscan(6.0, 12))
    cloud = cloud.select_by_index(np.flatnonzero(labels == np.bincount(labels[labels >= 0]).argmax()))
    solid, density = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=5)
    solid.remove_vertices_by_mask(np.asarray(density) < np.quantile(np.asarray(density), 0.35))
    vertices = np.asarray(solid.vertices)
    return SurfaceMesh.from_triangles(vertices - vertices.min(axis=0), np.asarray(solid.triangles), frame="world"), used


def draw(mesh: SurfaceMesh, scan: ScanPlan, out: Path) -> None:
    """Draw the surface coloured by height with the scan points on it."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 4.6), dpi=90, layout="constrained")
    axes = figure.add_subplot(projection="3d")
    axes.plot_trisurf(*mesh.vertices.T, triangles=mesh.faces, cmap="viridis", linewidth=0, alpha=0.9)
    spots = scan.surface_mm[scan.is_scan] + 2 * scan.normal[scan.is_scan]
    axes.scatter(*spots.T, s=3, color="#b91c1c", depthshade=False)
    axes.set(xlabel="x mm", ylabel="y mm", zlabel="z mm", box_aspect=np.ptp(mesh.vertices, axis=0))
    axes.view_init(elev=22, azim=-110)
    figure.savefig(out)


def main() -> None:
    """Merge, plan and draw."""
    folder, out = Path(sys.argv[1]), Path(sys.argv[2])
    mesh, used = merged_surface(folder / "scene-0000" if (folder / "scene-0000").is_dir() else folder)
    technique = Technique(plan=Plan(pitch_mm=5, step_mm=5, margin_mm=5, machine="pose"))
    scan = plan(mesh, technique, allow_gaps=True)
    size = " x ".join(f"{length:.0f}" for length in np.ptp(mesh.vertices, axis=0))
    print(f"{used} views, {len(mesh.vertices)} vertices, {size} mm, {scan.n_rows} rows, {scan.n_scan} points")
    print(f"swept coverage {100 * scan.coverage.swept:.1f} %")
    draw(mesh, scan, out)


if __name__ == "__main__":
    main()
