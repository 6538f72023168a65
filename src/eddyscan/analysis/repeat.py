"""Two inspections of one part: what changed between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from eddyscan.analysis.background import robust_sigma
from eddyscan.analysis.result import AnalysisResult
from eddyscan.core.errors import InputError
from eddyscan.core.footing import SmoothSurface
from eddyscan.core.frames import Array, apply, from_rotation_vector, transform
from eddyscan.core.indication import Indication

ITERATIONS = 15
SAMPLES = 4000
FARTHEST_MM = 5.0
LEAST_OVERLAP = 0.3


@dataclass(frozen=True)
class ScanComparison:
    """Inspection B against inspection A, on A's surface.

    Attributes
    ----------
    T_a_b : (4, 4)
        Takes B's part frame to A's, found from the surfaces and shared indications.
    misfit_mm : float [mm] rms distance of the registered surfaces
    overlap : float
        Share of A's covered vertices that B covers too.
    change : dict of name -> (V,)
        B minus A on A's vertices for every shared channel; NaN where either is uncovered.
    noise : dict of name -> float
        Robust standard deviation of each change.
    matched : tuple of (number in A, number in B)
    appeared : tuple of Indication [B's numbers, A's frame]
    gone : tuple of Indication of A
    """

    T_a_b: Array
    misfit_mm: float
    overlap: float
    change: dict[str, Array]
    noise: dict[str, float]
    matched: tuple[tuple[int, int], ...]
    appeared: tuple[Indication, ...]
    gone: tuple[Indication, ...]


def compare_scans(a: AnalysisResult, b: AnalysisResult, *, near_mm: float = 3.0) -> ScanComparison:
    """Register two inspections of one part and map what changed.

    Parameters
    ----------
    a, b : AnalysisResult
        Earlier and later inspection.
    near_mm : float [mm]
        Indications nearer than this are one and the same.

    Raises
    ------
    InputError
        When the two do not overlap: another part, or other ends exchanged.
    """
    T, misfit = _registered(a, b)
    tree = KDTree(apply(T, b.cscan.mesh.vertices))
    distance, nearest = tree.query(a.cscan.mesh.vertices)
    both = a.cscan.covered & b.cscan.covered[nearest] & (distance < near_mm)
    overlap = float(both.sum() / max(int(a.cscan.covered.sum()), 1))
    if overlap < LEAST_OVERLAP:
        raise InputError(
            f"the two inspections share {100 * overlap:.0f} % of the covered surface (at least "
            f"{100 * LEAST_OVERLAP:.0f} % is needed); the surfaces fit to {misfit:.2f} mm. "
            "Are they of the same part, the same way round?"
        )
    shared = sorted(set(a.cscan.channels) & set(b.cscan.channels))
    change = {k: np.where(both, b.cscan.channels[k][nearest] - a.cscan.channels[k], np.nan) for k in shared}
    matched = _matched(a, b, T, near_mm)
    seen_a, seen_b = {pair[0] for pair in matched}, {pair[1] for pair in matched}
    return ScanComparison(
        T,
        misfit,
        overlap,
        change,
        {name: robust_sigma(values) for name, values in change.items()},
        matched,
        tuple(i for i in b.indications if i.number not in seen_b),
        tuple(i for i in a.indications if i.number not in seen_a),
    )


def _registered(a: AnalysisResult, b: AnalysisResult) -> tuple[Array, float]:
    """Return T_a_b and the rms misfit [mm]: point to plane, then the slide left open fixed by shared indications.

    Both surfaces stand in the part frame already, so the search begins at identity.
    """
    surface = SmoothSurface(a.cscan.mesh)
    points = b.cscan.mesh.vertices[:: max(1, len(b.cscan.mesh.vertices) // SAMPLES)]
    middle = points.mean(axis=0)
    T, misfit = transform(), float("inf")
    for _ in range(ITERATIONS):
        moved = apply(T, points)
        below = surface.below(moved)
        near = np.linalg.norm(moved - below.foot_mm, axis=1) < FARTHEST_MM
        if near.sum() < 0.2 * len(points):
            break
        arm = moved[near] - middle
        J = np.concatenate([np.cross(arm, below.normal[near]), below.normal[near]], axis=1)
        pull, force = _pairs(a, b, T, middle)
        prior = np.diag([1e2, 1e2, 1e2, 1e-2, 1e-2, 1e-2]) * len(J) * 1e-4
        step = np.linalg.solve(J.T @ J + pull + prior, -J.T @ below.distance_mm[near] - force)
        about = transform(None, tuple(middle))
        T = about @ from_rotation_vector(step[:3], step[3:]) @ transform(None, tuple(-middle)) @ T
        misfit = float(np.sqrt(np.mean(below.distance_mm[near] ** 2)))
        if np.abs(step).max() < 1e-7:
            break
    return T, misfit


def _pairs(a: AnalysisResult, b: AnalysisResult, T: Array, middle: Array) -> tuple[Array, Array]:
    """Return normal matrix and force of shared strong indications: they hold the part where its shape slides."""
    matrix, force = np.zeros((6, 6)), np.zeros(6)
    for number_a, number_b in _matched(a, b, T, 2 * FARTHEST_MM):
        target = np.array(next(i.centre_mm for i in a.indications if i.number == number_a))
        at = apply(T, np.array([next(i.centre_mm for i in b.indications if i.number == number_b)]))[0]
        x, y, z = at - middle
        rows = np.concatenate([np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]]), np.eye(3)], axis=1)
        weight = 100.0
        matrix += weight * rows.T @ rows
        force += weight * rows.T @ (at - target)
    return matrix, force


def _matched(a: AnalysisResult, b: AnalysisResult, T: Array, near_mm: float) -> tuple[tuple[int, int], ...]:
    """Pair indications that are each other's nearest within `near_mm`."""
    if not a.indications or not b.indications:
        return ()
    at_a = np.array([i.centre_mm for i in a.indications])
    at_b = apply(T, np.array([i.centre_mm for i in b.indications]))
    distance = np.linalg.norm(at_a[:, None] - at_b[None], axis=2)
    pairs = []
    for row, column in enumerate(distance.argmin(axis=1)):
        if distance[row, column] <= near_mm and distance[:, column].argmin() == row:
            pairs.append((a.indications[row].number, b.indications[int(column)].number))
    return tuple(pairs)
