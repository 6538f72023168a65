"""Closed forms and brute force that the physics is measured against; none of it uses the model's own formulas."""

from __future__ import annotations

import numpy as np
from scipy.special import eval_legendre

from eddyscan.core.frames import Array
from eddyscan.physics import Coil
from eddyscan.physics.coil import MU0

# Published finite elements on TEAM 15 problem 1: position [mm], dL [uH], dR [ohm]
# (GitHub xfmrexpert/MFEM-ElectroMag, examples/team15, README @89d07fa).
FINITE_ELEMENTS = np.array(
    [
        (0, 437, 0.22),
        (2, 678, -0.10),
        (4, 1264, -0.87),
        (6, 1893, -1.65),
        (8, 2284, -2.00),
        (9, 2343, -1.96),
        (10, 2304, -1.79),
        (12, 1963, -1.10),
        (14, 1388, -0.17),
        (16, 797, 0.52),
        (18, 370, 0.69),
        (20, 145, 0.50),
    ]
)


def loop_mutual_h(one: tuple[float, Array, Array], other: tuple[float, Array, Array], points: int) -> float:
    """Return Neumann's double integral over two circles (radius [m], centre [m], axis), trapezoidal in both angles."""
    place_a, step_a = _circle(*one, points)
    place_b, step_b = _circle(*other, points)
    distance = np.linalg.norm(place_a[:, None] - place_b[None], axis=2)
    return float(MU0 / (4 * np.pi) * np.sum((step_a @ step_b.T) / distance))


def _circle(radius_m: float, centre_m: Array, axis: Array, points: int) -> tuple[Array, Array]:
    axis = axis / np.linalg.norm(axis)
    one = np.cross(axis, [0.0, 1.0, 0.0])
    one /= np.linalg.norm(one)
    two = np.cross(axis, one)
    angle = 2 * np.pi * np.arange(points) / points
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    place = centre_m + radius_m * (cosine * one + sine * two)
    return place, radius_m * 2 * np.pi / points * (cosine * two - sine * one)


def coil_over_perfect_conductor_h(coil: Coil, lift_off_mm: float, tilt_deg: float, *, cells: int = 3) -> float:
    """Return the change of inductance [H] over a perfect conductor: Neumann's integral with the image coil.

    The winding is cut into cells x cells loops (Gauss points). The image winding
    carries the mirrored current, so its axis is turned in x and y, not in z.
    """
    tilt = np.radians(tilt_deg)
    axis = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    nodes, weights = np.polynomial.legendre.leggauss(cells)
    radii = coil.inner_m + 0.5 * (coil.outer_m - coil.inner_m) * (nodes + 1)
    heights = 0.5 * coil.length_m * (nodes + 1)
    face = np.array([0.0, 0.0, 1e-3 * lift_off_mm])
    loops = [
        (w * v / 4, r, face + z * axis)
        for r, w in zip(radii, weights, strict=True)
        for z, v in zip(heights, weights, strict=True)
    ]
    turned, mirror = axis * [-1.0, -1.0, 1.0], np.array([1.0, 1.0, -1.0])
    total = sum(
        share * other * loop_mutual_h((r, place, axis), (s, mirror * at, turned), 48)
        for share, r, place in loops
        for other, s, at in loops
    )
    return -(coil.turns**2) * total


def coil_over_sphere_ohm(
    coil: Coil, radius_mm: float, lift_off_mm: float, *, frequency_hz: float, sigma_s_m: float, terms: int
) -> complex:
    """Return dZ of an axisymmetric coil over a conducting sphere, exact but for cutting the winding into loops.

    Loops' vector potential in Legendre functions; the sphere answers each order n by
    x r_n / (2n + 1 - x r_n), r_n = j_(n+1)/j_n (Smythe, Static and Dynamic
    Electricity, 3rd ed., chapter 10).
    """
    nodes, weights = np.polynomial.legendre.leggauss(8)
    a = 1e-3 * radius_mm
    radii = coil.inner_m + 0.5 * (coil.outer_m - coil.inner_m) * (nodes + 1)
    heights = a + 1e-3 * lift_off_mm + 0.5 * coil.length_m * (nodes + 1)
    rho, z = (grid.ravel() for grid in np.meshgrid(radii, heights))
    weight = np.outer(weights, weights).ravel() / 4 * coil.turns
    r = np.hypot(rho, z)
    cosine, sine = z / r, rho / r
    n = np.arange(1, terms + 1)[:, None]
    slope = n * (eval_legendre(n - 1, cosine) - cosine * eval_legendre(n, cosine)) / sine
    x = np.sqrt(-2j * np.pi * frequency_hz * MU0 * sigma_s_m) * a
    ratio = np.array([bessel_ratio(order, x) for order in range(1, terms + 1)])
    order = n[:, 0]
    answer = x * ratio / ((2 * order + 1) - x * ratio)
    moment = (slope * sine * (a / r) ** n) @ weight
    return complex(2j * np.pi * frequency_hz * np.pi * MU0 * a * np.sum(answer / (order * (order + 1)) * moment**2))


def bessel_ratio(order: int, x: complex) -> complex:
    """Return j_(n+1)(x) / j_n(x) by the continued fraction, safe for large complex x."""
    value = 0j
    for step in range(order + int(abs(x)) + 60, order, -1):
        value = 1.0 / ((2 * step + 1) / x - value)
    return value
