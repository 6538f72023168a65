"""Directions in which the data left a view free: named, and refused when a result would slide on silently."""

from __future__ import annotations

import numpy as np

from eddyscan.core.errors import RegistrationError
from eddyscan.core.frames import Array
from eddyscan.surface.part_frame import PartFrame
from eddyscan.surface.refine import LEVER_MM
from eddyscan.surface.register import Registered

WARN_MM = 0.25  # standard uncertainty of a view's place; beyond it the direction is named
REFUSE_MM = 1.0
NAMES = ("turns about x", "turns about y", "turns about z", "slides along x", "slides along y", "slides along z")


def weak_directions(information: Array | None, registered: Registered, part: PartFrame) -> dict[str, tuple[str, ...]]:
    """Return, per view that has some, its weakly held directions in words.

    The covariance of every view's pose relative to the reference view comes
    from the normal matrix of all evidence; the eigenvectors of large
    uncertainty are named by the part axis they follow most.
    """
    if information is None or len(information) < 12:
        return {}
    at = registered.reference
    free = np.ones(len(information), dtype=bool)
    free[6 * at : 6 * at + 6] = False
    covariance = np.linalg.inv(information[np.ix_(free, free)] + 1e-6 * np.eye(int(free.sum())))
    names = [r.view for r in registered.registrations if r.converged]
    names.pop(at)
    turn = np.kron(np.eye(2), part.T_part_world[:3, :3])
    found = {}
    for k, name in enumerate(names):
        block = covariance[6 * k : 6 * k + 6, 6 * k : 6 * k + 6]
        words = _in_words(turn @ block @ turn.T)
        if words:
            found[name] = words
    return found


def _in_words(covariance: Array) -> tuple[str, ...]:
    values, vectors = np.linalg.eigh(covariance)
    words = []
    for value, vector in sorted(zip(values, vectors.T, strict=True), key=lambda p: -p[0]):
        sigma = float(np.sqrt(max(value, 0.0)))
        if sigma < WARN_MM:
            break
        axis = int(np.argmax(np.abs(vector)))
        amount = f"{2 * sigma:.1f} mm" if axis > 2 else f"{np.degrees(2 * sigma / LEVER_MM):.2f} deg"
        words.append(f"{NAMES[axis]} by +-{amount}")
    return tuple(words)


def refuse_slides(weak: dict[str, tuple[str, ...]]) -> tuple[str, ...]:
    """Return warnings that name weak directions.

    Raises
    ------
    RegistrationError
        When a view may stand more than a few millimetres off: no residual would show it.
    """
    for view, words in weak.items():
        for word in words:
            if word.endswith("mm") and float(word.split("+-")[1].split()[0]) > 2 * 2 * REFUSE_MM:
                raise RegistrationError(
                    f"{view} {word} (limit +-{4 * REFUSE_MM:.0f} mm): the part looks the same there and nothing on the "
                    "table holds it. Put two or three small objects or a fiducial sheet beside the part, or give poses."
                )
    return tuple(f"{view} {', '.join(words)}: the data hold it no better" for view, words in weak.items())
