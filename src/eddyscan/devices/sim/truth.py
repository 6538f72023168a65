"""What the world knows: the same quantities the software reports, measured against the truth.

Nothing here is reachable from a device driver; the pipeline asks for it after
the steps are done and puts the answers into `summary.json` under `truth`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from eddyscan.core.frames import Array, IntArray, angle_deg, apply, from_rotation_vector, invert
from eddyscan.core.indication import Indication
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import NominalPart, named_part
from eddyscan.core.record import ScanRecord
from eddyscan.devices.sim.flaws import Flaw
from eddyscan.devices.sim.world_facts import facts_of
from eddyscan.devices.sim.world_placement import surface_pose
from eddyscan.devices.sim.world_probe import reading_key
from eddyscan.devices.sim.world_settings import WorldSettings

NEAR_FLAW_MM = 3.0
CONTACT_MM = -0.02
COVERED_WITHIN_MM = 2.0
OVER_PART_MM = 3.0
FIT_STEPS = 12
SLIDING_PULL = 0.0025


def surface_truth(mesh: SurfaceMesh, world: WorldSettings) -> dict[str, Any]:
    """Return how far a reconstructed surface is from the exact one, in its own frame and after a best fit.

    Parameters
    ----------
    mesh : SurfaceMesh [mm, part as reconstructed]
        Its axes may be the part's or turned by 180 deg; the better is taken and told.
    world : WorldSettings

    Returns
    -------
    dict
        `own` and `fit`: mean_abs_mm, rmse_mm, p95_mm, max_mm along the normal;
        `coverage`: share of the exact top with a vertex within 2 mm (or 1.5
        edges of a coarser mesh); `shift_mm` (3,) of its middle, `turn_deg`: the best fit;
        `turned`: whether the ends were exchanged.
    """
    part = named_part(world.part)
    T_part_surface = surface_pose(part, mesh)
    vertices = apply(T_part_surface, mesh.vertices)
    T_fit = best_fit(part, vertices)
    fitted = apply(T_fit, vertices)
    edge = float(np.median(np.linalg.norm(vertices[mesh.faces[:, 0]] - vertices[mesh.faces[:, 1]], axis=1)))
    reach = max(COVERED_WITHIN_MM, 1.5 * edge)
    seen, _ = KDTree(fitted).query(part.top_mesh(2.0).vertices, distance_upper_bound=reach)
    return {
        "own": deviation(part.closest(vertices)[2]),
        "fit": deviation(part.closest(fitted)[2]),
        "coverage": round(float(np.isfinite(seen).mean()), 4),
        "shift_mm": [round(float(s), 4) for s in fitted.mean(axis=0) - vertices.mean(axis=0)],
        "turn_deg": round(angle_deg(T_fit), 4),
        "turned": bool(T_part_surface[0, 0] < 0),
    }


def path_truth(
    log: Mapping[str, Any], record: ScanRecord | None = None, *, lift_off_mm: float | None = None
) -> dict[str, Any]:
    """Return the true lift-off and tilt along a scan's path.

    Parameters
    ----------
    log : mapping
        `VirtualCell.truth_log()`: what really was at every reading.
    record : ScanRecord or None
        Its readings are found again by their impedance, and `stage_error_mm`
        (true minus recorded) and `alignment` are told too. Without it, every
        reading within 3 mm of the part counts.
    lift_off_mm : float or None
        The lift-off that was asked for; adds `lift_off_error_mm`.
    """
    columns = {name: np.asarray(log[name], dtype=float) for name in ("lift_off_mm", "tilt_deg", "near_edge")}
    stage_mm = np.asarray(log["stage_mm"], dtype=float).reshape(-1, 3)
    if record is None:
        over = np.array([body == "part" for body in log.get("body", ["part"] * len(stage_mm))], dtype=bool)
        which = np.flatnonzero(over & (columns["lift_off_mm"] < OVER_PART_MM))
        result: dict[str, Any] = {"readings": len(which)}
    else:
        found = match_readings(log, record)
        which = found[found >= 0]
        error = stage_mm[which] - record.stage_mm[found >= 0]
        result = {"readings": len(record), "matched": len(which)}
        result["stage_error_mm"] = {axis: spread(error[:, k]) for k, axis in enumerate("xyz")}
        result["alignment"] = _alignment(log, record)
    lift_off = columns["lift_off_mm"][which]
    result["lift_off_mm"] = spread(lift_off)
    result["tilt_deg"] = spread(columns["tilt_deg"][which])
    result["in_edge_zone"] = int(columns["near_edge"][which].sum())
    result["contacts"] = int((lift_off < CONTACT_MM).sum())
    if lift_off_mm is not None:
        result["lift_off_error_mm"] = spread(lift_off - lift_off_mm)
    return result


def indication_truth(
    indications: Sequence[Indication],
    world: WorldSettings,
    *,
    mesh: SurfaceMesh | None = None,
    log: Mapping[str, Any] | None = None,
    record: ScanRecord | None = None,
) -> dict[str, Any]:
    """Return which flaws were found, missed or never crossed, and how many calls are false.

    Parameters
    ----------
    indications : sequence of Indication [mm, part as reconstructed]
    world : WorldSettings
    mesh : SurfaceMesh or None
        The reconstruction the indications lie on: tells whether its ends are exchanged.
    log, record : as for `path_truth`
        With both, each flaw tells the distance of the nearest reading.
    """
    facts = facts_of(world)
    T_part_surface = surface_pose(facts.part, mesh)
    near = [_nearest_flaw(facts.flaws, apply(T_part_surface, np.array([i.centre_mm]))[0]) for i in indications]
    feet = _feet(log, record)
    each = []
    for number, flaw in enumerate(facts.flaws):
        mine = [i for i, nearest in zip(indications, near, strict=True) if nearest == number]
        each.append(flaw.as_dict() | {"found": bool(mine), "indications": [i.number for i in mine]})
        if len(feet):
            nearest_mm = float(np.linalg.norm(feet - flaw.centre_mm, axis=1).min())
            each[-1]["nearest_reading_mm"] = round(nearest_mm, 3)
    return {
        "flaws": len(each),
        "found": sum(bool(flaw["found"]) for flaw in each),
        "false_calls": sum(number is None for number in near),
        "each": each,
    }


def match_readings(log: Mapping[str, Any], record: ScanRecord) -> IntArray:
    """Return for each reading of the record its place in the log (N,) int64, -1 where the cell did not take it."""
    waiting: dict[tuple[str, str], list[int]] = {}
    for k, (real, imaginary) in enumerate(zip(log["resistance_ohm"], log["reactance_ohm"], strict=True)):
        waiting.setdefault(reading_key(complex(real, imaginary)), []).append(k)
    places = []
    for z in record.impedance_ohm:
        entries = waiting.get(reading_key(complex(z)), [])
        places.append(entries.pop(0) if entries else -1)
    return np.array(places, dtype=np.int64)


def spread(values: Array, digits: int = 4) -> dict[str, float]:
    """Return mean, sd, p95 of the magnitude, least and largest of some values."""
    if values.size == 0:
        return {}
    figures = {
        "mean": values.mean(),
        "sd": values.std(),
        "p95_abs": np.percentile(np.abs(values), 95),
        "min": values.min(),
        "max": values.max(),
    }
    return {name: round(float(value), digits) for name, value in figures.items()}


def deviation(signed_mm: Array) -> dict[str, float]:
    """Return mean_abs_mm, rmse_mm, p95_mm and max_mm of signed deviations."""
    size = np.abs(signed_mm)
    figures = (size.mean(), np.sqrt((size**2).mean()), np.percentile(size, 95), size.max())
    names = ("mean_abs_mm", "rmse_mm", "p95_mm", "max_mm")
    return {name: round(float(figure), 4) for name, figure in zip(names, figures, strict=True)}


def best_fit(part: NominalPart, vertices: Array) -> Array:
    """Return the rigid motion that brings vertices (V, 3) onto the exact surface, point to plane, far ones left out.

    A weak pull towards no motion (as if every point were known to 1 mm against
    its distance to the surface) keeps shapes from sliding along themselves: a
    block along its wave's crest, a twisted blade along its axis.
    """
    some = vertices[:: max(1, len(vertices) // 8000)]
    centre = some.mean(axis=0)
    radius = float(np.sqrt(((some - centre) ** 2).sum(axis=1).mean()))
    pull = SLIDING_PULL * np.array([radius**2] * 3 + [1.0] * 3)
    T, gone = np.eye(4), np.zeros(6)
    for _ in range(FIT_STEPS):
        at = apply(T, some)
        _, normal, distance = part.closest(at)
        size = np.abs(distance)
        keep = size <= max(3 * 1.4826 * float(np.median(size)), 0.02)
        J = np.hstack([np.cross(at - centre, normal), normal])[keep]
        A = J.T @ J / len(J) + np.diag(pull)
        move = np.asarray(np.linalg.solve(A, -J.T @ distance[keep] / len(J) - pull * gone), dtype=np.float64)
        gone = gone + move
        turn = from_rotation_vector(move[:3], np.zeros(3))
        turn[:3, 3] = centre - turn[:3, :3] @ centre + move[3:]
        T = turn @ T
        if np.abs(move[3:]).max() < 1e-5 and np.abs(move[:3]).max() < 1e-7:
            break
    return T


def _alignment(log: Mapping[str, Any], record: ScanRecord) -> dict[str, float]:
    """Return how far the scan's T_stage_part is from the true one, at the middle of its readings."""
    T_true = np.asarray(log["T_stage_part"], dtype=float)
    T_part_surface = np.asarray(log["T_part_surface"], dtype=float)
    T_believed = record.T_stage_part @ invert(T_part_surface)
    middle = apply(invert(T_believed), record.stage_mm.mean(axis=0)[None])
    shift = apply(T_believed, middle) - apply(T_true, middle)
    turn = angle_deg(invert(T_true) @ T_believed)
    return {"shift_mm": round(float(np.linalg.norm(shift)), 4), "turn_deg": round(turn, 4)}


def _feet(log: Mapping[str, Any] | None, record: ScanRecord | None) -> Array:
    """Return the spots below the readings on the part (N, 3) [mm, part], those of the record alone when it is given."""
    if log is None:
        return np.empty((0, 3))
    feet = np.asarray(log["foot_mm"], dtype=float).reshape(-1, 3)
    over = np.array([body == "part" for body in log.get("body", ["part"] * len(feet))], dtype=bool)
    if record is None:
        return np.asarray(feet[over])
    places = match_readings(log, record)
    places = places[places >= 0]
    return np.asarray(feet[places[over[places]]])


def _nearest_flaw(flaws: tuple[Flaw, ...], at: Array) -> int | None:
    """Return the number of the flaw that a spot (3,) [mm, part] belongs to, None when it is a false call."""
    distances = [float(np.linalg.norm(flaw.centre_mm - at)) for flaw in flaws]
    for number in np.argsort(distances):
        if distances[number] <= NEAR_FLAW_MM + flaws[number].size.length_mm / 2:
            return int(number)
    return None
