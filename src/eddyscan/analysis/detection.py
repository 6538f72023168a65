"""Readings against the footprint of a small crack: many weak neighbours speak louder than one.

A crack much shorter than the coil changes the impedance by the square of the
electric field across it (reciprocity, Auld and Moulder 1999), so a coil at
distance r and bearing phi sees E(r)^2 cos^2(phi - angle): two lobes along the
crack. The matched filter for every angle at once needs only the sums over the
neighbours weighted by E^2 and by E^2 exp(2 i phi). A crack in
non-magnetic metal moves the reading to one known side of the lift-off curve; the
score has that sign. It is the smaller of two estimates of the same amplitude, one
with and one without the local mean, so that a slow hump does not pass for a crack.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree
from scipy.special import j1

from eddyscan.analysis.background import robust_sigma
from eddyscan.core.footing import tangent_frames
from eddyscan.core.frames import Array, ComplexArray, IntArray
from eddyscan.physics.coil import source, wave_numbers
from eddyscan.physics.conductor import layer_lambda
from eddyscan.physics.sound_response import SoundResponse

REACH_IN_OUTER_RADII = 1.6
ANGLES = 12
PROFILE_POINTS = 120
LEAST_NEIGHBOURS = 3


@dataclass(frozen=True)
class Match:
    """How well the surroundings of each reading look like a small crack below it.

    Attributes
    ----------
    score : (M,) largest over all angles, in robust standard deviations
    whole : (M,) the same without the local mean taken out: better at the place, worse at telling humps
    angle_deg : (M,) of the best crack direction against the surface's x, 0 to 180
    """

    score: Array
    angle_deg: Array
    whole: Array


def match_cracks(
    across_ohm: Array, foot_mm: Array, normal: Array, response: SoundResponse, *, lift_off_mm: float
) -> Match:
    """Match the crack channel with small cracks of every direction below every reading.

    Parameters
    ----------
    across_ohm : (M,) [ohm] residual across the lift-off curve, NaN where unknown
    foot_mm, normal : (M, 3) [mm, part]
    response : SoundResponse
        Coil, metal and frequency.
    lift_off_mm : float [mm] typical lift-off of the scan
    """
    known = np.flatnonzero(np.isfinite(across_ohm))
    score, angle, whole = (np.full(len(across_ohm), np.nan) for _ in range(3))
    reach = REACH_IN_OUTER_RADII * response.coil.outer_radius_mm
    first, second, distance, bearing = _neighbours(foot_mm[known], normal[known], reach)
    weight = _profile(response, lift_off_mm, reach, distance)
    best, best_angle, best_whole = _strongest(across_ohm[known], first, second, weight, bearing)
    score[known], angle[known], whole[known] = best, best_angle, best_whole
    return Match(score, angle, whole)


def field_power(response: SoundResponse, lift_off_mm: float, distance_mm: Array) -> Array:
    """Return the squared electric field at the surface at distances (K,) [mm] from the coil's axis (any unit).

    Dodd and Deeds: E = integral of M(k) exp(-k h) k / (k + lambda) J1(k r) dk.
    """
    k, weight = wave_numbers(response.coil, finest_m=response.coil.outer_m)
    layer = response.conductor.layers[0]
    real = weight * source(response.coil, k) * np.exp(-k * lift_off_mm * 1e-3)
    spectrum = real * k / (k + layer_lambda(layer, k, response.frequency_hz))
    field = j1(np.outer(distance_mm * 1e-3, k)) @ spectrum
    return np.asarray(np.abs(field) ** 2)


def _profile(response: SoundResponse, lift_off_mm: float, reach_mm: float, distance_mm: Array) -> Array:
    knots = np.linspace(0.0, reach_mm, PROFILE_POINTS)
    power = field_power(response, lift_off_mm, knots)
    return np.asarray(np.interp(distance_mm, knots, power / power.max()))


def _neighbours(foot_mm: Array, normal: Array, reach_mm: float) -> tuple[IntArray, IntArray, Array, ComplexArray]:
    """Return pairs, their distance [mm] and exp(2 i bearing) in the surface."""
    pairs = KDTree(foot_mm).query_pairs(reach_mm, output_type="ndarray")
    first, second = pairs[:, 0], pairs[:, 1]
    frame = tangent_frames(normal)[:, :2]
    offset = foot_mm[second] - foot_mm[first]
    x = (offset * frame[first, 0]).sum(axis=1)
    y = (offset * frame[first, 1]).sum(axis=1)
    direction = (x + 1j * y) / np.maximum(np.hypot(x, y), 1e-12)
    return first, second, np.linalg.norm(offset, axis=1), np.asarray(direction**2)


def _strongest(
    channel: Array, first: IntArray, second: IntArray, weight: Array, bearing: ComplexArray
) -> tuple[Array, Array, Array]:
    n = len(channel)

    def around(value: Array, *, of: Array | None = None) -> Array:
        """Sum a symmetric pair value over each reading's neighbours, times the neighbour's channel."""
        a = value if of is None else value * of[second]
        b = value if of is None else value * of[first]
        return np.asarray(np.bincount(first, a, minlength=n) + np.bincount(second, b, minlength=n), dtype=np.float64)

    cosine, sine = bearing.real, bearing.imag
    even = around(weight, of=channel)
    turned = around(weight * cosine, of=channel) + 1j * around(weight * sine, of=channel)
    power = weight**2
    power_0 = around(power)
    power_2 = around(power * cosine) + 1j * around(power * sine)
    count = around(np.ones_like(weight)) + 1.0
    power_4 = around(power * (2 * cosine**2 - 1)) + 1j * around(power * 2 * cosine * sine)
    alone = count < 1.0 + LEAST_NEIGHBOURS
    level = (around(np.ones_like(weight), of=channel) + channel) / count
    sum_0, sum_2 = around(weight), around(weight * cosine) + 1j * around(weight * sine)
    angles = np.arange(ANGLES) * np.pi / ANGLES
    scores, wholes = np.empty((ANGLES, n)), np.empty((ANGLES, n))
    for row, angle in enumerate(angles):
        back = np.exp(-2j * angle)
        norm = 1.5 * power_0 + 2 * (power_2 * back).real + 0.5 * (power_4 * back**2).real
        total = sum_0 + (sum_2 * back).real
        matched = even + (turned * back).real
        left = np.maximum(norm - total**2 / count, 0.1 * norm + 1e-30)
        root = np.sqrt(np.maximum(norm, 1e-30))
        whole, level_free = matched / root, (matched - level * total) * root / left
        sigma = max(robust_sigma(whole[~alone]), 1e-300)
        scores[row], wholes[row] = np.minimum(whole, level_free) / sigma, whole / sigma
    scores[:, alone] = 0.0
    best = scores.argmax(axis=0)
    return scores[best, np.arange(n)], np.degrees(angles[best]), wholes.max(axis=0)
