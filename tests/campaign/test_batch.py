"""A batch: one bad folder is named, the others are done; a step that moves a stage is not offered."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from eddyscan import pipeline
from eddyscan.campaign.batch import run_batch
from eddyscan.cli.app import app
from eddyscan.core.errors import InputError


@pytest.fixture
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Return three inspections; in the second the step fails."""
    made = [tmp_path / name for name in ("a", "b", "c")]

    def step(folder: Path, name: str, **_: object) -> None:
        if folder.name == "b":
            raise InputError("b has no record. Scan first.")
        folder.mkdir()
        (folder / name).touch()

    monkeypatch.setattr(pipeline, "single_step", step)
    return made


def test_a_failing_folder_leaves_the_others_unharmed(folders: list[Path]) -> None:
    rows = run_batch("analyse", folders)
    assert [row["ok"] for row in rows] == [True, False, True]
    assert rows[1]["error"] == "InputError: b has no record. Scan first."
    assert (folders[0] / "cscan").exists()
    assert (folders[2] / "cscan").exists()


def test_a_fault_nobody_foresaw_costs_its_folder_only(folders: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    def step(folder: Path, name: str, **_: object) -> None:
        if folder.name == "b":
            raise ZeroDivisionError("a fault of the program")

    monkeypatch.setattr(pipeline, "single_step", step)
    assert [row["error"] for row in run_batch("plan", folders)] == ["", "ZeroDivisionError: a fault of the program", ""]


def test_the_command_names_what_failed_and_exits_1(folders: list[Path]) -> None:
    result = CliRunner().invoke(app, ["batch", "analyse", *map(str, folders)])
    assert result.exit_code == 1
    assert "b has no record. Scan first." in result.output.replace("\n", " ")


def test_a_folder_that_is_no_inspection_is_named(tmp_path: Path) -> None:
    (row,) = run_batch("plan", [tmp_path / "nowhere"])
    assert not row["ok"]
    assert "nowhere" in row["error"]


def test_motion_is_not_offered(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"batch cannot do 'scan'; it does surface, plan, analyse, report, run"):
        run_batch("scan", [tmp_path])
    with pytest.raises(InputError, match="at least one inspection folder"):
        run_batch("plan", [])
