"""The inspection folder: atomic steps, hashes, locks, honest states."""

import json
from pathlib import Path

import pytest

from eddyscan.core.errors import FileError
from eddyscan.inspection import Inspection, read_json, sha256_of
from eddyscan.pipeline import new_inspection, states
from eddyscan.pipeline.states import inputs_of


@pytest.fixture
def inspection(tmp_path: Path) -> Inspection:
    return new_inspection(tmp_path / "case", part="plate", seed=3)


def put_view(inspection: Inspection, content: bytes = b"ply\n") -> Path:
    path = inspection.file("views", "view-0.ply")
    path.write_bytes(content)
    return path


def write_surface(inspection: Inspection) -> None:
    with inspection.writing("surface", inputs_of(inspection, "surface")) as folder:
        (folder / "surface.ply").write_text("mesh")


def state_of(inspection: Inspection, step: str) -> str:
    return next(s.state for s in states(inspection.folder) if s.name == step)


def test_a_new_folder_has_commented_settings_and_nothing_done(inspection: Inspection) -> None:
    assert inspection.technique().part.name == "plate"
    assert "# Rows and points on the surface." in inspection.technique_file.read_text()
    assert {s.state for s in states(inspection.folder)} == {"missing"}


def test_a_step_is_done_until_an_input_changes(inspection: Inspection) -> None:
    put_view(inspection)
    write_surface(inspection)
    assert state_of(inspection, "surface") == "done"
    put_view(inspection, b"ply other\n")
    stale = next(s for s in states(inspection.folder) if s.name == "surface")
    assert stale.state == "stale"
    assert "1-views/view-0.ply changed since" in stale.why


def test_a_technique_change_makes_only_the_steps_that_read_it_stale(inspection: Inspection) -> None:
    put_view(inspection)
    write_surface(inspection)
    text = inspection.technique_file.read_text()
    inspection.technique_file.write_text(text.replace("pitch_mm = 5.0", "pitch_mm = 2.0"))
    assert state_of(inspection, "surface") == "done"
    inspection.technique_file.write_text(text.replace("grid_mm = 1.0", "grid_mm = 2.0"))
    assert state_of(inspection, "surface") == "stale"


def test_a_step_that_fails_leaves_the_old_result(inspection: Inspection) -> None:
    put_view(inspection)
    write_surface(inspection)
    before = sha256_of(inspection.file("surface", "surface.ply"))

    def fail_half_way() -> None:
        with inspection.writing("surface", {}) as folder:
            (folder / "surface.ply").write_text("half")
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        fail_half_way()
    assert sha256_of(inspection.file("surface", "surface.ply")) == before
    assert not list(inspection.folder.glob(".2-surface-*"))


def test_raw_data_is_set_aside_never_deleted(inspection: Inspection) -> None:
    folder = inspection.step_folder("record")
    for number in (1, 2):
        folder.mkdir()
        (folder / "record.sqlite").write_text(f"scan {number}")
        kept = inspection.set_aside("record")
        assert kept.name == f"4-record.kept-{number}"
        assert (kept / "record.sqlite").read_text() == f"scan {number}"


def test_two_programs_cannot_write_at_once(inspection: Inspection) -> None:
    with (
        inspection.locked(),
        pytest.raises(FileError, match="in use by another"),
        Inspection(inspection.folder).locked(),
    ):
        pass


def test_log_lines_are_json(inspection: Inspection) -> None:
    lines = (inspection.folder / "log.jsonl").read_text().splitlines()
    assert json.loads(lines[0])["event"] == "new"


def test_a_second_new_and_a_stranger_folder_are_refused(inspection: Inspection, tmp_path: Path) -> None:
    with pytest.raises(FileError, match="already holds an inspection"):
        new_inspection(inspection.folder)
    with pytest.raises(FileError, match="no inspection folder"):
        Inspection.open(tmp_path / "nowhere")
    with pytest.raises(FileError, match=r"holds no technique\.toml"):
        Inspection.open(tmp_path)


def test_a_broken_note_is_named(inspection: Inspection) -> None:
    path = inspection.folder / "note.json"
    path.write_text("{")
    with pytest.raises(FileError, match="no valid JSON"):
        read_json(path)
