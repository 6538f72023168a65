"""Plans on disk come back as they were; damaged files are named."""

import csv
import dataclasses
import json

import numpy as np
import pytest

from eddyscan.core.errors import FileError, InputError
from eddyscan.core.parts import named_part
from eddyscan.core.technique import Technique
from eddyscan.formats.plans import CSV_HEADER, export_plan, read_plan, write_plan
from eddyscan.planning import plan


@pytest.fixture(scope="module")
def small_plan():
    settings = {"plan": {"pitch_mm": 20.0, "step_mm": 10.0, "strategy": "adaptive"}}
    return plan(named_part("block-a").top_mesh(2.0), Technique.model_validate(settings), inputs={"mesh": "ab12"})


def test_json_gives_back_every_number(small_plan, tmp_path):
    again = read_plan(write_plan(small_plan, tmp_path / "plan.json"))
    for field in dataclasses.fields(small_plan):
        before, after = getattr(small_plan, field.name), getattr(again, field.name)
        if isinstance(before, np.ndarray):
            assert before.dtype == after.dtype
            np.testing.assert_array_equal(before, after)
        else:
            assert before == after


def test_csv_has_the_agreed_columns_in_visiting_order(small_plan, tmp_path):
    lines = list(csv.reader(write_plan(small_plan, tmp_path / "plan.csv").read_text().splitlines()))
    header = "row,point,s_mm,x_mm,y_mm,z_mm,nx,ny,nz,tilt_deg,lift_off_mm,speed_mm_s,kind"
    assert ",".join(lines[0]) == header == ",".join(CSV_HEADER)
    assert len(lines) == len(small_plan) + 1
    numbers = np.array([[float(v) for v in line[:-1]] for line in lines[1:]])
    np.testing.assert_allclose(numbers[:, 3:6], small_plan.surface_mm, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(numbers[:, 6:9], axis=1), 1.0, atol=1e-5)
    assert {line[-1] for line in lines[1:]} == {"scan", "link", "approach"}


def test_unusable_files_are_named(small_plan, tmp_path):
    with pytest.raises(FileError, match=r"none\.json does not exist"):
        read_plan(tmp_path / "none.json")
    (tmp_path / "other.json").write_text("{}")
    with pytest.raises(FileError, match=r"other\.json is not a scan plan"):
        read_plan(tmp_path / "other.json")
    whole = write_plan(small_plan, tmp_path / "plan.json").read_text()
    (tmp_path / "cut.json").write_text(whole[: len(whole) // 2])
    with pytest.raises(FileError, match=r"cut\.json is not a readable JSON file"):
        read_plan(tmp_path / "cut.json")
    data = json.loads(whole)
    del data["tilt_deg"]
    (tmp_path / "less.json").write_text(json.dumps(data))
    with pytest.raises(FileError, match=r"less\.json is damaged: 'tilt_deg'"):
        read_plan(tmp_path / "less.json")
    data = json.loads(whole) | {"version": 99}
    (tmp_path / "new.json").write_text(json.dumps(data))
    with pytest.raises(FileError, match=r"version 99, this eddyscan reads version 1"):
        read_plan(tmp_path / "new.json")


def test_an_unknown_format_names_those_there_are(small_plan, tmp_path):
    with pytest.raises(InputError, match=r"no plan format 'dxf'; known are json, csv, gcode"):
        export_plan(small_plan, "dxf", tmp_path / "plan.dxf")
    with pytest.raises(InputError, match=r"plan\.txt: a plan is written as \.json or \.csv"):
        write_plan(small_plan, tmp_path / "plan.txt")
