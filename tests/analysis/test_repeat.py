import numpy as np
import pytest

from eddyscan.analysis import AnalysisResult
from eddyscan.analysis.repeat import compare_scans
from eddyscan.core.cscan import CScan
from eddyscan.core.errors import InputError
from eddyscan.core.frames import apply, from_rotation_vector, invert
from eddyscan.core.indication import Indication
from eddyscan.core.parts import named_part


def result(places, *, T=None, seed=0, covered=None, part="block-a", noise=0.01):
    mesh = named_part(part).top_mesh(2.0)
    rng = np.random.default_rng(seed)
    T = np.eye(4) if T is None else T
    at = apply(T, np.array(places, dtype=float).reshape(-1, 3))
    channel = noise * rng.standard_normal(len(mesh.vertices))
    for place in places:
        channel[np.linalg.norm(mesh.vertices - np.array(place), axis=1) < 3] += 1.0
    mask = np.ones(len(mesh.vertices), dtype=bool) if covered is None else covered(mesh.vertices)
    found = tuple(Indication(k + 1, tuple(p), 3.0, 0.0, 1.0, 12.0, 20.0) for k, p in enumerate(at))
    return AnalysisResult(
        CScan(mesh.moved(T, "part"), mask, {"score": channel}), found, np.zeros(1), np.zeros(1, complex)
    )


OLD = [(40.0, 30.0, 37.0), (120.0, 60.0, 23.0)]
NEW = (160.0, 20.0, 34.0)


def test_what_changed_stands_on_the_surface():
    T_b_a = from_rotation_vector(np.radians([0.1, -0.1, 0.2]), np.array([0.3, -0.4, 0.1]))
    found = compare_scans(result(OLD), result([*OLD, NEW], T=T_b_a, seed=1))
    assert found.matched == ((1, 1), (2, 2))
    assert [i.number for i in found.appeared] == [3]
    assert found.gone == ()
    error = apply(found.T_a_b, apply(T_b_a, np.array(OLD))) - np.array(OLD)
    assert np.abs(error).max() < 0.2
    assert np.abs(found.T_a_b[:3, 3] - invert(T_b_a)[:3, 3]).max() < 1.0
    mesh = named_part("block-a").top_mesh(2.0)
    changed = np.abs(found.change["score"]) > 0.5
    assert changed.any()
    assert np.linalg.norm(mesh.vertices[changed] - NEW, axis=1).max() < 6.0
    assert found.noise["score"] == pytest.approx(0.014, rel=0.2)


def test_gone_is_told():
    found = compare_scans(result([*OLD, NEW]), result(OLD, seed=1))
    assert [i.number for i in found.gone] == [3]
    assert found.appeared == ()


def test_parts_that_share_nothing_are_refused():
    left, right = (lambda v: v[:, 0] < 60), (lambda v: v[:, 0] > 140)
    with pytest.raises(InputError, match=r"share 0 % of the covered surface \(at least 30 %"):
        compare_scans(result(OLD, covered=left), result(OLD, covered=right))
