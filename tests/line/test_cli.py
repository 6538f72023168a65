"""The commands: exit codes, one clear message, one JSON object, light start."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from eddyscan.cli import app as program
from eddyscan.core.parts import PARTS
from eddyscan.formats.meshes import write_mesh


class Ended:
    def __init__(self, code: int, out: str, err: str) -> None:
        self.code, self.out = code, out
        self.err = " ".join(err.split())

    @property
    def json(self) -> dict:
        return json.loads(self.out)


@pytest.fixture
def eddyscan(capsys: pytest.CaptureFixture[str]):
    def call(*arguments: object) -> Ended:
        with pytest.raises(SystemExit) as end:
            program.main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return Ended(int(end.value.code or 0), captured.out, captured.err)

    return call


@pytest.fixture(scope="session")
def plate_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mesh") / "plate.ply"
    write_mesh(PARTS["plate"].top_mesh(2.0), path)
    return path


def test_help_loads_no_heavy_library() -> None:
    code = (
        "import sys\nfrom eddyscan.cli import app\n"
        "heavy = {'numpy', 'scipy', 'open3d', 'pydantic', 'plotly', 'matplotlib', 'cv2'} & set(sys.modules)\n"
        "sys.exit(str(heavy) if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_unknown_words_exit_2(eddyscan) -> None:
    assert eddyscan("surfaces").code == 2
    assert eddyscan("plan").code == 2
    assert eddyscan("demo", "--part", "block-z").code == 2


def test_version(eddyscan) -> None:
    assert eddyscan("--version").out.startswith("eddyscan ")


def test_compare_of_an_exact_mesh_with_its_part(eddyscan, plate_file: Path) -> None:
    ended = eddyscan("compare", plate_file, "--to", "plate", "--json")
    assert ended.code == 0
    assert ended.json["mean_abs_mm"] == pytest.approx(0.0, abs=1e-6)
    assert ended.json["aligned"] is False
    assert ended.json["fit"]["aligned"] is True
    assert {"rmse_mm", "p95_mm", "max_mm", "coverage"} <= ended.json.keys()


def test_compare_names_an_unknown_nominal(eddyscan, plate_file: Path) -> None:
    ended = eddyscan("compare", plate_file, "--to", "block-q")
    assert ended.code == 2
    assert "known are block-a" in ended.err


def test_plan_csv_follows_the_contract(eddyscan, plate_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "plan.csv"
    ended = eddyscan("plan", plate_file, "--pitch-mm", 20, "--step-mm", 10, "--margin-mm", 5, "--out", out, "--json")
    assert ended.code == 0, ended.err
    lines = out.read_text().splitlines()
    assert lines[0] == "row,point,s_mm,x_mm,y_mm,z_mm,nx,ny,nz,tilt_deg,lift_off_mm,speed_mm_s,kind"
    kinds = {line.rsplit(",", 1)[1] for line in lines[1:]}
    assert kinds <= {"scan", "link", "approach"}
    scan = np.array([line.split(",")[3:9] for line in lines[1:] if line.endswith(",scan")], dtype=float)
    np.testing.assert_allclose(scan[:, 2], 30.0, atol=1e-3)
    np.testing.assert_allclose(scan[:, 3:], [[0, 0, 1]] * len(scan), atol=1e-3)
    assert len(scan) == ended.json["points"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--pitch-mm", "0", "--step-mm", "5"], "plan.pitch_mm = 0"),
        (["--pitch-mm", "5", "--step-mm", "-1"], "plan.step_mm = -1"),
        (["--pitch-mm", "5", "--step-mm", "5", "--machine", "hexapod"], "plan.machine = 'hexapod'"),
    ],
)
def test_plan_names_a_bad_option(eddyscan, plate_file: Path, tmp_path: Path, options: list[str], words: str) -> None:
    ended = eddyscan("plan", plate_file, *options, "--out", tmp_path / "plan.csv")
    assert ended.code == 2
    assert words in ended.err
    assert not (tmp_path / "plan.csv").exists()


def test_plan_refuses_an_ending_it_cannot_write(eddyscan, plate_file: Path, tmp_path: Path) -> None:
    ended = eddyscan("plan", plate_file, "--out", tmp_path / "plan.docx")
    assert ended.code == 2
    assert ".csv or .json" in ended.err


@pytest.mark.parametrize("content", [b"", b"ply\nformat binary", b"not a mesh at all"])
def test_a_broken_mesh_file_exits_2_without_traceback(eddyscan, tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "broken.ply"
    path.write_bytes(content)
    ended = eddyscan("plan", path, "--out", tmp_path / "plan.csv")
    assert ended.code == 2
    assert "broken.ply" in ended.err
    assert "Traceback" not in ended.err


def test_one_view_is_refused(eddyscan, tmp_path: Path, plate_file: Path) -> None:
    ended = eddyscan("surface", plate_file, "--out", tmp_path / "out")
    assert ended.code == 2
    assert "--single-view" in ended.err or "single" in ended.err


def test_missing_views_are_named(eddyscan, tmp_path: Path) -> None:
    ended = eddyscan("surface", tmp_path / "a.ply", tmp_path / "b.ply", "--out", tmp_path / "out")
    assert ended.code == 2
    assert "a.ply" in ended.err


def test_steps_out_of_order_say_what_to_run(eddyscan, tmp_path: Path) -> None:
    folder = tmp_path / "case"
    assert eddyscan("new", folder, "--part", "plate").code == 0
    for step in ("scan", "analyse", "report"):
        ended = eddyscan(step, folder)
        assert ended.code == 2
        assert "eddyscan run" in ended.err


def test_signal_gives_air_and_sound(eddyscan, tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    case.write_text(
        "[coil]\ninner_radius_mm = 6.15\nouter_radius_mm = 12.4\nlength_mm = 6.15\nturns = 3790\n"
        "[drive]\nfrequency_hz = 900\n[conductor]\nconductivity_ms_m = 30.6\nthickness_mm = 12.22\n"
        "[scan]\nlift_off_mm = 0.88\nx_mm = [0.0]\ny_mm = [0.0]\n"
    )
    ended = eddyscan("signal", case, "--json")
    assert ended.code == 0, ended.err
    # an independent finite-element solution of this benchmark coil: 178.63 mH, 120.67 ohm
    assert ended.json["sound"]["inductance_h"] == pytest.approx(0.17863, rel=5e-4)
    assert ended.json["sound"]["resistance_ohm"] == pytest.approx(120.67, rel=5e-4)
    assert ended.json["air"]["resistance_ohm"] == 0


def test_an_unknown_simulator_is_named(eddyscan) -> None:
    ended = eddyscan("simulate", "toaster", "--port", 0)
    assert ended.code == 2
    assert "zaber, lcr, grbl" in ended.err
