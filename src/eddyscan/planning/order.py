"""In which order strokes are run, and which way."""

from __future__ import annotations

import numpy as np

from eddyscan.planning.strokes import Stroke


def boustrophedon(strokes: list[Stroke]) -> list[Stroke]:
    """Return strokes in the given order, each turned so that it begins near the end before it."""
    if not strokes:
        return []
    run = [strokes[0]]
    for stroke in strokes[1:]:
        at = run[-1].points[-1]
        if stroke.closed:
            run.append(_begun_near(stroke, at))
            continue
        ahead, back = np.linalg.norm(stroke.points[0] - at), np.linalg.norm(stroke.points[-1] - at)
        run.append(stroke.reversed() if back < ahead else stroke)
    return run


def _begun_near(stroke: Stroke, at: np.ndarray) -> Stroke:
    """Return a closed stroke that begins at its reading nearest to `at`."""
    k = int(np.argmin(np.linalg.norm(stroke.points[:-1] - at, axis=1)))
    if k == 0:
        return stroke
    points, normals = (np.concatenate([rows[k:-1], rows[: k + 1]]) for rows in (stroke.points, stroke.normals))
    return Stroke(points, normals, stroke.s_mm, stroke.level, closed=True)
