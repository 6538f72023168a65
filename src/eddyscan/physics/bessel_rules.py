"""Quadrature for integrals of products of two Bessel functions times a slowly varying kernel, to infinity.

Products decay only as a power, and half of each product oscillates. Beyond the
first lobes J_m J_n = (J_m J_n + Y_m Y_n)/2 + (J_m J_n - Y_m Y_n)/2: the first half
is smooth (Nicholson's form), the second oscillates about zero. A smooth window
ends the oscillating half, so panels that double in width carry the smooth half
to infinity.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import jv, spherical_jn, spherical_yn, yv

from eddyscan.core.frames import Array, IntArray
from eddyscan.physics.quadrature import gauss_panels

Regular = Callable[[Array], Array]


@dataclass(frozen=True)
class ProductRule:
    """Nodes t (T,) of [0, inf) and weighted pair products (P, T): products @ kernel is the integral for every pair."""

    nodes: Array
    products: Array
    pairs: IntArray


def infinite_panels(*, smallest: float, largest: float, highest_order: int) -> tuple[Array, Array, float, float]:
    """Return nodes, weights (T,), and the window's begin and end, for oscillation of wave number 2.

    Panels double from `smallest` to 1, are 4 wide through the oscillation, and
    double again to `largest`; a last panel is mapped to infinity.
    """
    begin = max(24.0, 2.2 * highest_order)
    end = begin + 28.0
    low = min(smallest, 0.5)
    growing = 4.0 / 2.0 ** np.arange(int(np.ceil(np.log2(4.0 / low))), 0, -1)
    middle = np.arange(4.0, end + 4.0, 4.0)
    top = max(largest, 4 * middle[-1])
    wide = middle[-1] * 2.0 ** np.arange(1, 1 + int(np.ceil(np.log2(top / middle[-1]))))
    t, w = gauss_panels(np.concatenate([[0.0], growing, middle, wide]), 8)
    inverse, share = gauss_panels(np.array([0.0, 1.0]), 10)
    last = wide[-1]
    return np.concatenate([t, last / inverse]), np.concatenate([w, last * share / inverse**2]), begin, end


def window(t: Array, begin: float, end: float) -> Array:
    """Return 1 below `begin`, 0 above `end`, smooth to all orders between (T,)."""
    s = np.clip((t - begin) / (end - begin), 1e-9, 1 - 1e-9)
    with np.errstate(over="ignore"):
        return np.asarray(1.0 / (1.0 + np.exp(np.clip(1.0 / (1.0 - s) - 1.0 / s, -700, 700))))


def product_rule(
    orders: IntArray, *, smallest: float, largest: float, spherical: bool = False, same_parity: bool = True
) -> ProductRule:
    """Return the rule for products B_a(t)/t B_b(t)/t, B the (spherical) Bessel functions of the given orders (N,).

    `pairs` (P, 2) index `orders` with a <= b and, unless told otherwise, a - b even.
    """
    t, w, begin, end = infinite_panels(smallest=smallest, largest=largest, highest_order=int(orders.max()))
    first: Callable[..., Array] = spherical_jn if spherical else jv
    second: Callable[..., Array] = spherical_yn if spherical else yv
    far = t > begin
    regular = np.array([first(int(n), t) for n in orders])
    singular = np.zeros_like(regular)
    singular[:, far] = np.array([second(int(n), t[far]) for n in orders])
    a, b = np.triu_indices(len(orders))
    keep = (orders[a] - orders[b]) % 2 == 0 if same_parity else np.ones(len(a), dtype=bool)
    a, b = a[keep], b[keep]
    jj, yy = regular[a] * regular[b], singular[a] * singular[b]
    ended = window(t, begin, end)
    products = np.where(far, 0.5 * (jj + yy) + 0.5 * ended * (jj - yy), jj)
    return ProductRule(t, products * w / t**2, np.stack([a, b], axis=1))
