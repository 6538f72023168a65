"""A made-up inspection of block-a, in the nouns a report is made from: numbers by formula and seed, no device."""

from __future__ import annotations

import dataclasses

import numpy as np

from eddyscan.core.cscan import CScan
from eddyscan.core.depth import DepthImage, PinholeCamera
from eddyscan.core.frames import apply, from_rotation_vector, rotation_about_z, transform
from eddyscan.core.indication import Indication
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import named_part
from eddyscan.core.plan import APPROACH, SCAN, Coverage, ScanPlan, Uncovered
from eddyscan.core.record import ScanRecord
from eddyscan.core.registration import Registration
from eddyscan.core.technique import Procedure, Technique
from eddyscan.report import NominalComparison, ReportContent

LIFT_OFF_MM = 0.5
NOMINAL = named_part("block-a")
T_STAGE_PART = transform(rotation_about_z(4.0), (12.0, 8.0, -30.0))


def measured_mesh(edge_mm: float = 2.0) -> SurfaceMesh:
    exact = NOMINAL.top_mesh(edge_mm)
    x, y = exact.vertices[:, 0], exact.vertices[:, 1]
    off = 0.06 * np.sin(x / 17) * np.cos(y / 23) + np.random.default_rng(1).normal(0, 0.02, len(x))
    uncertainty = 0.03 + 0.05 * (np.abs(y - 50) / 50) ** 4
    return SurfaceMesh.from_triangles(exact.vertices + off[:, None] * exact.normals, exact.faces, uncertainty)


def example_plan(pitch_mm: float = 5.0, step_mm: float = 5.0) -> ScanPlan:
    rows = []
    for row, y in enumerate(np.arange(4.0, 96.1, pitch_mm)):
        x = np.arange(4.0, 196.1, step_mm)
        x = x if row % 2 == 0 else x[::-1]
        rows.append(np.stack([np.full_like(x, row), np.arange(len(x)), x, np.full_like(x, y)], axis=1))
    table = np.concatenate([np.concatenate([[[k, -1, *rows[k][0, 2:]]], rows[k]]) for k in range(len(rows))])
    row, point = table[:, 0].astype(int), table[:, 1].astype(int)
    foot = NOMINAL.surface(table[:, 2], table[:, 3])
    normal = NOMINAL.normal(table[:, 2], table[:, 3])
    T = np.tile(np.eye(4), (len(table), 1, 1))
    T[:, :3, :3] = np.diag([1.0, -1.0, -1.0])
    T[:, :3, 3] = foot + LIFT_OFF_MM * normal + (point == -1)[:, None] * (0, 0, 5.0)
    tilt = np.degrees(np.arccos(normal[:, 2]))
    spot = Uncovered("edge: the tip would stand over the rim", 35.0, (199.0, 50.0, 30.0))
    coverage = Coverage(0.987, 3.1, (4.9, 5.0, 5.2), (4.8, 5.0, 5.1), 3.6, (spot, Uncovered("out of reach", 12.0)))
    return ScanPlan(
        kind=np.where(point == -1, APPROACH, SCAN),
        row=row,
        point=point,
        s_mm=np.maximum(point, 0) * step_mm,
        surface_mm=foot,
        normal=normal,
        T_part_probe=T,
        tilt_deg=tilt,
        lift_off_mm=LIFT_OFF_MM + 0.002 * tilt,
        speed_mm_s=np.full(len(table), 25.0),
        time_s=np.arange(len(table)) * 0.4,
        coverage=coverage,
        settings={},
        inputs={"surface.ply": "ab" * 32},
        notes=("one row shortened at the rim",),
    )


def example_lift_off(record_points: np.ndarray) -> np.ndarray:
    x, y = record_points[:, 0], record_points[:, 1]
    return LIFT_OFF_MM + 0.02 * np.sin(x / 30) + 0.01 * np.cos(y / 20)


def example_record(plan: ScanPlan) -> tuple[ScanRecord, np.ndarray, np.ndarray]:
    """Return a record of the plan, its lift-off and its residual: a dipole-like mark at (120, 49)."""
    rng = np.random.default_rng(2)
    scan = plan.is_scan
    target = apply(T_STAGE_PART, plan.T_part_probe[scan, :3, 3])
    stage = target + rng.normal((0.0, 0.0005, 0.002), (0.0008, 0.0011, 0.004), target.shape)
    part = plan.T_part_probe[scan, :3, 3]
    lift = example_lift_off(part) + rng.normal(0, 0.001, len(part))
    dx, dy = part[:, 0] - 120, part[:, 1] - 49
    mark = 0.09 * np.exp(-((np.abs(dx) - 2) ** 2 + dy**2) / 6) * np.exp(1j * 1.9)
    residual = mark + 0.001 * (rng.normal(size=len(part)) + 1j * rng.normal(size=len(part)))
    z = (3.0 - 0.8 * np.exp(-lift)) + 1j * (40 - 9 * np.exp(-lift / 0.8)) + residual
    meta = {
        "T_stage_part": T_STAGE_PART.tolist(),
        "alignment": {"how": "by the coil's field", "z_uncertainty_mm": 0.004, "scale": 1.0012},
        "devices": [
            {
                "kind": "stage",
                "model": "X-LSM200A ×2, X-VSR40A",
                "serial": "50001",
                "firmware": "7.38",
                "verified": False,
            },
            {"kind": "instrument", "model": "E4980A", "serial": "MY4600", "firmware": "A.06.15", "verified": False},
        ],
        "references": [
            {"when": "before", "notch_depth_mm": 0.5, "amplitude_mohm": 81.2, "phase_deg": 104.0, "drift_percent": 0.0},
            {"when": "after", "notch_depth_mm": 0.5, "amplitude_mohm": 80.9, "phase_deg": 104.3, "drift_percent": -0.4},
        ],
        "events": [],
    }
    record = ScanRecord(
        plan.row[scan], plan.point[scan], plan.time_s[scan], stage, target,
        np.full(len(part), 5e5), z, np.zeros(len(part), dtype=int), meta,
    )  # fmt: skip
    return record, lift, residual


def example_views() -> tuple[DepthImage, ...]:
    camera = PinholeCamera(fx=416, fy=416, cx=320, cy=230, width=640, height=460, depth_scale_mm=0.1)
    v, u = np.mgrid[:460, :640]
    views = []
    for k in range(4):
        depth = 420 + 0.05 * (u - 320) * (k - 1.5) + 20.0 * (k == 2)
        inside = (np.abs(u - 330) < 150 - 10 * k) & (np.abs(v - 230) < 90 + 5 * k)
        depth = depth - inside * (30 + 7.5 * np.sin((u - 180) / 32.0))
        depth[(v + 3 * u) % 97 < 2] = np.nan
        views.append(DepthImage(depth.astype(float), camera, f"view-{k}.png"))
    return tuple(views)


def example_registrations() -> tuple[Registration, ...]:
    return tuple(
        Registration(
            f"view-{k}.png", from_rotation_vector(np.array([0, 0, 0.4 * k]), np.zeros(3)), 0.08 + 0.01 * k, 0.83, True,
            ("slides along y by ±6 mm",) if k == 3 else (),
        )
        for k in range(4)
    )  # fmt: skip


def example_nominal(mesh: SurfaceMesh) -> NominalComparison:
    _, _, signed = NOMINAL.closest(mesh.vertices)
    deviation = {
        "mean_abs_mm": float(np.abs(signed).mean()),
        "rmse_mm": float(np.sqrt((signed**2).mean())),
        "p95_mm": float(np.percentile(np.abs(signed), 95)),
        "max_mm": float(np.abs(signed).max()),
        "coverage": 0.996,
        "aligned": True,
    }
    return NominalComparison("block-a", NOMINAL.top_mesh(2.0), np.eye(4), signed, deviation)


def example_cscan(mesh: SurfaceMesh, record: ScanRecord, lift: np.ndarray, residual: np.ndarray) -> CScan:
    from scipy.spatial import KDTree

    distance, nearest = KDTree(record.part_mm).query(mesh.vertices)
    covered = distance < 4.5
    channels = {"residual_ohm": np.abs(residual)[nearest], "lift_off_mm": lift[nearest]}
    return CScan(mesh, covered, {name: np.where(covered, values, np.nan) for name, values in channels.items()})


def example_indications() -> tuple[Indication, ...]:
    z = float(NOMINAL.surface(np.array(120.0), np.array(49.0))[2])
    return (
        Indication(1, (120.0, 49.0, z), 6.1, 2.0, 0.089, 108.9, 62.0, 2.96, 0.18, 0.93, 0.12, "crack-like"),
        Indication(2, (60.0, 24.0, 31.0), 1.2, 88.0, 0.011, 95.0, 7.1),
    )


def whole_inspection(pitch_mm: float = 5.0, step_mm: float = 5.0, edge_mm: float = 2.0) -> ReportContent:
    mesh, plan = measured_mesh(edge_mm), example_plan(pitch_mm, step_mm)
    record, lift, residual = example_record(plan)
    procedure = Procedure(number="EC-017", revision="3", operator="A. Writer", operator_level="2", reviewer="B. Reader")
    return ReportContent(
        technique=Technique(procedure=procedure),
        date="22 November 2026",
        simulated=True,
        views=example_views(),
        registrations=example_registrations(),
        mesh=mesh,
        nominal=example_nominal(mesh),
        plan=plan,
        record=record,
        cscan=example_cscan(mesh, record, lift, residual),
        indications=example_indications(),
        lift_off_mm=lift,
        residual_ohm=residual,
        coarse_lift_off_mm=lift + 0.12 * np.sin(record.part_mm[:, 0] / 25),
        statistics={"lift_off_rms_um": 14.2, "noise_mohm": 1.0, "readings_used": len(record)},
        not_examined=(Uncovered("overload", 4.0, (20.0, 20.0, 33.0)),),
        deviations=("The index was doubled in rows 3 to 5 at the customer's request.",),
        hashes={"4-record/record.sqlite": "0f" * 32, "2-surface/surface.ply": "a7" * 32},
        software_version="0.1.0",
        truth={"surface": {"rmse_mm": 0.061}, "flaws": {"found": 1, "of": 1}, "false_calls": 1},
        timings_s={"views": 6.2, "surface": 9.8, "plan": 3.1, "scan": 41.0, "analyse": 0.9},
        notes=("view-3.png was placed by one neighbour only",),
    )


def small_inspection() -> ReportContent:
    """Return the whole inspection with few points, for tests that do not look at it."""
    return whole_inspection(pitch_mm=16.0, step_mm=12.0, edge_mm=9.0)


def without(content: ReportContent, *names: str) -> ReportContent:
    """Return the content with the named fields as if they had never been made."""
    blank = ReportContent(content.technique)
    return dataclasses.replace(content, **{name: getattr(blank, name) for name in names})
