"""The whole line in the virtual cell: views in, report out; killed and resumed; pulled apart."""

import json
import os
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest

from eddyscan import pipeline
from eddyscan.core.errors import InputError, TravelError
from eddyscan.inspection import Inspection, sha256_of

COARSE = {"pitch_mm = 5.0": "pitch_mm = 20.0", "step_mm = 5.0": "step_mm = 10.0"}


def coarse_inspection(folder: Path, part: str = "plate") -> Inspection:
    inspection = pipeline.new_inspection(folder, part=part, seed=5)
    change(inspection.technique_file, COARSE)
    return inspection


def change(path: Path, replacements: dict[str, str]) -> None:
    text = path.read_text()
    for old, new in replacements.items():
        assert old in text, f"{old} is not in {path}"
        text = text.replace(old, new)
    path.write_text(text)


def count_readings(folder: Path) -> int:
    path = folder / "4-record" / "record.sqlite"
    if not path.is_file():
        return 0
    try:
        with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as db:
            return int(db.execute("SELECT count(*) FROM readings").fetchone()[0])
    except sqlite3.OperationalError:
        return 0


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("line") / "planned"
    coarse_inspection(folder, "block-a")
    for step in ("views", "surface", "plan"):
        pipeline.single_step(folder, step)
    return folder


@pytest.fixture(scope="module")
def inspected(planned: Path) -> Path:
    folder = planned.with_name("inspected")
    shutil.copytree(planned, folder)
    pipeline.run(folder)
    return folder


@pytest.fixture
def fresh(planned: Path, tmp_path: Path) -> Path:
    """A folder with views, surface and plan, ready to scan."""
    folder = tmp_path / "fresh"
    shutil.copytree(planned, folder)
    return folder


def test_every_step_is_done_and_the_summary_says_so(inspected: Path) -> None:
    summary = json.loads((inspected / "summary.json").read_text())
    assert set(summary["steps"].values()) == {"done"}
    assert summary["coverage"] > 0.9
    assert 2 * summary["plan"]["points"] == count_readings(inspected)  # a coarse and a corrected pass
    assert summary["truth"]["surface"]["own"]["mean_abs_mm"] < 0.5
    assert summary["truth"]["path"]["readings"] == summary["plan"]["points"]
    assert set(summary["seconds"]) >= {"views", "surface", "plan", "record", "cscan", "report"}


def test_the_corrected_pass_runs_at_the_techniques_lift_off(inspected: Path) -> None:
    error = json.loads((inspected / "summary.json").read_text())["truth"]["path"]["lift_off_error_mm"]
    assert abs(error["mean"]) < 0.05
    assert error["sd"] < 0.03


def test_the_report_stands_alone(inspected: Path) -> None:
    text = (inspected / "6-report" / "report.html").read_text()
    assert "block-a" in text
    assert not re.search(r"<(script|img|link|iframe|source)[^>]+(src|href)=.?https?:", text)


def test_a_second_run_does_nothing_again(inspected: Path) -> None:
    before = {path: sha256_of(path) for path in inspected.rglob("step.json")}
    pipeline.run(inspected)
    assert {path: sha256_of(path) for path in inspected.rglob("step.json")} == before


def test_the_steps_never_see_the_truth(inspected: Path) -> None:
    for name in ("2-surface", "3-plan", "5-cscan"):
        for path in (inspected / name).glob("*.json"):
            assert "truth" not in path.read_text()


def test_csv_of_the_record_follows_the_contract(inspected: Path, tmp_path: Path) -> None:
    pipeline.export(inspected, "csv", tmp_path / "record.csv")
    lines = (tmp_path / "record.csv").read_text().splitlines()
    assert lines[0] == (
        "reading,row,point,time_s,x_mm,y_mm,z_mm,x_stage_mm,y_stage_mm,z_stage_mm,"
        "frequency_hz,resistance_ohm,reactance_ohm,lift_off_mm,flag"
    )
    assert 2 * (len(lines) - 1) == count_readings(inspected)  # the corrected pass is the record


def test_a_killed_scan_goes_on_without_loss_or_doubles(fresh: Path) -> None:
    folder = fresh
    process = subprocess.Popen(
        [sys.executable, "-m", "eddyscan", "run", str(folder)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    deadline = time.monotonic() + 90
    while count_readings(folder) < 10 and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    kept = count_readings(folder)
    assert kept >= 10
    summary = pipeline.run(folder)
    assert summary["plan"]["points"] > kept
    with closing(sqlite3.connect(folder / "4-record" / "record.sqlite")) as db:
        total, distinct = db.execute(
            "SELECT count(*), count(DISTINCT (pass * 1000 + row) * 100000 + point) FROM readings"
        ).fetchone()
    assert total == distinct == 2 * summary["plan"]["points"]


def test_a_dry_run_moves_nothing(fresh: Path) -> None:
    pipeline.run(fresh, dry_run=True)
    assert not (fresh / "4-record").exists()


def test_a_real_rig_needs_arm(tmp_path: Path) -> None:
    folder = tmp_path / "real"
    inspection = coarse_inspection(folder)
    text = inspection.rig_file.read_text()
    inspection.rig_file.write_text(text[: text.index("[world]")])
    with pytest.raises(InputError, match="--arm"):
        pipeline.run(folder)


def test_a_plan_outside_the_travel_moves_nothing(fresh: Path) -> None:
    folder = fresh
    alignment = folder / "4-record" / "alignment.json"
    alignment.parent.mkdir()
    alignment.write_text(
        json.dumps({"T_stage_part": [[1, 0, 0, 150], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], "how": "test"})
    )
    with pytest.raises(TravelError, match="x"):
        pipeline.single_step(folder, "record")
    assert count_readings(folder) == 0
