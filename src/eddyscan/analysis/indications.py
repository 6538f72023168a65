"""Indications: connected signals above the call level, the two lobes of one crack counted once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from eddyscan.core.frames import Array, BoolArray, ComplexArray, IntArray
from eddyscan.core.indication import Indication

SAME_SIDE = 0.3
LEAST_READINGS = 2
FLANK_MM = 1.0
HALF = 0.5


@dataclass(frozen=True)
class Signals:
    """What indications are made from, per reading.

    Attributes
    ----------
    foot_mm : (M, 3) [mm, part]
    normal : (M, 3)
    row : (M,) int64
    residual_ohm : (M,) complex [ohm]
    score : (M,)
        Matched residual over its robust noise.
    placing : (M,)
        The score that is best at the place.
    callable : (M,) bool
        Covered, away from edges.
    noise_ohm : float [ohm] robust noise of the residual across the lift-off curve
    """

    foot_mm: Array
    normal: Array
    row: IntArray
    residual_ohm: ComplexArray
    score: Array
    placing: Array
    callable: BoolArray
    noise_ohm: float


def find_indications(signals: Signals, *, threshold: float, merge_mm: float) -> tuple[Indication, ...]:
    """Call every connected signal above the threshold.

    Parameters
    ----------
    signals : Signals
    threshold : float
        Call level of the score in robust standard deviations.
    merge_mm : float [mm]
        One coil diameter: readings nearer than this, on the same side of the part,
        belong to one indication. A crack shows as two lobes about a mean coil
        diameter apart.

    Returns
    -------
    tuple of Indication, strongest first.
    """
    above = np.flatnonzero(signals.callable & (np.nan_to_num(signals.score) >= threshold))
    groups = [members for members in connected(signals, above, merge_mm) if len(members) >= LEAST_READINGS]
    groups.sort(key=lambda members: -float(signals.score[members].max()))
    return tuple(_indication(number, signals, members) for number, members in enumerate(groups, start=1))


def connected(signals: Signals, above: IntArray, merge_mm: float) -> list[IntArray]:
    """Return the groups of reading numbers that hang together within `merge_mm`."""
    if len(above) == 0:
        return []
    pairs = KDTree(signals.foot_mm[above]).query_pairs(merge_mm, output_type="ndarray")
    facing = (signals.normal[above[pairs[:, 0]]] * signals.normal[above[pairs[:, 1]]]).sum(axis=1) > SAME_SIDE
    pairs = pairs[facing]
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(above), len(above)))
    count, label = connected_components(graph, directed=False)
    return [above[label == k] for k in range(count)]


def _indication(number: int, signals: Signals, members: IntArray) -> Indication:
    score = signals.score[members]
    weight = score**2
    foot = signals.foot_mm[members]
    centre = _centre(signals, members)
    extent, angle = _extent(foot, weight, signals, members)
    strongest = members[int(np.argmax(np.abs(signals.residual_ohm[members])))]
    peak = signals.residual_ohm[strongest]
    return Indication(
        number=number,
        centre_mm=(float(centre[0]), float(centre[1]), float(centre[2])),
        extent_mm=extent,
        angle_deg=angle,
        amplitude_ohm=float(abs(peak)),
        phase_deg=float(np.degrees(np.angle(peak))),
        snr=float(score.max()),
    )


def _centre(signals: Signals, members: IntArray) -> Array:
    """Return the score's centroid (3,) over all readings at the indication above half its peak.

    A weak indication has one or two readings above the call level; its flanks know its place better.
    """
    peak = float(signals.placing[members].max())
    away, _ = KDTree(signals.foot_mm[members]).query(signals.foot_mm, distance_upper_bound=FLANK_MM)
    flank = np.isfinite(away) & (np.nan_to_num(signals.placing) >= HALF * peak)
    weight = signals.placing[flank] ** 2
    return np.asarray((weight[:, None] * signals.foot_mm[flank]).sum(axis=0) / weight.sum())


def _extent(foot: Array, weight: Array, signals: Signals, members: IntArray) -> tuple[float, float]:
    """Return the longest extent [mm] and its angle to the row direction [deg, 0 to 180)."""
    normal = signals.normal[members].mean(axis=0)
    along = row_direction(signals, members)
    along = along - normal * (along @ normal) / max(float(normal @ normal), 1e-12)
    along /= max(float(np.linalg.norm(along)), 1e-12)
    across = np.cross(normal / np.linalg.norm(normal), along)
    plane = (foot - np.average(foot, axis=0, weights=weight)) @ np.stack([along, across], axis=1)
    values, vectors = np.linalg.eigh((plane * weight[:, None]).T @ plane / weight.sum())
    major = vectors[:, int(np.argmax(values))]
    reach = plane @ major
    return float(reach.max() - reach.min()), float(np.degrees(np.arctan2(major[1], major[0])) % 180.0)


def row_direction(signals: Signals, members: IntArray) -> Array:
    """Return the unit direction (3,) of the row through the middle reading; x when the row is one reading."""
    row = np.flatnonzero(signals.row == signals.row[members[len(members) // 2]])
    span = signals.foot_mm[row[-1]] - signals.foot_mm[row[0]]
    nearby = row[np.argsort(np.abs(row - members[len(members) // 2]))[:5]]
    span = signals.foot_mm[nearby.max()] - signals.foot_mm[nearby.min()] if len(nearby) > 1 else span
    length = float(np.linalg.norm(span))
    return np.asarray(span / length) if length > 1e-9 else np.array([1.0, 0.0, 0.0])
