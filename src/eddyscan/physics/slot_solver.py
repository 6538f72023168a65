"""The change of a coil's impedance by a slot: one matrix inverse, any coil, position and lift-off.

With the coil's field b_i = integral of basis_i E_y and the sheet's own matrix A,
the sheet's dipoles are -A^-1 b and, by reciprocity,

    dZ = b^T A^-1 b / I^2 + sigma a integral of E_x^2 dS / I^2.

The second term is the metal missing from the current that runs along the slot
(zero when the coil stands on the slot's line). Two coils use b'^T A^-1 b.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import inv

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.physics import checks
from eddyscan.physics.coil import MM, Coil
from eddyscan.physics.conductor import Conductor
from eddyscan.physics.metal import SlottedMetal
from eddyscan.physics.slot import Slot, slotted_layer
from eddyscan.physics.slot_basis import SlotBasis
from eddyscan.physics.slot_ellipse import EllipseBasis
from eddyscan.physics.slot_field import CoilOnSlot, Drive
from eddyscan.physics.slot_rectangle import RectangleBasis

DEEPEST_SKIN_DEPTHS = 8.0
MOST_ALONG = 96
MOST_DEGREE = 40


class SlotSolver:
    """A slot in a conductor at one frequency, with its matrix inverted once.

    Parameters
    ----------
    slot : Slot
    conductor : Conductor
    frequency_hz : float
    detail_mm : float
        Shortest length over which a coil's field changes along the slot: the mean
        winding radius of the smallest coil to be used.
    functions : (int, int) or None
        Functions along and down the slot, for convergence checks; chosen when None.
        A semi-elliptic slot takes the larger as its degree.

    Raises
    ------
    TechniqueError
        A slot the model does not cover: see `slotted_layer`, or too long for `detail_mm`.
    """

    def __init__(
        self,
        slot: Slot,
        conductor: Conductor,
        frequency_hz: float,
        *,
        detail_mm: float,
        functions: tuple[int, int] | None = None,
    ) -> None:
        checks.positive("frequency_hz", frequency_hz, unit="Hz")
        checks.positive("detail_mm", detail_mm, unit="mm")
        coating_mm, layer, below = slotted_layer(conductor, slot)
        self.slot, self.conductor, self.frequency_hz = slot, conductor, frequency_hz
        self._coating_m = coating_mm * MM
        self.metal = SlottedMetal(layer, below, frequency_hz, slot.opening_m)
        self.basis = slot_basis(slot, self.metal, detail_mm * MM, functions)
        matrix = self.basis.matrix(self.metal)
        odd = self.basis.odd
        self._blocks = [(which, inv(matrix[np.ix_(which, which)])) for which in map(np.flatnonzero, (~odd, odd))]

    def coil(self, coil: Coil, *, reach_mm: float, lift_off_mm: Array, samples: int = 0) -> CoilOnSlot:
        """Prepare a coil for positions within `reach_mm` of every slot point and lift-offs (H,) [mm]."""
        checks.lift_offs(lift_off_mm)
        heights = lift_off_mm * MM + self._coating_m
        return CoilOnSlot(coil, self.metal, self.basis, reach_m=reach_mm * MM, lift_off_m=heights, samples=samples)

    def reaction_ohm(self, receiver: Drive, driver: Drive) -> ComplexArray:
        """Return b'^T A^-1 b plus the along-slot term (P, H) [ohm] of two drives at the same positions."""
        total = np.zeros(driver.across.shape[:2], dtype=np.complex128)
        for which, inverse in self._blocks:  # even and odd functions along the slot do not react
            one, other = (drive.across[..., which].reshape(-1, len(which)) for drive in (driver, receiver))
            total += np.einsum("ni,ni->n", one @ inverse, other).reshape(total.shape)
        if receiver.along.shape[2] and driver.along.shape[2]:
            total = total + np.einsum("phq,phq->ph", receiver.along, driver.along)
        return np.asarray(total)

    def change_ohm(self, coil: Coil, x_mm: ArrayLike, y_mm: ArrayLike, lift_off_mm: ArrayLike) -> ComplexArray:
        """Return dZ of one coil at positions x, y in the slot's frame, for each of several lift-offs.

        Parameters
        ----------
        coil : Coil
        x_mm, y_mm : (N,) float64 or scalars [mm, slot frame]
            Coil axis, x along the slot from its middle.
        lift_off_mm : (H,) float64 or scalar [mm]

        Returns
        -------
        change : (N, H), or (N,) for a scalar lift-off, complex128 [ohm]
        """
        return self.transfer_ohm(coil, coil, (0.0, 0.0), x_mm=x_mm, y_mm=y_mm, lift_off_mm=lift_off_mm)

    def transfer_ohm(
        self,
        driver: Coil,
        receiver: Coil,
        receiver_offset_mm: tuple[float, float],
        *,
        x_mm: ArrayLike,
        y_mm: ArrayLike,
        lift_off_mm: ArrayLike,
    ) -> ComplexArray:
        """Return the change of mutual impedance of two coils; the receiver stands at the driver's place plus an offset.

        Shapes as `change_ohm`; the offset is in the slot's frame [mm].
        """
        heights = np.atleast_1d(np.asarray(lift_off_mm, dtype=np.float64))
        x, y = np.broadcast_arrays(np.atleast_1d(np.asarray(x_mm, float)), np.asarray(y_mm, float))
        same = driver == receiver and receiver_offset_mm == (0.0, 0.0)
        far = np.hypot(np.abs(x).max() + 0.5 * self.slot.length_mm, np.abs(y).max()) + np.hypot(*receiver_offset_mm)
        prepare = partial(self.coil, reach_mm=float(far), lift_off_mm=heights)
        drive = prepare(driver)
        listen = drive if same else prepare(receiver, samples=drive.samples)
        if listen.samples > drive.samples:
            drive = prepare(driver, samples=listen.samples)
        result = np.empty((len(x), len(heights)), dtype=np.complex128)
        x2, y2 = (x + receiver_offset_mm[0]) * MM, (y + receiver_offset_mm[1]) * MM
        for part, one in drive.drives(x * MM, y * MM):
            other = one if same else _whole(listen, x2[part], y2[part])
            result[part] = self.reaction_ohm(other, one)
        return result[:, 0] if np.ndim(lift_off_mm) == 0 else result


def _whole(coil: CoilOnSlot, x_m: Array, y_m: Array) -> Drive:
    parts = [drive for _, drive in coil.drives(x_m, y_m)]
    return Drive(np.concatenate([p.across for p in parts]), np.concatenate([p.along for p in parts]))


def slot_basis(slot: Slot, metal: SlottedMetal, detail_m: float, functions: tuple[int, int] | None) -> SlotBasis:
    """Choose the functions: enough for the coil's detail along the slot and for the skin depth down it.

    A rectangular slot deeper than 8 skin depths is cut there: what lies below
    changes the signal by exp(-16) of itself.

    Raises
    ------
    TechniqueError
        The slot needs more functions along its length than the solver takes.
    """
    along = 17 + int(2.6 * slot.half_length_m / detail_m)
    if along > MOST_ALONG and functions is None:
        longest = (MOST_ALONG - 17) / 2.6 * 2 * detail_m / MM
        raise TechniqueError(
            f"length_mm = {slot.length_mm:g}: must be at most {longest:.3g} mm for a coil of mean radius "
            f"{detail_m / MM:g} mm. Cut the slot to the stretch the coil passes."
        )
    if slot.profile == "semi-elliptic":
        degree = max(functions) if functions else int(20 + 0.4 * (along - 17) + 0.5 * slot.depth_m / metal.skin_m)
        if degree > MOST_DEGREE:
            raise TechniqueError(
                f"depth_mm = {slot.depth_mm:g} is {slot.depth_m / metal.skin_m:.0f} skin depths and length_mm = "
                f"{slot.length_mm:g}: a semi-elliptic slot needs degree {degree}, at most {MOST_DEGREE} is solved. "
                "Use a lower frequency, a larger coil or profile = 'rectangular'."
            )
        return EllipseBasis(slot.half_length_m, slot.depth_m, degree)
    depth = min(slot.depth_m, DEEPEST_SKIN_DEPTHS * metal.skin_m)
    along, down = functions or (along, 13 + int(depth / metal.skin_m))
    return RectangleBasis(slot.half_length_m, depth, along, down)


def slot_change_ohm(
    slot: Slot,
    coil: Coil,
    conductor: Conductor,
    frequency_hz: float,
    *,
    x_mm: ArrayLike,
    y_mm: ArrayLike,
    lift_off_mm: ArrayLike,
) -> ComplexArray:
    """Return dZ (N,) or (N, H) [ohm] of one slot: `SlotSolver.change_ohm` in one call."""
    detail = 0.5 * (coil.inner_radius_mm + coil.outer_radius_mm)
    solver = SlotSolver(slot, conductor, frequency_hz, detail_mm=detail)
    return solver.change_ohm(coil, x_mm, y_mm, lift_off_mm)
