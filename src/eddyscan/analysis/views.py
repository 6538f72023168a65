"""How signals are looked at: balance, rotation, gain and filters, none of which changes what was read.

Every function takes raw ohms and gives new values; the record keeps the readings
unrotated for ever. Filters work in mm along the path, not in seconds, so that they
mean the same at every speed.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array, ComplexArray, IntArray

CUT_OFF_TO_SIGMA = float(np.sqrt(2 * np.log(2)) / (2 * np.pi))  # a Gaussian's response is a half there


def balanced(impedance_ohm: ComplexArray, null_ohm: complex) -> ComplexArray:
    """Return readings (M,) relative to the null point [ohm]."""
    return np.asarray(impedance_ohm - null_ohm)


def rotated(signal_ohm: ComplexArray, angle_deg: float, *, gain_db: float = 0.0) -> ComplexArray:
    """Return a signal (M,) turned counter-clockwise and amplified."""
    return np.asarray(signal_ohm * 10 ** (gain_db / 20) * np.exp(1j * np.radians(angle_deg)))


def lift_off_angle_deg(tangent_ohm_mm: ComplexArray) -> float:
    """Return the rotation [deg] that lays rising lift-off horizontally to the left, as analysts expect it."""
    mean = np.mean(tangent_ohm_mm / np.abs(tangent_ohm_mm))
    return float((180.0 - np.degrees(np.angle(mean)) + 180.0) % 360.0 - 180.0)


def low_pass(signal_ohm: ComplexArray, row: IntArray, position_mm: Array, *, cut_off_mm: float) -> ComplexArray:
    """Return the signal smoothed row by row: wavelength `cut_off_mm` is halved, shorter ones go.

    Raises
    ------
    TechniqueError
        When the cut-off is not positive or shorter than two readings.
    """
    if not cut_off_mm > 0:
        raise TechniqueError(f"filter cut-off {cut_off_mm:g} mm must be above 0.")
    out = np.array(signal_ohm, dtype=np.complex128)
    for number in np.unique(row):
        members = np.flatnonzero(row == number)
        if len(members) < 3:
            continue
        step = float(np.median(np.linalg.norm(np.diff(position_mm[members], axis=0), axis=1)))
        if cut_off_mm < 2 * step:
            raise TechniqueError(
                f"filter cut-off {cut_off_mm:g} mm is below two readings ({2 * step:.3g} mm) of row {int(number)}. "
                "Use a longer cut-off or a smaller plan.step_mm."
            )
        sigma = CUT_OFF_TO_SIGMA * cut_off_mm / step
        out[members] = gaussian_filter1d(out[members].real, sigma) + 1j * gaussian_filter1d(out[members].imag, sigma)
    return out


def high_pass(signal_ohm: ComplexArray, row: IntArray, position_mm: Array, *, cut_off_mm: float) -> ComplexArray:
    """Return the signal without wavelengths above `cut_off_mm`, row by row; errors of `low_pass`."""
    return np.asarray(signal_ohm - low_pass(signal_ohm, row, position_mm, cut_off_mm=cut_off_mm))


def without_drift(
    signal_ohm: ComplexArray, time_s: Array, *, before: tuple[float, complex], after: tuple[float, complex]
) -> ComplexArray:
    """Return the signal less the straight line between two readings of the same reference.

    Parameters
    ----------
    before, after : (time [s], reading [ohm]) of the same spot of the reference block

    Raises
    ------
    TechniqueError
        When the second reading is not later than the first.
    """
    if after[0] <= before[0]:
        raise TechniqueError(
            f"the reference reading after the scan (t = {after[0]:.1f} s) must be later than the one before "
            f"({before[0]:.1f} s)."
        )
    share = (time_s - before[0]) / (after[0] - before[0])
    return np.asarray(signal_ohm - share * (after[1] - before[1]))
