"""Plans for other systems, each read back and compared with the plan."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from eddyscan.core.errors import FileError
from eddyscan.core.parts import named_part
from eddyscan.core.technique import Technique
from eddyscan.formats import plan_gcode, plan_krl, plan_noether, plan_ros, plan_urscript
from eddyscan.formats.plans import export_plan
from eddyscan.planning import plan

OUTWARD = np.diag([1.0, -1.0, -1.0])


def made(machine: str):
    settings = {"plan": {"pitch_mm": 15.0, "step_mm": 10.0, "strategy": "adaptive", "machine": machine}}
    return plan(named_part("blade").top_mesh(2.0), Technique.model_validate(settings), allow_gaps=True)


@pytest.fixture(scope="module")
def upright():
    return made("xyz")


@pytest.fixture(scope="module")
def tilted():
    return made("pose")


def test_gcode_of_three_axes_gives_back_positions_and_feeds(upright, tmp_path):
    path = export_plan(upright, "gcode", tmp_path / "plan.nc")
    positions, angles, kinds = plan_gcode.read_positions(path)
    np.testing.assert_allclose(positions, upright.T_part_probe[:, :3, 3], atol=1e-4)
    assert np.abs(angles).max() == 0
    assert kinds.count("scan") == upright.n_scan
    text = path.read_text()
    assert "G94" in text
    assert "G93" not in text
    assert f"F{60 * upright.speed_mm_s[-1]:.1f}" in text


def test_gcode_with_rotary_axes_gives_the_time_of_each_block(tilted, tmp_path):
    path = export_plan(tilted, "gcode", tmp_path / "plan.nc")
    positions, angles, _ = plan_gcode.read_positions(path)
    np.testing.assert_allclose(plan_gcode.axis_of(angles), tilted.T_part_probe[:, :3, 2], atol=1e-5)
    lines = [line for line in path.read_text().splitlines() if line.startswith("G1")]
    feed = np.array([float(line.split("F")[1].split()[0]) for line in lines])[1:]
    length = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    minutes = length / tilted.speed_mm_s[1:] / 60
    moving = length > 0.1
    np.testing.assert_allclose(1 / feed[moving], minutes[moving], rtol=1e-3)
    assert path.read_text().splitlines()[3] == "G93"


@pytest.mark.parametrize("module", [plan_noether, plan_ros])
def test_pose_lists_hold_the_rows_in_metres_with_z_out_of_the_surface(module, tilted, tmp_path):
    name = module.__name__.rsplit("_", 1)[1]
    rows = module.read_poses(export_plan(tilted, name, tmp_path / "plan.out"))
    assert len(rows) == tilted.n_rows
    every = np.concatenate(rows)
    scan = tilted.is_scan
    np.testing.assert_allclose(every[:, :3] * 1000, tilted.T_part_probe[scan, :3, 3], atol=1e-5)
    matrix = Rotation.from_quat(every[:, 3:]).as_matrix()
    np.testing.assert_allclose(matrix @ OUTWARD, tilted.T_part_probe[scan, :3, :3], atol=1e-6)
    np.testing.assert_allclose(matrix[:, :, 2], tilted.normal[scan], atol=1e-6)


def test_urscript_gives_back_every_pose_and_blends_never_overlap(tilted, tmp_path):
    T, blend = plan_urscript.read_poses(export_plan(tilted, "urscript", tmp_path / "plan.script"))
    np.testing.assert_allclose(T, tilted.T_part_probe, atol=2e-4)
    step = np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1) / 1000
    assert (blend[:-1] + blend[1:] <= step + 1e-9).all()
    assert (blend > 0).sum() > 0


@pytest.mark.parametrize("machine", ["upright", "tilted"])
def test_krl_gives_back_every_pose(machine, request, tmp_path):
    result = request.getfixturevalue(machine)
    path = export_plan(result, "krl", tmp_path / "2 plan.src")
    np.testing.assert_allclose(plan_krl.read_poses(path), result.T_part_probe, atol=2e-4)
    assert "DEF P_2_plan( )" in path.read_text()


def test_krl_at_the_turn_where_two_angles_are_one():
    rng = np.random.default_rng(3)
    turn = Rotation.from_euler(
        "ZYX", np.column_stack([rng.uniform(-180, 180, 9), np.full(9, 90.0), np.zeros(9)]), degrees=True
    )
    angles = plan_krl._quiet_euler(turn.as_matrix())
    again = Rotation.from_euler("ZYX", angles, degrees=True).as_matrix()
    np.testing.assert_allclose(again, turn.as_matrix(), atol=1e-6)


@pytest.mark.parametrize(
    ("read", "text", "message"),
    [
        (plan_gcode.read_positions, "G1 X1 Y2\n", r"line 1: a motion needs X, Y, Z and F"),
        (plan_noether.read_poses, "- - - {x: 1}\n", r"line 1: not a pose"),
        (plan_ros.read_poses, "{}", r"no segments of poses"),
        (plan_urscript.read_poses, "end", r"no movel or movep"),
        (plan_krl.read_poses, "END", r"no LIN or SLIN"),
    ],
)
def test_damaged_exports_are_named(read, text, message, tmp_path):
    path = tmp_path / "broken.txt"
    path.write_text(text)
    with pytest.raises(FileError, match=message):
        read(path)
