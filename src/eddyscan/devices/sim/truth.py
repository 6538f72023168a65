"""What the world knows: the same quantities the software reports, measured against the truth.

Nothing here is reachable from a device driver; the pipeline asks for it after
the steps are done and puts the answers into `summary.json` under `truth`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from eddyscan.core.frames import Array, angle_deg, apply, from_rotation_vector, invert
from eddyscan.core.indication import Indication
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import NominalPart
from eddyscan.core.record import ScanRecord
from eddyscan.devices.sim.flaws import Flaw
from eddyscan.devices.sim.world_placement import surface_pose
from eddyscan.devices.sim.world_probe import ProbeOverPart, TrueReading, reading_key

NEAR_FLAW_MM = 3.0
CONTACT_MM = -0.02
COVERED_WITHIN_MM = 2.0
FIT_STEPS = 8


def spread(values: Array, digits: int = 4) -> dict[str, float]:
    """Return mean, std, p95 of the magnitude, least and largest of some values."""
    if values.size == 0:
        return {}
    figures = {
        "mean": values.mean(),
        "std": values.std(),
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


class CellTruth:
    """The truth about one virtual cell."""

    def __init__(self, part: NominalPart, T_stage_part: Array, flaws: tuple[Flaw, ...], probe: ProbeOverPart) -> None:
        self._part, self._T_stage_part, self._flaws, self._probe = part, T_stage_part, flaws, probe
        self._T_part_surface = surface_pose(part)

    def surface_truth(self, mesh: SurfaceMesh) -> dict[str, Any]:
        """Return how far a reconstructed surface is from the exact one, in its own frame and after a best fit.

        Parameters
        ----------
        mesh : SurfaceMesh [mm, part as reconstructed]
            Its axes may be the part's or turned by 180 deg; the better is taken and told.

        Returns
        -------
        dict
            `own` and `fit`: mean_abs_mm, rmse_mm, p95_mm, max_mm along the normal;
            `coverage`: share of the exact top with a vertex within 2 mm (or 1.5
            edges of a coarser mesh); `shift_mm` (3,), `turn_deg`: the best fit;
            `turned`: whether the ends were exchanged.
        """
        self._T_part_surface = surface_pose(self._part, mesh)
        vertices = apply(self._T_part_surface, mesh.vertices)
        own = self._part.closest(vertices)[2]
        T_fit = self._best_fit(vertices)
        fitted = apply(T_fit, vertices)
        edge = float(np.median(np.linalg.norm(vertices[mesh.faces[:, 0]] - vertices[mesh.faces[:, 1]], axis=1)))
        reach = max(COVERED_WITHIN_MM, 1.5 * edge)
        seen, _ = KDTree(fitted).query(self._part.top_mesh(2.0).vertices, distance_upper_bound=reach)
        return {
            "own": deviation(own),
            "fit": deviation(self._part.closest(fitted)[2]),
            "coverage": round(float(np.isfinite(seen).mean()), 4),
            "shift_mm": [round(float(s), 4) for s in T_fit[:3, 3]],
            "turn_deg": round(angle_deg(T_fit), 4),
            "turned": bool(self._T_part_surface[0, 0] < 0),
        }

    def path_truth(self, record: ScanRecord, target_mm: float | None = None) -> dict[str, Any]:
        """Return the true lift-off and tilt along a recorded path, and how far the record's positions are off.

        Readings are found again by their impedance, so only those of this
        session of the cell can be told; `matched` says how many.
        """
        truths = self.true_readings(record)
        known = [k for k, t in enumerate(truths) if t is not None]
        found = [t for t in truths if t is not None]
        lift_off = np.array([t.lift_off_mm for t in found])
        inside = np.array([not t.near_edge for t in found], dtype=bool)
        stage_error = np.array([t.stage_mm for t in found]).reshape(-1, 3) - record.stage_mm[known]
        result: dict[str, Any] = {
            "readings": len(record),
            "matched": len(found),
            "lift_off_mm": spread(lift_off),
            "tilt_deg": spread(np.array([t.tilt_deg for t in found])),
            "in_edge_zone": int((~inside).sum()),
            "contacts": int((lift_off < CONTACT_MM).sum()),
            "stage_error_mm": {axis: spread(stage_error[:, k]) for k, axis in enumerate("xyz")},
            "alignment": self._alignment(record),
        }
        if target_mm is not None:
            result["lift_off_error_mm"] = spread(lift_off - target_mm)
        return result

    def indication_truth(self, indications: Sequence[Indication], record: ScanRecord | None = None) -> dict[str, Any]:
        """Return which flaws were found, missed or never crossed, and which calls are false."""
        near = [self._nearest_flaw(indication) for indication in indications]
        flaws = []
        for number, flaw in enumerate(self._flaws):
            mine = [k for k, flaw_number in enumerate(near) if flaw_number == number]
            flaws.append(
                flaw.as_dict()
                | {"found": bool(mine), "indications": [indications[k].number for k in mine]}
                | self._crossing(flaw, record)
            )
        return {
            "flaws": flaws,
            "found": sum(bool(flaw["found"]) for flaw in flaws),
            "of": len(flaws),
            "false_calls": sum(number is None for number in near),
        }

    def true_readings(self, record: ScanRecord) -> list[TrueReading | None]:
        """Return the truth behind each reading (None where this cell did not take it): for benchmarks and tests."""
        waiting = {key: list(entries) for key, entries in self._probe.log.items()}
        found: list[TrueReading | None] = []
        for z in record.impedance_ohm:
            entries = waiting.get(reading_key(complex(z)), [])
            found.append(entries.pop(0) if entries else None)
        return found

    def true_pose(self) -> Array:
        """Return T_stage_part: for benchmarks and tests."""
        return self._T_stage_part

    def flaws(self) -> list[dict[str, Any]]:
        """Return every flaw in the part's own frame: for benchmarks and tests."""
        return [flaw.as_dict() for flaw in self._flaws]

    def _best_fit(self, vertices: Array) -> Array:
        """Return the rigid motion that brings vertices onto the exact surface, point to plane, far ones left out."""
        T: Array = np.eye(4)
        step = max(1, len(vertices) // 20000)
        some = vertices[::step]
        for _ in range(FIT_STEPS):
            at = apply(T, some)
            _, normal, distance = self._part.closest(at)
            size = np.abs(distance)
            keep = size <= max(3 * 1.4826 * float(np.median(size)), 0.02)
            J = np.hstack([np.cross(at, normal), normal])[keep]
            A = J.T @ J + 1e-6 * len(J) * np.eye(6)
            move = np.asarray(np.linalg.solve(A, -J.T @ distance[keep]), dtype=np.float64)
            T = from_rotation_vector(move[:3], move[3:]) @ T
        return T

    def _alignment(self, record: ScanRecord) -> dict[str, float]:
        """Return how far the scan's T_stage_part is from the true one, at the middle of the part."""
        middle = self._part.top_mesh(8.0).vertices.mean(axis=0)[None]
        T_believed = record.T_stage_part @ invert(self._T_part_surface)
        shift = apply(T_believed, middle) - apply(self._T_stage_part, middle)
        turn = angle_deg(invert(self._T_stage_part) @ T_believed)
        return {"shift_mm": round(float(np.linalg.norm(shift)), 4), "turn_deg": round(turn, 4)}

    def _nearest_flaw(self, indication: Indication) -> int | None:
        """Return the number of the flaw an indication belongs to, None for a false call."""
        at = apply(self._T_part_surface, np.array([indication.centre_mm]))[0]
        for number, flaw in sorted(
            enumerate(self._flaws), key=lambda item: float(np.linalg.norm(item[1].centre_mm - at))
        ):
            if np.linalg.norm(flaw.centre_mm - at) <= NEAR_FLAW_MM + flaw.size.length_mm / 2:
                return number
        return None

    def _crossing(self, flaw: Flaw, record: ScanRecord | None) -> dict[str, Any]:
        """Return how near the readings came to a flaw."""
        if record is None:
            return {}
        feet = np.array([t.foot_mm for t in self.true_readings(record) if t is not None]).reshape(-1, 3)
        if len(feet) == 0:
            return {"nearest_reading_mm": None}
        return {"nearest_reading_mm": round(float(np.linalg.norm(feet - flaw.centre_mm, axis=1).min()), 3)}
