"""Settings files: strict keys, limits in words, commented text that reads back."""

import tomllib
from pathlib import Path

import pytest

from eddyscan.core.commented_toml import commented_toml
from eddyscan.core.errors import FileError, TechniqueError
from eddyscan.core.technique import Technique
from eddyscan.inspection import read_toml


def test_commented_technique_reads_back_as_itself() -> None:
    technique = Technique()
    assert Technique.model_validate(tomllib.loads(commented_toml(technique))) == technique


def test_comments_name_unit_and_limits() -> None:
    text = commented_toml(Technique())
    line = next(line for line in text.splitlines() if line.startswith("lift_off_mm"))
    assert "along the normal" in line
    assert "> 0, <= 10" in line


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[plan]\npitch = 5\n", r"unknown key plan.pitch = 5; remove it or check its spelling"),
        ("[plan]\npitch_mm = -1\n", r"plan.pitch_mm = -1: Input should be greater than 0"),
        ("[probe]\ninner_radius_mm = 2.0\n", r"inner_radius_mm 2.0 must be below outer_radius_mm 1.5"),
        ("[part]\nconductivity_ms_m = 19000000.0\n", r"part.conductivity_ms_m = 19000000.0"),
        ("[scan]\nlift_off_mm = nan\n", r"scan.lift_off_mm = nan"),
    ],
)
def test_a_bad_value_is_named_with_its_key(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "technique.toml"
    path.write_text(text)
    with pytest.raises(TechniqueError, match=words):
        read_toml(path, Technique)


def test_broken_toml_and_missing_files_are_named(tmp_path: Path) -> None:
    path = tmp_path / "technique.toml"
    with pytest.raises(FileError, match="is missing"):
        read_toml(path, Technique)
    path.write_bytes(b"[plan\n")
    with pytest.raises(FileError, match="no valid TOML"):
        read_toml(path, Technique)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError, match="no valid TOML"):
        read_toml(path, Technique)
