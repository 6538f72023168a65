"""What a campaign says: the curve it was made from, the parameter that matters, and that it is a simulation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from eddyscan.campaign.results import result_rows, summarise
from eddyscan.campaign.run import run_campaign
from eddyscan.core.errors import FileError, InputError

THRESHOLD, B0, B1, SCATTER = 6.0, 3.0, 1.8, 0.3


def rows(count: int, seed: int = 5) -> list[dict[str, object]]:
    """Return rows whose log score is linear in log length with normal scatter; noise is varied and has no effect."""
    rng = np.random.default_rng(seed)
    length = np.exp(rng.uniform(np.log(0.2), np.log(1.2), count))
    score = np.exp(B0 + B1 * np.log(length) + SCATTER * rng.standard_normal(count))
    noise = rng.uniform(1e-5, 1e-4, count)
    fixed = {"field_mm": 40.0, "lift_off_mm": 0.2, "lift_off_sd_mm": 0.01, "pitch_mm": 0.5, "seconds": 0.1}
    return [
        {
            "case": k,
            "flaw_length_mm": float(length[k]),
            "noise": float(noise[k]),
            "score": float(score[k]),
            "threshold": THRESHOLD,
            "found": bool(score[k] >= THRESHOLD),
            "false_calls": int(k % 100 == 0),
            **fixed,
        }
        for k in range(count)
    ]


def test_both_curves_find_the_a90_of_the_law_the_rows_follow(tmp_path: Path) -> None:
    truth = float(np.exp((np.log(THRESHOLD) - B0 + norm.ppf(0.9) * SCATTER) / B1))
    summary = summarise(rows(600), tmp_path)
    for name in ("pod_signal", "pod_hit_miss"):
        assert summary[name]["a90_mm"] == pytest.approx(truth, rel=0.06)
        assert summary[name]["a90_mm"] < summary[name]["a90_95_mm"] < 1.15 * truth
        assert summary[name]["basis"].startswith("simulation")
    assert summary["label"].startswith("simulation")
    assert summary["assumed"]["pitch_mm"] == [0.5, 0.5]
    assert (tmp_path / "pod.png").stat().st_size > 1000


def test_what_matters_most_comes_first(tmp_path: Path) -> None:
    ranks = summarise(rows(300), tmp_path)["sensitivity"]
    assert [entry["parameter"] for entry in ranks] == ["flaw_length_mm", "noise"]
    assert ranks[0]["rank_correlation"] > 0.9
    assert abs(ranks[1]["rank_correlation"]) < 0.2


def test_false_calls_are_counted_per_area(tmp_path: Path) -> None:
    summary = summarise(rows(200), tmp_path)
    assert summary["false_calls"] == 2
    assert summary["false_calls_per_m2"] == pytest.approx(2 / (200 * 0.0016))


def test_too_few_rows_are_said_instead_of_a_curve(tmp_path: Path) -> None:
    summary = summarise(rows(6), tmp_path)
    assert "pod_signal" not in summary
    assert any("too few" in note for note in summary["pod_notes"])
    assert ["cases", "6"] in result_rows(summary)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[campaign]\ndesing = 'random'\n", "desing"),
        ("[campaign\n", "campaign.toml"),
        ("[campaign]\ncases = 0\n", "cases"),
        ("[campaign]\ncases = 4\n[vary]\n'flaw.opening_mm' = 0.4\n", r"case 0 is impossible: flaw\.opening_mm = 0\.4"),
        ("[campaign]\ncases = 40\n[vary]\nfrequency_hz = { uniform = [4e5, 6e5] }\n", "40 different pairs"),
    ],
)
def test_a_bad_file_is_one_message(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "campaign.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        run_campaign(path, tmp_path / "out")


def test_a_second_campaign_on_the_same_folder_is_refused(tmp_path: Path) -> None:
    from eddyscan.campaign.store import RowStore

    first, second = RowStore(tmp_path, {"name": "a"}), RowStore(tmp_path, {"name": "a"})
    with first.owned(), pytest.raises(FileError, match="another campaign is writing"), second.owned():
        pass
    with second.owned():
        pass
