"""A thin surface-breaking slot (crack or notch) and where it lies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array
from eddyscan.physics import checks
from eddyscan.physics.coil import MM
from eddyscan.physics.conductor import Conductor, Layer, skin_depth_mm

Profile = Literal["rectangular", "semi-elliptic"]
OPENING_PER_SKIN_DEPTH = 0.25


@dataclass(frozen=True)
class Slot:
    """A slot in the plane y = 0 of its own frame: |x| <= length / 2, -depth <= z <= 0.

    Attributes
    ----------
    length_mm, depth_mm : at the surface and at the deepest point
    opening_mm : 0 for an ideally tight crack (no current crosses it)
    profile : "rectangular" or "semi-elliptic"

    Raises
    ------
    TechniqueError
        A dimension out of range, an unknown profile.
    """

    length_mm: float
    depth_mm: float
    opening_mm: float = 0.0
    profile: Profile = "rectangular"

    def __post_init__(self) -> None:
        checks.positive("length_mm", self.length_mm, unit="mm")
        checks.positive("depth_mm", self.depth_mm, unit="mm")
        widest = 0.5 * min(self.length_mm, self.depth_mm)
        if not 0 <= self.opening_mm <= widest:
            raise TechniqueError(
                f"opening_mm = {self.opening_mm:g}: must lie from 0 to {widest:g} mm, "
                "half the smaller of length and depth; a wider cut is no thin slot."
            )
        if self.profile not in get_args(Profile):
            raise TechniqueError(f"profile = {self.profile!r}: must be one of {', '.join(get_args(Profile))}.")

    @property
    def half_length_m(self) -> float:
        """Half the length [m]."""
        return 0.5 * self.length_mm * MM

    @property
    def depth_m(self) -> float:
        """Depth [m]."""
        return self.depth_mm * MM

    @property
    def opening_m(self) -> float:
        """Opening [m]."""
        return self.opening_mm * MM


def slotted_layer(conductor: Conductor, slot: Slot) -> tuple[float, Layer, tuple[Layer, ...]]:
    """Return (coating above [mm], the slotted layer, layers below it): the slot breaks the first metal layer.

    Raises
    ------
    TechniqueError
        No metal, a permeable slotted layer or coating, or a slot as deep as its layer.
    """
    coating_mm = 0.0
    for number, layer in enumerate(conductor.layers):
        if layer.relative_permeability != 1.0:
            raise TechniqueError(
                f"relative_permeability = {layer.relative_permeability:g} in layer {number}: "
                "slots are modelled for 1 only (non-magnetic metal). "
                "Leave out the slot, or use a non-magnetic conductor."
            )
        if layer.conductivity_ms_m > 0:
            if layer.thickness_mm is not None and slot.depth_mm >= layer.thickness_mm:
                raise TechniqueError(
                    f"depth_mm = {slot.depth_mm:g}: must be below the layer's thickness_mm = {layer.thickness_mm:g}; "
                    "through slots are not modelled."
                )
            return coating_mm, layer, conductor.layers[number + 1 :]
        coating_mm += layer.thickness_mm or 0.0
    raise TechniqueError("conductivity_ms_m is 0 in every layer: a slot needs a metal layer to break.")


def slot_warnings(slot: Slot, conductor: Conductor, frequency_hz: float) -> tuple[str, ...]:
    """Return what lies outside the validated range, in words, each with value and limit; empty when nothing does."""
    _, layer, _ = slotted_layer(conductor, slot)
    skin_mm = skin_depth_mm(layer.conductivity_ms_m, frequency_hz)
    found = []
    if slot.opening_mm > OPENING_PER_SKIN_DEPTH * skin_mm:
        found.append(
            f"opening_mm = {slot.opening_mm:g} is {slot.opening_mm / skin_mm:.2f} skin depths ({skin_mm:.3g} mm); "
            f"the model is validated up to {OPENING_PER_SKIN_DEPTH:g}. Its signal is plausible, not verified."
        )
    if layer.thickness_mm is not None and slot.depth_mm > 0.9 * layer.thickness_mm:
        left = layer.thickness_mm - slot.depth_mm
        found.append(
            f"depth_mm = {slot.depth_mm:g} leaves {left:.3g} mm under the slot, less than 10 % "
            f"of the layer ({layer.thickness_mm:g} mm); the solution there converges slowly."
        )
    return tuple(found)


def to_slot_frame(x_mm: Array, y_mm: Array, *, centre_mm: tuple[float, float], angle_deg: float) -> tuple[Array, Array]:
    """Return positions (N,), (N,) [mm] in the frame of a slot.

    The slot's middle is at `centre_mm`, its length runs at `angle_deg` from x
    towards y.
    """
    angle = np.radians(angle_deg)
    dx, dy = np.asarray(x_mm) - centre_mm[0], np.asarray(y_mm) - centre_mm[1]
    return dx * np.cos(angle) + dy * np.sin(angle), dy * np.cos(angle) - dx * np.sin(angle)
