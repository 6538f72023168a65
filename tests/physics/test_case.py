import copy
import json

import numpy as np
import pytest

from eddyscan.core.errors import FileError, TechniqueError
from eddyscan.physics.case import parse_case, read_case, solve_case
from eddyscan.physics.plots import case_figure, sweep_figure
from eddyscan.physics.sweep import sweep_case

CASE = {
    "coil": {"inner_radius_mm": 6.15, "outer_radius_mm": 12.4, "length_mm": 6.15, "turns": 3790},
    "drive": {"frequency_hz": 900},
    "conductor": {"conductivity_ms_m": 30.6, "thickness_mm": 12.22},
    "slot": {"length_mm": 12.6, "depth_mm": 5.0, "opening_mm": 0.28},
    "scan": {"lift_off_mm": 0.88, "x_mm": [0.0, 4.0, 9.0], "y_mm": [0.0]},
}


def changed(**tables):
    case = copy.deepcopy(CASE)
    for table, entries in tables.items():
        if entries is None:
            del case[table]
        else:
            case[table] = {**case.get(table, {}), **entries}
    return case


def test_the_answer_has_the_contracts_form():
    answer = solve_case(parse_case(CASE))
    assert answer["air"] == {"resistance_ohm": 0.0, "inductance_h": pytest.approx(0.22599, rel=1e-4)}
    assert answer["sound"]["resistance_ohm"] == pytest.approx(120.651, rel=5e-4)
    assert answer["sound"]["inductance_h"] == pytest.approx(178.656e-3, rel=5e-4)
    assert [set(row) for row in answer["slot"]] == [{"x_mm", "y_mm", "dr_ohm", "dl_h"}] * 3
    assert answer["slot"][2]["dr_ohm"] == pytest.approx(-1.81, abs=0.02)
    assert answer["slot"][2]["dl_h"] == pytest.approx(2290e-6, rel=0.01)
    assert json.loads(json.dumps(answer)) == answer


def test_what_lies_beyond_validation_is_told():
    assert solve_case(parse_case(CASE))["warnings"] == []
    (told,) = solve_case(parse_case(changed(drive={"frequency_hz": 20e3})))["warnings"]
    assert "opening_mm = 0.28 is 0.44 skin depths (0.643 mm); the model is validated up to 0.25" in told
    (told,) = solve_case(parse_case(changed(conductor={"thickness_mm": 5.2})))["warnings"]
    assert "depth_mm = 5 leaves 0.2 mm under the slot" in told


def test_a_sound_half_space_needs_no_slot_and_no_positions():
    answer = solve_case(parse_case(changed(slot=None, conductor={"thickness_mm": None}, scan={"lift_off_mm": 1.0})))
    assert answer["slot"] == []
    assert 0.1 < answer["sound"]["inductance_h"] < answer["air"]["inductance_h"]


def test_one_y_for_all_x_or_one_per_x():
    one = solve_case(parse_case(changed(scan={"y_mm": 3.0})))["slot"]
    many = solve_case(parse_case(changed(scan={"y_mm": [3.0, 3.0, 3.0]})))["slot"]
    assert one == many
    assert [row["y_mm"] for row in one] == [3.0] * 3


@pytest.mark.parametrize(
    ("tables", "text"),
    [
        ({"coil": {"inner_radius_mm": -1}}, r"coil\.inner_radius_mm = -1: .*greater than 0"),
        ({"coil": {"length_mm": 0}}, r"coil\.length_mm = 0: .*greater than 0"),
        ({"coil": {"inner_radius_mm": 20}}, r"inner_radius_mm = 20 must be below outer_radius_mm = 12\.4"),
        ({"coil": {"turns": "many"}}, r"coil\.turns = 'many': .*valid number"),
        ({"coil": {"windings": 3}}, r"coil\.windings is not a known key"),
        ({"coil": None}, r"coil is missing"),
        ({"drive": {"frequency_hz": 0}}, r"drive\.frequency_hz = 0: .*greater than 0"),
        ({"conductor": {"conductivity_ms_m": 3.06e7}}, r"conductivity_ms_m = 3\.06e\+07.*looks like S/m.*30\.6 MS/m"),
        ({"conductor": {"conductivity_ms_m": 0}}, r"conductor\.conductivity_ms_m = 0: .*greater than 0"),
        ({"slot": {"depth_mm": 13}}, r"slot\.depth_mm = 13 must be below conductor\.thickness_mm = 12\.22"),
        ({"slot": {"opening_mm": -0.1}}, r"slot\.opening_mm = -0\.1: .*greater than or equal to 0"),
        ({"slot": {"profile": "round"}}, r"slot\.profile = 'round': .*'rectangular' or 'semi-elliptic'"),
        ({"scan": {"lift_off_mm": -0.1}}, r"scan\.lift_off_mm = -0\.1: .*greater than or equal to 0"),
        ({"scan": {"y_mm": [0.0, 1.0]}}, r"y_mm has 2 values: needed is one for all x or one per x \(3\)"),
        ({"scan": {"x_mm": []}}, r"scan\.x_mm = \[\]: .*at least 1"),
        ({"scan": {"x_mm": [0.0, float("nan")]}}, r"scan\.x_mm\.1 = nan: .*finite"),
    ],
)
def test_bad_input_names_key_value_and_range(tables, text):
    with pytest.raises(TechniqueError, match=text):
        parse_case(changed(**tables), name="case.toml")


def test_a_slot_in_magnetic_metal_is_refused():
    with pytest.raises(TechniqueError, match=r"relative_permeability = 100 in layer 0"):
        solve_case(parse_case(changed(conductor={"relative_permeability": 100})))


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(FileError, match=r"cannot read the case file .*none\.toml"):
        read_case(tmp_path / "none.toml")
    broken = tmp_path / "broken.toml"
    broken.write_text("[coil\n", encoding="utf-8")
    with pytest.raises(FileError, match=r"broken\.toml is not valid TOML"):
        read_case(broken)


def test_frequency_sweep_holds_the_case_in_its_middle():
    rows = sweep_case(parse_case(CASE), "frequency")["sweep"]
    middle = rows[len(rows) // 2]
    assert middle["frequency_hz"] == pytest.approx(900)
    assert middle["resistance_ohm"] == pytest.approx(120.651, rel=5e-4)
    assert middle["slot_percent"] == pytest.approx(100 * 2289e-6 / 0.22599, rel=0.02)
    assert [row["frequency_hz"] for row in rows] == sorted(row["frequency_hz"] for row in rows)
    assert all(0 <= row["slot_angle_deg"] <= 90 for row in rows)


def test_lift_off_sweep_falls_towards_air():
    rows = sweep_case(parse_case(changed(scan={"x_mm": [9.0]})), "lift-off")["sweep"]
    assert rows[0]["lift_off_mm"] == 0.0
    for key in ("slot_percent", "lift_off_percent_per_100um"):
        values = [row[key] for row in rows]
        assert values == sorted(values, reverse=True)
    assert "slot_percent" not in sweep_case(parse_case(changed(slot=None)), "lift-off")["sweep"][0]


def test_an_unknown_sweep_names_the_choices():
    with pytest.raises(TechniqueError, match=r"sweep = 'tilt': must be one of frequency, lift-off"):
        sweep_case(parse_case(CASE), "tilt")


@pytest.mark.parametrize("slot", [CASE["slot"], None])
def test_pictures_hold_what_they_say(slot, tmp_path):
    case = parse_case(changed(slot=slot))
    figure = case_figure(case)
    plane, along = figure.axes[:2]
    assert plane.get_xlabel() == "R / X0"
    if slot is not None:
        drawn = along.lines[0].get_ydata()
        assert np.allclose(drawn, [row["dr_ohm"] for row in solve_case(case)["slot"]])
    figure.savefig(tmp_path / "case.png")
    assert (tmp_path / "case.png").stat().st_size > 10_000


def test_sweep_picture(tmp_path):
    for over in ("frequency", "lift-off"):
        figure = sweep_figure(sweep_case(parse_case(CASE), over))
        assert figure.axes[0].get_xlabel().startswith(over)
        figure.savefig(tmp_path / f"{over}.png")
