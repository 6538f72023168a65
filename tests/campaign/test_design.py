"""Cases are drawn from the seed alone; impossible ones are named before anything runs."""

from pathlib import Path

import numpy as np
import pytest

from eddyscan.campaign.design import case_seeds, draw_cases
from eddyscan.campaign.full_case import full_cases, full_names
from eddyscan.campaign.run import _cases
from eddyscan.campaign.settings import Campaign
from eddyscan.campaign.values import signal_names
from eddyscan.core.errors import TechniqueError
from eddyscan.inspection import read_toml


def campaign(tmp_path: Path, vary: str, head: str = "cases = 40") -> Campaign:
    path = tmp_path / "campaign.toml"
    path.write_text(f"[campaign]\n{head}\n[vary]\n{vary}\n")
    return read_toml(path, Campaign)


LENGTH = '"flaw.length_mm" = { uniform = [0.3, 2.0], log = true }\n'


def test_the_same_seed_gives_the_same_cases(tmp_path: Path) -> None:
    first, second = (_cases(campaign(tmp_path, LENGTH + "noise = 1e-4")) for _ in range(2))
    assert first == second
    other = _cases(campaign(tmp_path, LENGTH, "cases = 40\nseed = 2"))
    assert [case["flaw_length_mm"] for case in other] != [case["flaw_length_mm"] for case in first]


def test_a_latin_hypercube_fills_every_stratum(tmp_path: Path) -> None:
    values = draw_cases(campaign(tmp_path, "lift_off_mm = { uniform = [0.1, 0.5] }"), signal_names())["lift_off_mm"]
    strata = np.floor((np.sort(values) - 0.1) / 0.4 * 40).astype(int)
    np.testing.assert_array_equal(strata, np.arange(40))


def test_a_factorial_design_is_the_full_product(tmp_path: Path) -> None:
    vary = "pitch_mm = { list = [0.5, 1.0] }\nlift_off_mm = { uniform = [0.1, 0.3], steps = 3 }"
    columns = draw_cases(campaign(tmp_path, vary, 'design = "factorial"'), signal_names())
    pairs = {
        (round(float(p), 6), round(float(h), 6))
        for p, h in zip(columns["pitch_mm"], columns["lift_off_mm"], strict=True)
    }
    assert pairs == {(p, h) for p in (0.5, 1.0) for h in (0.1, 0.2, 0.3)}


def test_depth_can_follow_length(tmp_path: Path) -> None:
    vary = LENGTH + '"flaw.depth_mm" = { of = "flaw.length_mm", times = 0.25 }'
    columns = draw_cases(campaign(tmp_path, vary), signal_names())
    np.testing.assert_allclose(columns["flaw.depth_mm"], 0.25 * columns["flaw.length_mm"])


def test_normal_values_have_their_mean_and_spread(tmp_path: Path) -> None:
    vary = "lift_off_mm = { normal = [0.3, 0.02] }"
    values = draw_cases(campaign(tmp_path, vary, "cases = 2000"), signal_names())["lift_off_mm"]
    assert values.mean() == pytest.approx(0.3, abs=1e-3)
    assert values.std() == pytest.approx(0.02, rel=0.02)


def test_case_seeds_differ_and_fit_a_parquet_integer(tmp_path: Path) -> None:
    seeds = case_seeds(campaign(tmp_path, LENGTH), 5000)
    assert len(set(seeds)) == 5000
    assert min(seeds) >= 0
    assert max(seeds) < 2**63


@pytest.mark.parametrize(
    ("vary", "words"),
    [
        ('"flaw.lenght_mm" = 1.0', r"vary\.flaw\.lenght_mm: unknown parameter; known are coil_tolerance"),
        ("noise = { uniform = [0.2, 0.1] }", "the range 0.2 .. 0.1 is empty"),
        ("noise = { uniform = [0.0, 0.1], log = true }", "needs limits above 0"),
        ("lift_off_mm = { normal = [0.1, 0.0] }", "must be above 0"),
        ("pitch_mm = { list = [] }", "list"),
        ("lift_off_mm = { normal = [0.05, 0.1] }", r"case \d+ is impossible: lift_off_mm = -"),
        ('"flaw.depth_mm" = { of = "noise", times = 2 }', "does not vary by itself"),
    ],
)
def test_a_bad_campaign_is_named(tmp_path: Path, vary: str, words: str) -> None:
    with pytest.raises(TechniqueError, match=words):
        _cases(campaign(tmp_path, vary))


def test_a_full_campaign_varies_any_key_of_technique_and_world(tmp_path: Path) -> None:
    names = full_names()
    assert {"technique.plan.pitch_mm", "world.camera.depth_scale_error", "world.part"} <= names
    cases = full_cases({"technique.plan.pitch_mm": np.array([5.0, 4.0])}, [1, 2], 2)
    assert [case["technique.plan.pitch_mm"] for case in cases] == [5.0, 4.0]
    with pytest.raises(TechniqueError, match=r"case 0 is impossible: technique\.plan\.pitch_mm = -1\.0"):
        full_cases({"technique.plan.pitch_mm": np.array([-1.0])}, [1], 1)
