"""Impedance of a coil over a layered conductor: exact for any lift-off and tilt.

Time convention exp(+j omega t). Two formulas:

* upright coil (Dodd and Deeds, J. Appl. Phys. 39 (1968) 2829; Cheng, Dodd and
  Deeds 1971 for layers):
  dZ = j omega pi mu0 i^2 integral of M(k)^2 exp(-2 k h) Gamma(k) dk
* tilted coil: the field of an axisymmetric coil is a solution of Laplace's
  equation, so the spectrum on the conductor depends only on
  q = k (cos a + j sin a cos phi):
  dZ = j omega pi mu0 i^2 integral of exp(-2 k hc) Gamma(k) <|R(q) 2 sinh(q l/2) / q|^2>_phi dk
  with hc the height of the coil's centre. It equals the upright formula at a = 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.physics import checks
from eddyscan.physics.coil import MM, MU0, Coil, air_inductance_h, source, wave_numbers, winding_integral
from eddyscan.physics.conductor import Conductor, reflection

CHUNK = 1_000_000


def impedance_ohm(
    coil: Coil, conductor: Conductor, frequency_hz: float, lift_off_mm: ArrayLike, tilt_deg: float = 0.0
) -> ComplexArray:
    """Return the coil's impedance over a sound conductor, without the wire's dc resistance.

    Parameters
    ----------
    coil : Coil
    conductor : Conductor
    frequency_hz : float
    lift_off_mm : (...) float64 [mm]
        Distance of the coil face's centre to the surface along the normal.
    tilt_deg : float
        Angle between the coil axis and the surface normal, about the face centre.

    Returns
    -------
    impedance : (...) complex128 [ohm]
        j omega L0 + dZ.

    Raises
    ------
    TechniqueError
        Frequency not positive, lift-off negative, or a tilt at which the coil's
        rim would cut into the part.
    """
    change = impedance_change_ohm(coil, conductor, frequency_hz, lift_off_mm, tilt_deg)
    return np.asarray(2j * np.pi * frequency_hz * air_inductance_h(coil) + change)


def impedance_change_ohm(
    coil: Coil, conductor: Conductor, frequency_hz: float, lift_off_mm: ArrayLike, tilt_deg: float = 0.0
) -> ComplexArray:
    """Return dZ, the change against the coil in air (...) [ohm]; arguments and errors of `impedance_ohm`."""
    checks.positive("frequency_hz", frequency_hz, unit="Hz")
    lift_off = np.asarray(lift_off_mm, dtype=np.float64)
    checks.lift_offs(lift_off, least_mm=least_lift_off_mm(coil, tilt_deg), reason="the coil would cut into the part")
    if lift_off.size == 0:
        return np.zeros(lift_off.shape, dtype=np.complex128)
    clearance = lift_off * MM - coil.outer_m * np.sin(np.radians(abs(tilt_deg)))
    k, w = wave_numbers(coil, finest_m=2 * float(clearance.min()))
    spectrum = w * reflection(conductor, k, frequency_hz) * power_spectrum(coil, k, tilt_deg)
    scale = 2j * np.pi * frequency_hz * np.pi * MU0 * coil.turn_density**2
    return np.asarray(scale * laplace_sum(k, spectrum, 2 * clearance))


def least_lift_off_mm(coil: Coil, tilt_deg: float) -> float:
    """Return the lift-off [mm] of the face centre at which the coil's rim touches the surface.

    Raises
    ------
    TechniqueError
        The tilt is 80 deg or more, or not finite.
    """
    if not abs(tilt_deg) < 80:
        raise TechniqueError(f"tilt_deg = {tilt_deg:g}: must lie between -80 and 80 deg.")
    return float(coil.outer_radius_mm * np.sin(np.radians(abs(tilt_deg))))


def power_spectrum(coil: Coil, k: Array, tilt_deg: float = 0.0) -> Array:
    """Return the squared source spectrum (K,) [m^6] at the height where the coil's lowest point touches.

    Multiply by exp(-2 k c) for a clearance c [m] below that point.
    """
    if tilt_deg == 0.0:
        return np.asarray(source(coil, k) ** 2)
    sine, cosine = np.sin(np.radians(abs(tilt_deg))), np.cos(np.radians(tilt_deg))
    depth = 0.5 * coil.length_m * cosine + coil.outer_m * sine
    count = 16 + int(1.5 * k.max() * coil.outer_m * sine + k.max() * coil.length_m * sine)
    count += count % 2
    total = np.zeros(len(k))
    for phi in (np.arange(count // 2) + 0.5) * np.pi / count:
        q = k * (cosine + 1j * sine * np.cos(phi))
        amplitude = winding_integral(coil, q) * np.exp(-k * depth) * 2 * np.sinh(0.5 * q * coil.length_m) / q
        total += np.abs(amplitude) ** 2
    return 2 * total / count


def laplace_sum(k: Array, spectrum: ComplexArray, height_m: Array) -> ComplexArray:
    """Return sum over k of spectrum exp(-k height) for heights (...) [m], in bounded memory."""
    flat = height_m.ravel()
    result = np.empty(flat.shape, dtype=np.complex128)
    step = max(1, CHUNK // len(k))
    for start in range(0, flat.size, step):
        part = slice(start, start + step)
        result[part] = np.exp(-np.outer(flat[part], k)) @ spectrum
    return result.reshape(height_m.shape)
