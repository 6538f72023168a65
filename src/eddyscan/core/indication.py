"""What the software calls: an indication, for a person to classify."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Indication:
    """One connected signal above the call level.

    Attributes
    ----------
    number : int, from 1
    centre_mm : (3,) [mm, part]
    extent_mm : largest length of the connected area
    angle_deg : direction of the extent against the row direction, in the surface
    amplitude_ohm, phase_deg : largest residual and its phase, unrotated
    snr : amplitude over the robust noise of the residual
    length_mm, length_uncertainty_mm : estimated crack length, None if not sized
    depth_mm, depth_uncertainty_mm : estimated crack depth, None if not sized
    classification : as the technique defines; "unclassified" until a person decides
    """

    number: int
    centre_mm: tuple[float, float, float]
    extent_mm: float
    angle_deg: float
    amplitude_ohm: float
    phase_deg: float
    snr: float
    length_mm: float | None = None
    length_uncertainty_mm: float | None = None
    depth_mm: float | None = None
    depth_uncertainty_mm: float | None = None
    classification: str = "unclassified"
