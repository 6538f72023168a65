"""The judge: what the world says about a surface, a path and indications, checked with known errors."""

import ast
from pathlib import Path

import numpy as np
import pytest

import eddyscan
from eddyscan.core.frames import apply, from_rotation_vector, invert, rotation_about_z, transform
from eddyscan.core.indication import Indication
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import named_part
from eddyscan.core.record import ScanRecord
from eddyscan.devices.clock import VirtualClock
from eddyscan.devices.sim.lcr import LcrSimulator
from eddyscan.devices.sim.truth import indication_truth, match_readings, path_truth, surface_truth
from eddyscan.devices.sim.world import CoilAtStage, VirtualCell
from eddyscan.devices.sim.world_facts import facts_of
from eddyscan.devices.sim.world_settings import WorldPlacement, WorldSettings

BARE = WorldSettings(part="block-a", flaws="none", seed=6)


def moved(mesh, T):
    return mesh.moved(T, "part")


class TestSurface:
    def test_the_exact_surface_has_no_error(self):
        truth = surface_truth(named_part("block-a").top_mesh(2.0), BARE)
        assert truth["own"]["max_mm"] < 1e-3
        assert truth["coverage"] == 1.0
        assert truth["turned"] is False

    def test_a_lift_shows_in_its_own_frame_and_vanishes_in_the_fit(self):
        mesh = moved(named_part("block-a").top_mesh(2.0), transform(None, (0.0, 0.0, 0.2)))
        truth = surface_truth(mesh, BARE)
        assert truth["own"]["mean_abs_mm"] == pytest.approx(0.2, abs=0.01)
        assert truth["fit"]["mean_abs_mm"] < 1e-3
        assert truth["shift_mm"][2] == pytest.approx(-0.2, abs=1e-3)

    def test_exchanged_ends_are_told_and_forgiven(self):
        turned = transform(rotation_about_z(180.0), (200.0, 100.0, 0.0))
        truth = surface_truth(moved(named_part("block-a").top_mesh(2.0), turned), BARE)
        assert truth["turned"] is True
        assert truth["own"]["max_mm"] < 1e-3

    def test_noise_is_measured_as_it_is(self):
        mesh = named_part("block-c").top_mesh(2.0)
        noise = 0.05 * np.random.default_rng(1).standard_normal((len(mesh.vertices), 1))
        noisy = SurfaceMesh(mesh.vertices + noise * mesh.normals, mesh.faces, mesh.normals)
        truth = surface_truth(noisy, BARE.model_copy(update={"part": "block-c"}))
        assert truth["fit"]["rmse_mm"] == pytest.approx(0.05, rel=0.05)

    def test_half_a_surface_covers_half(self):
        mesh = named_part("plate").top_mesh(2.0)
        keep = (mesh.vertices[mesh.faces][:, :, 0] < 100.0).all(axis=1)
        used, faces = np.unique(mesh.faces[keep], return_inverse=True)
        half = SurfaceMesh(mesh.vertices[used], faces.reshape(-1, 3), mesh.normals[used])
        assert surface_truth(half, BARE.model_copy(update={"part": "plate"}))["coverage"] == pytest.approx(
            0.5, abs=0.03
        )


@pytest.fixture(scope="module")
def short_scan():
    """Five readings of a virtual cell, 0.5 mm off by the operator's alignment, as a record and the world's log."""
    cell = VirtualCell(BARE, VirtualClock())
    part = named_part("block-a")
    T_believed = cell.rough_alignment()
    x = np.linspace(20, 180, 5)
    spots, normals = part.surface(x, np.full(5, 50.0)), part.normal(x, np.full(5, 50.0))
    places = apply(T_believed, spots + 0.5 * normals)
    now = [places[0]]
    meter = LcrSimulator(CoilAtStage(cell._probe, lambda: now[0], cell.clock), cell.clock)
    for line in ("FUNC:IMP:TYPE RX", "FREQ 5e5", "TRIG:SOUR BUS"):
        meter.answer(line)
    now[0] = places[0] + [0, 0, 15]
    meter.answer("*TRG")  # air, not in the record
    values = []
    for place in places:
        now[0] = place
        first, second, _ = meter.answer("*TRG").split(",")
        values.append(complex(float(first), float(second)))
    index = np.arange(5)
    record = ScanRecord(
        0 * index, index, index * 1.0, places, places, np.full(5, 5e5), np.array(values), 0 * index,
        {"T_stage_part": T_believed.tolist()},
    )  # fmt: skip
    return cell, record


class TestPath:
    def test_readings_are_found_again_by_what_the_wire_carried(self, short_scan):
        cell, record = short_scan
        assert match_readings(cell.truth_log(), record).tolist() == [1, 2, 3, 4, 5]

    def test_true_lift_off_differs_from_the_aim_by_the_alignment_error(self, short_scan):
        cell, record = short_scan
        facts = facts_of(BARE)
        at = apply(invert(facts.T_stage_part), record.stage_mm)
        expected = named_part("block-a").closest(at)[2]
        truth = path_truth(cell.truth_log(), record, lift_off_mm=0.5)
        assert truth["matched"] == 5
        assert truth["lift_off_mm"]["mean"] == pytest.approx(expected.mean(), abs=1e-4)
        assert truth["lift_off_error_mm"]["mean"] == pytest.approx(expected.mean() - 0.5, abs=1e-4)
        assert truth["stage_error_mm"]["x"]["p95_abs"] == 0.0

    def test_alignment_error_is_told_in_mm_and_deg(self, short_scan):
        cell, record = short_scan
        truth = path_truth(cell.truth_log(), record)
        T_error = invert(facts_of(BARE).T_stage_part) @ record.T_stage_part
        assert truth["alignment"]["shift_mm"] < 1.5
        assert truth["alignment"]["turn_deg"] == pytest.approx(
            np.degrees(np.arccos((np.trace(T_error[:3, :3]) - 1) / 2)), abs=1e-3
        )

    def test_a_foreign_record_matches_nothing(self, short_scan):
        cell, record = short_scan
        foreign = ScanRecord(**{**vars(record), "impedance_ohm": record.impedance_ohm + 1.0})
        assert path_truth(cell.truth_log(), foreign)["matched"] == 0

    def test_without_a_record_readings_over_the_part_count(self, short_scan):
        assert path_truth(short_scan[0].truth_log())["readings"] == 5


def call(number, centre):
    return Indication(number, tuple(float(c) for c in centre), 2.0, 0.0, 0.1, 0.0, 10.0)


class TestIndications:
    WORLD = WorldSettings(part="block-a", seed=6)

    def test_found_missed_and_false(self):
        flaws = facts_of(self.WORLD).flaws
        calls = [call(1, flaws[0].centre_mm + 0.5), call(2, flaws[2].centre_mm), call(3, (5.0, 5.0, 30.0))]
        truth = indication_truth(calls, self.WORLD)
        assert [entry["found"] for entry in truth["each"]] == [True, False, True, False]
        assert (truth["found"], truth["flaws"], truth["false_calls"]) == (2, 4, 1)

    def test_two_lobes_of_one_flaw_are_no_false_call(self):
        flaw = facts_of(self.WORLD).flaws[0]
        calls = [call(1, flaw.centre_mm + 1.5 * flaw.along), call(2, flaw.centre_mm - 1.5 * flaw.along)]
        truth = indication_truth(calls, self.WORLD)
        assert truth["false_calls"] == 0
        assert truth["each"][0]["indications"] == [1, 2]

    def test_indications_on_a_turned_surface_are_turned_back(self):
        turned = transform(rotation_about_z(180.0), (200.0, 100.0, 0.0))
        mesh = moved(named_part("block-a").top_mesh(2.0), turned)
        centre = apply(turned, facts_of(self.WORLD).flaws[1].centre_mm[None])[0]
        assert indication_truth([call(1, centre)], self.WORLD, mesh=mesh)["each"][1]["found"]


class TestOperator:
    def test_exact_alignment_is_the_true_pose(self):
        world = WorldSettings(part="plate", placement=WorldPlacement(alignment="exact"), seed=2)
        assert VirtualCell(world, VirtualClock()).rough_alignment() == pytest.approx(facts_of(world).T_stage_part)

    @pytest.mark.parametrize(("how", "most_mm", "most_deg"), [("corner", 0.7, 0.4), ("rough", 5.3, 3.3)])
    def test_alignment_error_stays_within_its_options_and_is_not_zero(self, how, most_mm, most_deg):
        for seed in range(12):
            world = WorldSettings(part="block-a", placement=WorldPlacement(alignment=how), seed=seed)
            error = invert(facts_of(world).T_stage_part) @ VirtualCell(world, VirtualClock()).rough_alignment()
            assert 0 < np.linalg.norm(error[:3, 3]) < most_mm
            assert 0 < np.degrees(np.arccos(np.clip((np.trace(error[:3, :3]) - 1) / 2, -1, 1))) < most_deg

    def test_the_operator_follows_the_picture_when_its_ends_are_exchanged(self):
        world = WorldSettings(part="block-a", placement=WorldPlacement(alignment="exact"), seed=2)
        turned = transform(rotation_about_z(180.0), (200.0, 100.0, 0.0))
        mesh = moved(named_part("block-a").top_mesh(2.0), turned)
        T = VirtualCell(world, VirtualClock()).rough_alignment(mesh)
        on_stage = apply(T, mesh.vertices)
        on_part = apply(invert(facts_of(world).T_stage_part), on_stage)
        assert np.abs(named_part("block-a").closest(on_part)[2]).max() < 1e-6


class TestHonesty:
    SOURCE = Path(eddyscan.__file__).parent

    def imports_of(self, file):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                yield node.module
            elif isinstance(node, ast.Import):
                yield from (alias.name for alias in node.names)

    def test_no_driver_and_no_step_of_the_line_knows_the_simulators(self):
        rooms = ("devices/drivers", "scanning", "surface", "planning", "analysis", "physics", "core", "formats")
        files = [file for room in rooms for file in (self.SOURCE / room).rglob("*.py")]
        assert len(files) > 20
        for file in files:
            assert not any(module.startswith("eddyscan.devices.sim") for module in self.imports_of(file)), file

    def test_images_carry_no_pose_and_identities_no_truth(self):
        cell = VirtualCell(BARE.model_copy(update={"mesh_edge_mm": 4.0}), VirtualClock())
        image = cell.camera().capture()
        assert image.T_world_camera is None
        assert set(vars(cell.camera().identity())) == {"kind", "model", "serial", "firmware", "verified", "settings"}
        assert cell.camera().identity().settings == ()

    def test_hidden_pose_differs_between_table_and_stage_and_between_seeds(self):
        poses = [facts_of(BARE.model_copy(update={"seed": seed})).T_stage_part for seed in range(4)]
        assert all(not np.allclose(a, b) for k, a in enumerate(poses) for b in poses[k + 1 :])


def test_best_fit_recovers_a_small_motion():
    from eddyscan.devices.sim.truth import best_fit

    part = named_part("blade")
    T = from_rotation_vector(np.array([0.002, -0.001, 0.003]), np.array([0.2, -0.3, 0.1]))
    T_fit = best_fit(part, apply(T, part.top_mesh(3.0).vertices))
    back = apply(T_fit @ T, part.top_mesh(3.0).vertices)
    assert np.percentile(np.abs(part.closest(back)[2]), 95) < 0.01


@pytest.mark.parametrize("name", ["block-a", "blade", "plate"])
def test_best_fit_does_not_slide_a_shape_along_itself(name):
    from eddyscan.devices.sim.truth import best_fit

    part = named_part(name)
    mesh = part.top_mesh(3.0)
    noise = 0.05 * np.random.default_rng(2).standard_normal((len(mesh.vertices), 1))
    T_fit = best_fit(part, mesh.vertices + noise * mesh.normals)
    moved_by = np.linalg.norm(apply(T_fit, mesh.vertices) - mesh.vertices, axis=1)
    assert moved_by.max() < 0.3
