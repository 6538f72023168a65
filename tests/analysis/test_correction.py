import dataclasses

import numpy as np
import pytest

from eddyscan.analysis import analyse, corrected_plan, corrected_surface, surface_correction
from eddyscan.core.errors import InputError
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import named_part
from eddyscan.core.plan import Coverage, ScanPlan

from . import sound_scan

TECH = sound_scan.technique(
    plan={"pitch_mm": 3.0, "step_mm": 2.0, "machine": "xyz-tilt"}, scan={"lift_off_mm": 0.5}, probe={"tip": "flat"}
)
WINDOW = (30.0, 130.0, 20.0, 60.0)


def camera_error(x, y):
    return 0.08 * np.sin(x / 9.0 + 0.4) * np.cos(y / 8.0)


@pytest.fixture(scope="module")
def camera_mesh():
    mesh = named_part("plate").top_mesh(1.0)
    error = camera_error(mesh.vertices[:, 0], mesh.vertices[:, 1])
    return SurfaceMesh.from_triangles(
        mesh.vertices + error[:, None] * mesh.normals, mesh.faces, np.full(len(error), 0.08)
    )


@pytest.fixture(scope="module")
def coarse(camera_mesh):
    record, _ = sound_scan.grid_record(TECH, "plate", window=WINDOW, lift_off_error=camera_error)
    return record, analyse(record, camera_mesh, TECH)


def straight_plan(mesh_height, lift_off=0.5):
    """Rows 1 mm apart over the plate, a constant lift-off above what the camera saw."""
    x, row = np.tile(np.arange(36.0, 124.0), 30), np.repeat(np.arange(30), 88)
    y = 25.0 + row
    surface = np.stack([x, y, mesh_height + camera_error(x, y)], axis=1)
    n = len(x)
    T = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (n, 1, 1))
    T[:, :3, 3] = surface + np.array([0.0, 0.0, lift_off])
    flat = np.tile([0.0, 0.0, 1.0], (n, 1))
    point = np.tile(np.arange(88), 30)
    full = np.full(n, lift_off)
    coverage = Coverage(1.0, 1.0, (1.0, 1.0, 1.0), (1.0, 1.0, 1.0), 1.0)
    zero = np.zeros(n)
    return ScanPlan(
        zero.astype(np.int64), row, point, point * 1.0, surface, flat, T, zero, full, full * 0 + 25, zero, coverage
    )


def test_the_path_follows_the_true_metal(camera_mesh, coarse):
    plan = straight_plan(30.0)
    corrected = corrected_plan(plan, *coarse, TECH, mesh=camera_mesh)
    true = corrected.T_part_probe[:, 2, 3] - 30.0
    before = plan.T_part_probe[:, 2, 3] - 30.0 - 0.5
    assert np.sqrt(np.mean(before**2)) > 0.030
    assert np.sqrt(np.mean((true - 0.5) ** 2)) < 0.006
    assert "path corrected by the probe's own lift-off" in corrected.notes[-1]
    assert np.array_equal(corrected.row, plan.row)
    assert np.array_equal(corrected.time_s, plan.time_s)


def test_a_crack_does_not_bend_the_path(camera_mesh, coarse):
    record, result = coarse
    at = (np.abs(record.part_mm[:, 0] - 80) < 3) & (np.abs(record.part_mm[:, 1] - 41) < 2)
    lift_off = np.where(at, result.lift_off_mm - 0.02, result.lift_off_mm)
    score = np.where(at, 20.0, 0.0)
    fooled = dataclasses.replace(result, lift_off_mm=lift_off, score=score)
    plan = straight_plan(30.0)
    quiet = corrected_plan(plan, record, dataclasses.replace(result, score=0 * score), TECH, mesh=camera_mesh)
    loud = corrected_plan(plan, record, fooled, TECH, mesh=camera_mesh)
    moved = np.abs(loud.T_part_probe[:, 2, 3] - quiet.T_part_probe[:, 2, 3])
    # the hole left by frozen readings is bridged: worse than the 2 um of dense readings, far below the faked 20
    assert moved.max() < 0.012


def test_the_correction_is_rate_limited(camera_mesh, coarse):
    plan = straight_plan(30.0)
    corrected = corrected_plan(plan, *coarse, TECH, mesh=camera_mesh, largest_slope=0.002)
    shift = corrected.T_part_probe[:, 2, 3] - plan.T_part_probe[:, 2, 3]
    same_row = np.diff(plan.row) == 0
    assert np.abs(np.diff(shift))[same_row].max() <= 0.002 + 1e-9


def test_a_part_that_moved_is_not_followed(camera_mesh, coarse):
    record, result = coarse
    away = dataclasses.replace(result, lift_off_mm=result.lift_off_mm + 3.0)
    with pytest.raises(InputError, match=r"the path would move by 3\.\d\d mm \(limit 2 mm\).*align again"):
        corrected_plan(straight_plan(30.0), record, away, TECH, mesh=camera_mesh)


def test_without_lift_off_there_is_no_correction(camera_mesh, coarse):
    record, result = coarse
    blind = dataclasses.replace(result, lift_off_mm=np.full(len(record), np.nan))
    with pytest.raises(InputError, match=r"only 0 of \d+ readings know their lift-off \(at least 6"):
        surface_correction(record, blind, camera_mesh, TECH)


def test_the_surface_is_written_back_with_its_uncertainty(camera_mesh, coarse):
    correction = surface_correction(*coarse, camera_mesh, TECH)
    surface = corrected_surface(camera_mesh, correction)
    x, y = camera_mesh.vertices[:, 0], camera_mesh.vertices[:, 1]
    scanned = (x > 33) & (x < 125) & (y > 23) & (y < 56)
    error = surface.vertices[scanned, 2] - 30.0
    assert np.sqrt(np.mean(error**2)) < 0.006
    assert np.mean(np.abs(error) < 2 * surface.uncertainty_mm[scanned]) > 0.9
    beyond = (x > 150) | (y > 80)
    assert np.array_equal(surface.vertices[beyond], camera_mesh.vertices[beyond])
    assert np.allclose(surface.uncertainty_mm[beyond], 0.08)
