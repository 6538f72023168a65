"""Every stroke is run once, whichever way, and links only get shorter."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from eddyscan.planning.order import _turned, links_mm, ordered
from eddyscan.planning.strokes import Stroke


def stroke(points, closed=False):
    points = np.asarray(points, dtype=float)
    up = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return Stroke(points, up, s, 0.0, closed)


def ring(centre, radius, n=8):
    angle = np.arange(n + 1) % n * 2 * np.pi / n
    return stroke(
        np.column_stack([centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle), 0 * angle]), True
    )


coordinates = st.floats(-100, 100, allow_nan=False).map(lambda v: round(v, 3))
strokes_strategy = st.lists(
    st.one_of(
        st.tuples(coordinates, coordinates, coordinates, coordinates).map(
            lambda c: stroke([[c[0], c[1], 0], [(c[0] + c[2]) / 2, (c[1] + c[3]) / 2, 1], [c[2], c[3], 0]])
        ),
        st.tuples(coordinates, coordinates).map(lambda c: ring(c, 5.0)),
    ),
    min_size=1,
    max_size=12,
)


def spots(strokes):
    return sorted(tuple(p) for s in strokes for p in (s.points[:-1] if s.closed else s.points).tolist())


@settings(max_examples=60, deadline=None)
@given(strokes_strategy)
def test_ordering_keeps_every_reading_and_never_lengthens_the_links(strokes):
    run = ordered(strokes)
    assert spots(run) == spots(strokes)
    assert links_mm(run) <= links_mm(_turned(strokes, None)) + 1e-9
    for one in run:
        assert one.s_mm[0] == 0
        assert (np.diff(one.s_mm) >= 0).all()
        if one.closed:
            np.testing.assert_array_equal(one.points[0], one.points[-1])


@settings(max_examples=25, deadline=None)
@given(strokes_strategy)
def test_ordering_what_is_ordered_changes_no_link(strokes):
    once = ordered(strokes)
    assert links_mm(ordered(once)) <= links_mm(once) + 1e-9


def test_strokes_beside_a_hole_are_run_one_side_after_the_other():
    # Each row is cut in two by a hole; to and fro across it costs 80 mm a row.
    rows = []
    for y in range(0, 50, 5):
        rows += [stroke([[0, y, 0], [20, y, 0]]), stroke([[100, y, 0], [120, y, 0]])]
    assert links_mm(_turned(rows, None)) > 780
    assert links_mm(ordered(rows)) <= 190  # 170 is the least there is


def test_sixty_scattered_strokes_beat_taking_the_nearest_first():
    rng = np.random.default_rng(5)
    from eddyscan.planning.order import _nearest_first

    strokes = [
        stroke([[x, y, 0], [x + a, y + b, 0]]) for x, y, a, b in rng.uniform(-1, 1, (60, 4)) * (150, 150, 20, 20)
    ]
    assert links_mm(ordered(strokes)) < 0.85 * links_mm(_nearest_first(strokes, None))
