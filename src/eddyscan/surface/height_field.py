"""Fit one robust spline to the cells of all views."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eddyscan.core.frames import Array
from eddyscan.surface.cells import HeightCells
from eddyscan.surface.spline import GridFit, HeightSpline, SplineBasis, adaptive_weights

KNOT_MM = 2.5
ROUGH_KNOT_MM = 6.0
MAX_COEFFICIENTS = 9000
SCALE_FLOOR_MM = 0.05
TUKEY = 4.685
SMOOTHING = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)
SINGLE_VIEW_SMOOTHING = 100.0
ROUNDS = 6


@dataclass(frozen=True)
class HeightField:
    """The fitted surface over the grid of cells.

    Attributes
    ----------
    spline : HeightSpline
    smoothing : chosen penalty weight
    scale_mm : robust standard deviation of a cell's mean about the surface, along the normal
    weight : (K, nx, ny) final robust weights
    residual : (K, nx, ny) [mm] along the normal, NaN where unseen
    factor : banded Cholesky factor of the final normal matrix
    fit : GridFit
    """

    spline: HeightSpline
    smoothing: float
    scale_mm: float
    weight: Array
    residual: Array
    factor: Array
    fit: GridFit


def rough_height(cells: HeightCells, inside: NDArray[np.bool_], *, margin_mm: float) -> HeightSpline:
    """Fit a quick spline that reaches `margin_mm` beyond the cells, straight on."""
    fit = _grid_fit(cells, knot_mm=ROUGH_KNOT_MM, margin_mm=margin_mm)
    base = cells.weight * inside
    state = _State(cells, fit, base, _start(cells, base))
    for _ in range(5):
        state.step(1.0)
    return HeightSpline(state.coefficients, fit.basis_x, fit.basis_y)


def fit_height_field(cells: HeightCells, inside: NDArray[np.bool_]) -> HeightField:
    """Fit the cells inside the outline.

    Parameters
    ----------
    cells : HeightCells
    inside : (nx, ny) cells whose centre lies inside the outline
    """
    fit = _grid_fit(cells, knot_mm=KNOT_MM, margin_mm=0.0)
    base = cells.weight * inside
    start = _start(cells, base)
    state = _State(cells, fit, base, start)
    for _ in range(3):
        state.step(10.0)
    smoothing = SINGLE_VIEW_SMOOTHING
    if len(cells.height) > 1:
        state.step(_chosen_smoothing(state, SMOOTHING[::2]))
        for _ in range(2):
            fit.hold(adaptive_weights(state.coefficients))
            state.step(10.0)
        smoothing = _chosen_smoothing(state, SMOOTHING)
    factor = np.zeros(0)
    for _ in range(ROUNDS):
        factor = state.step(smoothing)
    spline = HeightSpline(state.coefficients, fit.basis_x, fit.basis_y)
    return HeightField(spline, smoothing, state.scale, state.robust, state.residual, factor, fit)


def _grid_fit(cells: HeightCells, *, knot_mm: float, margin_mm: float) -> GridFit:
    x, y = cells.centres()
    low, high = cells.low_mm - margin_mm, cells.low_mm + np.array(cells.shape) * cells.cell_mm + margin_mm
    span_x, span_y = (low[0], high[0]), (low[1], high[1])
    knot = max(knot_mm, np.sqrt((span_x[1] - span_x[0]) * (span_y[1] - span_y[0]) / MAX_COEFFICIENTS))
    return GridFit(
        x,
        y,
        SplineBasis(*span_x, max(3, round((span_x[1] - span_x[0]) / knot))),
        SplineBasis(*span_y, max(3, round((span_y[1] - span_y[0]) / knot))),
    )


def _start(cells: HeightCells, base: Array) -> Array:
    height = np.where(base > 0, cells.height, np.nan)
    seen = np.isfinite(height).any(axis=0)
    start = np.full(cells.shape, np.nan)
    start[seen] = np.nanmedian(height[:, seen], axis=0)
    return start


class _State:
    """What one round of reweighting hands to the next."""

    def __init__(self, cells: HeightCells, fit: GridFit, base: Array, start: Array) -> None:
        self.cells, self.fit, self.base = cells, fit, base
        self.dBx = fit.basis_x.matrix(cells.centres()[0], 1)
        self.dBy = fit.basis_y.matrix(cells.centres()[1], 1)
        self.height = np.where(base > 0, cells.height, 0.0)
        seen = np.isfinite(start)
        self.coefficients, _ = fit.solve(seen.astype(float), np.where(seen, start, 0.0), 10.0)
        self.scale = 1.0
        self.robust = base
        self.residual = np.zeros_like(base)
        self._reweigh()

    def _reweigh(self) -> None:
        c, fit, cells = self.coefficients, self.fit, self.cells
        model = fit.Bx @ c @ fit.By.T
        slope_x, slope_y = self.dBx @ c @ fit.By.T, fit.Bx @ c @ self.dBy.T
        tilt = 1.0 / np.sqrt(1 + slope_x**2 + slope_y**2)
        offset = np.nan_to_num(cells.offset)
        self.level = self.height - slope_x * offset[..., 0] - slope_y * offset[..., 1]
        residual = (self.level - model) * tilt
        used = self.base > 0
        self.scale = max(SCALE_FLOOR_MM, 1.4826 * float(np.median(np.abs(residual[used])))) if used.any() else 1.0
        tukey = np.clip(1 - (residual / (TUKEY * self.scale)) ** 2, 0, None) ** 2
        self.robust = self.base * tukey * tilt**2
        self.residual = np.where(used, residual, np.nan)

    def step(self, smoothing: float) -> Array:
        """Solve once and update the weights; returns the factor."""
        weight = self.robust.sum(axis=0)
        moment = (self.robust * self.level).sum(axis=0)
        height = np.divide(moment, weight, out=np.zeros_like(moment), where=weight > 0)
        self.coefficients, factor = self.fit.solve(weight, height, smoothing)
        self._reweigh()
        return factor


def _chosen_smoothing(state: _State, choices: tuple[float, ...]) -> float:
    """Return the penalty that predicts a left-out view best."""
    robust, level = state.robust, state.level
    total, moment = robust.sum(axis=0), (robust * level).sum(axis=0)
    losses = []
    for smoothing in choices:
        loss = count = 0.0
        for k in range(len(robust)):
            weight = np.maximum(total - robust[k], 0.0)
            height = np.divide(moment - robust[k] * level[k], weight, out=np.zeros_like(weight), where=weight > 1e-6)
            c, _ = state.fit.solve(np.where(weight > 1e-6, weight, 0.0), height, smoothing)
            both = (robust[k] > 0) & (weight > 1e-6)
            difference = (level[k] - state.fit.Bx @ c @ state.fit.By.T)[both]
            loss += float((robust[k][both] * difference**2).sum())
            count += float(robust[k][both].sum())
        losses.append(loss / max(count, 1e-9))
    return choices[int(np.argmin(losses))]
