"""Where one view stands, how well that is known, and what the data left open."""

from __future__ import annotations

from dataclasses import dataclass

from eddyscan.core.errors import RegistrationError
from eddyscan.core.frames import Array, checked_transform


@dataclass(frozen=True)
class Registration:
    """Pose of one view in the target frame and its quality.

    Attributes
    ----------
    view : str
        Name of the view (file name).
    T_target_source : (4, 4)
        Takes points of the view (camera frame) to the target frame (part).
    inlier_rmse_mm : float
        Root mean square distance of matched points along the surface normal.
    fitness : float
        Share of this view's points that found a partner in another view.
    converged : bool
    weak_directions : tuple of str
        Directions the data left unconstrained, in words, for example
        "slides along y by +-6 mm".
    source : str
        "registered", "fiducial" or "given".
    """

    view: str
    T_target_source: Array
    inlier_rmse_mm: float
    fitness: float
    converged: bool
    weak_directions: tuple[str, ...] = ()
    source: str = "registered"

    def __post_init__(self) -> None:
        checked_transform(self.T_target_source, f"pose of {self.view}")

    def require(self, *, rmse_mm: float, fitness: float) -> Registration:
        """Return self when it is good enough to move by, or raise RegistrationError."""
        if not self.converged or self.inlier_rmse_mm > rmse_mm or self.fitness < fitness:
            raise RegistrationError(
                f"registration of {self.view} too poor to move by: inlier RMSE {self.inlier_rmse_mm:.3f} mm "
                f"(limit {rmse_mm:.3f}), overlap {100 * self.fitness:.0f} % (need {100 * fitness:.0f} %), "
                f"converged: {'yes' if self.converged else 'no'}. Take more views, or clear clutter from the table."
            )
        return self
