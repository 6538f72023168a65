"""What the coil can be over: the part, or the reference block that is screwed to the stage."""

from __future__ import annotations

import numpy as np

from eddyscan.core.frames import Array, apply, transform
from eddyscan.core.parts import NominalPart
from eddyscan.devices.sim.flaws import Flaw, placed
from eddyscan.devices.sim.flaws_response import SlotSignals
from eddyscan.devices.sim.world_foot import FootFinder
from eddyscan.devices.sim.world_settings import WorldFlaw, WorldReference, WorldSettings
from eddyscan.physics import Coil, Conductor

BESIDE_MM = 4.0


class Body:
    """A piece of metal with its slots.

    Attributes
    ----------
    name : "part" or "reference"
    finder : FootFinder
    flaws : tuple of Flaw
    """

    def __init__(self, name: str, finder: FootFinder, flaws: tuple[Flaw, ...], metal: tuple[Coil, Conductor]) -> None:
        self.name, self.finder, self.flaws = name, finder, flaws
        self._metal = metal
        self._signals: dict[float, SlotSignals] = {}

    def prepare(self, frequency_hz: float) -> None:
        """Begin to build the slots' tables."""
        if self.flaws and frequency_hz not in self._signals:
            self._signals[frequency_hz] = SlotSignals(self.flaws, *self._metal, frequency_hz)

    def slots_ohm(self, spot_mm: Array, lift_off_mm: float, frequency_hz: float) -> complex:
        """Return what the slots change [ohm] at a spot (3,) [mm, body]."""
        if not self.flaws:
            return 0j
        self.prepare(frequency_hz)
        return self._signals[frequency_hz].change_ohm(spot_mm, lift_off_mm)


class ReferenceBlock(Body):
    """A flat block with notches across it; where it is, is known to a few hundredths of a millimetre.

    Its own frame: origin at the corner of its top, x along, z up.
    """

    def __init__(self, options: WorldReference, metal: tuple[Coil, Conductor], seed: int) -> None:
        length, width = options.size_mm
        top = NominalPart("reference", _flat, (0.0, length), (0.0, width))
        notches = [
            WorldFlaw(
                x_mm=(k + 1) * length / (len(options.notch_depths_mm) + 1),
                y_mm=width / 2,
                angle_deg=90.0,
                length_mm=options.notch_length_mm,
                depth_mm=depth,
                opening_mm=options.notch_opening_mm,
            )
            for k, depth in enumerate(options.notch_depths_mm)
        ]
        finder = FootFinder(top)
        super().__init__("reference", finder, tuple(placed(top, notch, finder) for notch in notches), metal)
        error = options.place_error_mm * np.clip(np.random.default_rng([seed, 11]).standard_normal(3), -2, 2)
        self.T_body_stage = transform(None, tuple(-(np.array(options.corner_mm) + error)))
        self._size = np.array([length, width])

    def below(self, stage_mm: Array) -> bool:
        """Return whether the coil at (3,) [mm, stage] is over the block or just beside it."""
        at = apply(self.T_body_stage, stage_mm[None, :3])[0, :2]
        return bool((at > -BESIDE_MM).all() and (at < self._size + BESIDE_MM).all())


def reference_block(settings: WorldSettings, metal: tuple[Coil, Conductor]) -> ReferenceBlock | None:
    """Return the cell's reference block, None when it has none."""
    return ReferenceBlock(settings.reference, metal, settings.seed) if settings.reference.present else None


def _flat(u: Array, v: Array) -> Array:
    return np.stack(np.broadcast_arrays(u, v, np.zeros_like(u)), axis=-1).astype(float)
