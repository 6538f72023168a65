"""What the coil feels at its true place, against the physics room's own formulas."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import apply
from eddyscan.core.parts import PARTS, named_part
from eddyscan.devices.sim.flaws import Flaw, default_flaws, placed
from eddyscan.devices.sim.instrument_physics import CoilResponse, edge_zone_mm, real_coil
from eddyscan.devices.sim.instrument_physics_noise import ReadingNoise
from eddyscan.devices.sim.world_facts import facts_of
from eddyscan.devices.sim.world_foot import FootFinder
from eddyscan.devices.sim.world_placement import TRAVEL_MM
from eddyscan.devices.sim.world_probe import ProbeOverPart
from eddyscan.devices.sim.world_settings import WorldCoil, WorldFlaw, WorldInstrument, WorldPlacement, WorldSettings
from eddyscan.physics import Coil, Conductor, Slot, air_inductance_h, impedance_ohm, least_lift_off_mm, slot_table

FREQUENCY_HZ = 500e3
IDEAL = WorldInstrument(
    noise=0, flicker=0, drift_k=0, wire_resistance_ohm=0, coil_tolerance=0, null_offset_ohm=0, digits=9
)
STRAIGHT = WorldPlacement(probe_tilt_deg=0.0)


def probe_over(part, **world):
    settings = WorldSettings(part=part, instrument=IDEAL, placement=STRAIGHT, **world)
    facts = facts_of(settings)
    return ProbeOverPart(settings, facts), facts


def stage_place(facts, x_mm, y_mm, lift_off_mm):
    """Return the stage reading with the coil `lift_off_mm` off the surface below (x, y) of the part."""
    foot = placed(facts.part, WorldFlaw(x_mm=x_mm, y_mm=y_mm, length_mm=1, depth_mm=1))
    return apply(facts.T_stage_part, (foot.centre_mm + lift_off_mm * foot.normal)[None])[0]


class TestFoot:
    @pytest.mark.parametrize("name", sorted(PARTS))
    def test_foot_below_points_along_the_normal_is_where_they_came_from(self, name):
        part = named_part(name)
        rng = np.random.default_rng(1)
        share = 0.6 if name == "dome" else 0.95
        u, v = ((rng.uniform(-share, share, 60) + 1) / 2 * (r[1] - r[0]) + r[0] for r in (part.u_range, part.v_range))
        spots, normals = part.surface(u, v), part.normal(u, v)
        heights = rng.uniform(-0.1, 3.0, 60)
        finder = FootFinder(part)
        for spot, normal, height in zip(spots, normals, heights, strict=True):
            foot = finder.at(spot + height * normal)
            if name == "block-d" and np.abs(spot[0] - foot.point_mm[0]) > 0.1:
                continue  # its corners between flat and wave have two feet
            assert foot.distance_mm == pytest.approx(height, abs=1e-6)
            assert foot.point_mm == pytest.approx(spot, abs=1e-4)

    def test_foot_agrees_with_the_parts_own_closest_point(self):
        part = named_part("blade")
        points = part.surface(np.linspace(5, 195, 40), np.linspace(-35, 35, 40)) + np.array([0.3, 0.2, 1.5])
        foot, _, distance = part.closest(points)
        found = [FootFinder(part).at(point) for point in points]
        assert np.abs([f.distance_mm for f in found] - distance).max() < 1e-8
        assert np.abs([f.point_mm for f in found] - foot).max() < 1e-5

    def test_curvature_of_the_wave_is_its_closed_form(self):
        a, wavelength = 7.5, 150.0
        foot = FootFinder(named_part("block-a")).at(np.array([wavelength / 4, 50.0, 30 + a + 0.5]))
        assert foot.curvature_per_mm == pytest.approx(a * (2 * np.pi / wavelength) ** 2, rel=1e-4)

    def test_beyond_the_outline_the_distance_to_the_rim_counts(self):
        foot = FootFinder(named_part("plate")).at(np.array([100.0, -3.0, 34.0]))
        assert foot.distance_mm == pytest.approx(5.0)
        assert foot.edge_mm == pytest.approx(-3.0)

    def test_distance_to_the_outline(self):
        assert FootFinder(named_part("plate")).at(np.array([2.0, 50.0, 30.5])).edge_mm == pytest.approx(2.0)

    def test_a_foot_costs_less_than_a_millisecond(self):
        finder = FootFinder(named_part("block-c"))
        before = time.process_time()
        for x in np.linspace(5, 195, 200):
            finder.at(np.array([x, 40.0, 50.0]))
        assert (time.process_time() - before) / 200 < 1e-3


@pytest.fixture(scope="module")
def response():
    return CoilResponse(Coil(0.5, 1.5, 1.0, 100), Conductor.half_space(19.0), FREQUENCY_HZ)


class TestResponse:
    @given(lift_off=st.floats(0.0, 30.0))
    @settings(max_examples=30, deadline=None)
    def test_upright_is_dodd_and_deeds(self, response, lift_off):
        exact = impedance_ohm(response.coil, response.conductor, FREQUENCY_HZ, lift_off)
        assert abs(response.impedance_ohm(lift_off, 0.0) - exact) < 1e-6 * abs(response.air_ohm)

    @pytest.mark.parametrize("tilt", [0.4, 12.0])
    def test_tilted_is_the_exact_tilted_coil_between_the_tables_nodes(self, response, tilt):
        least = least_lift_off_mm(response.coil, tilt)
        clearance = np.array([0.02, 0.3, 1.0])
        exact = impedance_ohm(response.coil, response.conductor, FREQUENCY_HZ, least + clearance, tilt)
        found = np.array([response.impedance_ohm(least + c, tilt) for c in clearance])
        assert np.abs(found - exact).max() < 1e-5 * abs(response.air_ohm)

    def test_far_away_is_air(self, response):
        assert response.impedance_ohm(60.0, 5.0) == response.air_ohm

    def test_a_coil_that_would_cut_the_metal_rests_on_it(self, response):
        assert response.impedance_ohm(-0.3, 0.0) == response.impedance_ohm(0.0, 0.0)
        least = least_lift_off_mm(response.coil, 20.0)
        assert response.impedance_ohm(0.1, 20.0) == response.impedance_ohm(least, 20.0)

    def test_upright_lift_off_undoes_the_upright_response(self, response):
        for lift_off in (0.05, 0.5, 2.0):
            z = response.impedance_ohm(lift_off, 0.0)
            assert response.upright_lift_off_mm(z) == pytest.approx(lift_off, abs=2e-3)


class TestProbe:
    def test_over_the_plate_it_is_the_closed_form(self):
        probe, facts = probe_over("plate", flaws="none", seed=3)
        facts_lean = WorldPlacement().lean_deg
        z, truth = probe.feel(stage_place(facts, 80.0, 40.0, 0.4), FREQUENCY_HZ, 0.0)
        assert truth.lift_off_mm == pytest.approx(0.4, abs=1e-6)
        assert truth.tilt_deg < 1.5 * facts_lean
        exact = impedance_ohm(probe.coil, probe.conductor, FREQUENCY_HZ, 0.4)
        assert abs(z - exact) < 1e-5 * abs(exact)

    def test_a_hill_reads_as_more_lift_off_by_the_spheres_measure(self):
        probe, facts = probe_over("dome", flaws="none", seed=3)
        z, truth = probe.feel(stage_place(facts, 50.0, 50.0, 0.1), FREQUENCY_HZ, 0.0)
        assert truth.curvature_per_mm == pytest.approx(2 / 50)
        gap = 0.1 + 0.0157  # the exact series for a sphere of 50 mm
        exact = impedance_ohm(probe.coil, probe.conductor, FREQUENCY_HZ, gap, truth.tilt_deg)
        assert abs(z - exact) < 5e-4 * abs(exact)

    def test_a_slot_below_adds_its_table(self):
        slot = WorldFlaw(x_mm=80, y_mm=40, angle_deg=30, length_mm=1.0, depth_mm=0.3)
        with_slot, facts = probe_over("plate", flaws="listed", slots=(slot,), seed=3)
        without, _ = probe_over("plate", flaws="none", seed=3)
        along = np.array([np.cos(np.radians(30)), np.sin(np.radians(30))])
        at = stage_place(facts, 80 + 0.8 * along[0], 40 + 0.8 * along[1], 0.4)
        change = with_slot.feel(at, FREQUENCY_HZ, 0.0)[0] - without.feel(at, FREQUENCY_HZ, 0.0)[0]
        table = slot_table(Slot(1.0, 0.3, 0.1), with_slot.coil, with_slot.conductor, FREQUENCY_HZ)
        assert abs(change - complex(table.change_ohm(0.8, 0.0, 0.4))) < 0.02 * table.peak_ohm

    def test_far_from_every_slot_there_is_no_change(self):
        slot = WorldFlaw(x_mm=80, y_mm=40, length_mm=1.0, depth_mm=0.3)
        with_slot, facts = probe_over("plate", flaws="listed", slots=(slot,), seed=3)
        without, _ = probe_over("plate", flaws="none", seed=3)
        at = stage_place(facts, 100.0, 60.0, 0.4)
        assert with_slot.feel(at, FREQUENCY_HZ, 0.0)[0] == without.feel(at, FREQUENCY_HZ, 0.0)[0]

    def test_near_the_edge_the_truth_says_that_it_is_no_physics(self):
        probe, facts = probe_over("plate", flaws="none")
        zone = edge_zone_mm(probe.coil)
        assert zone == pytest.approx(1.7 * 1.5)
        assert probe.pose(stage_place(facts, zone - 0.1, 50.0, 0.4), 0.0).near_edge
        assert not probe.pose(stage_place(facts, zone + 0.1, 50.0, 0.4), 0.0).near_edge

    def test_a_knocked_part_is_elsewhere_from_that_reading_on(self):
        probe, facts = probe_over("plate", flaws="none", faults={"part_shift_after": 2, "part_shift_mm": (0, 0, 0.25)})
        at = stage_place(facts, 80.0, 40.0, 0.5)
        for number in range(2):
            probe.remember(complex(number), probe.pose(at, 0.0))
        assert probe.history[1][1].lift_off_mm == pytest.approx(0.5, abs=1e-6)
        assert probe.pose(at, 0.0).lift_off_mm == pytest.approx(0.25, abs=1e-4)

    @pytest.mark.parametrize("name", sorted(set(PARTS) - {"dome"}))
    def test_the_whole_inspected_surface_is_within_the_travels(self, name):
        for seed in range(10):
            facts = facts_of(WorldSettings(part=name, seed=seed))
            place = apply(facts.T_stage_part, facts.part.top_mesh(4.0).vertices)
            assert (place.min(axis=0) > 0).all()
            assert (place.max(axis=0) < np.array(TRAVEL_MM) - [0, 0, 5.5]).all()

    def test_of_the_dome_the_top_is_within_the_travels(self):
        facts = facts_of(WorldSettings(part="dome"))
        top = apply(facts.T_stage_part, np.array([[50.0, 50.0, 50.0]]))[0]
        assert 20 < top[2] < TRAVEL_MM[2] - 5.5


class TestReferenceBlock:
    CORNER = np.array([30.0, 3.0, 12.0])

    def feel(self, x_mm, along_mm=0.0, lift_off_mm=0.3):
        small = {"place_error_mm": 0.0, "notch_length_mm": 1.0, "notch_depths_mm": (0.25, 0.5)}
        probe, _ = probe_over("plate", flaws="none", reference=small)
        return probe.feel(self.CORNER + np.array([x_mm, 8.0 + along_mm, lift_off_mm]), FREQUENCY_HZ, 0.0)

    def test_its_sound_metal_is_the_closed_form(self):
        z, truth = self.feel(10.0)
        assert truth.body == "reference"
        assert truth.lift_off_mm == pytest.approx(0.3)
        exact = impedance_ohm(Coil(0.5, 1.5, 1.0, 100), Conductor.half_space(19.0), FREQUENCY_HZ, 0.3)
        assert abs(z - exact) < 1e-6 * abs(exact)

    def test_deeper_notches_answer_louder(self):
        sound = self.feel(10.0)[0]
        change = [abs(self.feel(x, along_mm=0.9)[0] - sound) for x in (80 / 3, 160 / 3)]
        assert 0.02 < change[0] < change[1]

    def test_the_part_is_not_in_its_way(self):
        for name in sorted(PARTS):
            for seed in range(5):
                facts = facts_of(WorldSettings(part=name, seed=seed))
                assert apply(facts.T_stage_part, facts.part.top_mesh(4.0).vertices)[:, 1].min() > 3 + 16 + 4


class TestFlaws:
    @pytest.mark.parametrize("name", sorted(PARTS))
    def test_default_flaws_are_the_four_sizes_on_the_surface_apart(self, name):
        part = named_part(name)
        flaws = default_flaws(part, seed=11)
        assert [(f.length_mm, f.depth_mm) for f in flaws] == [(3.0, 1.0), (2.0, 0.5), (1.0, 0.3), (0.75, 0.25)]
        on_part = [placed(part, flaw) for flaw in flaws]
        centres = np.array([f.centre_mm for f in on_part])
        assert np.abs(part.closest(centres)[2]).max() < 1e-6
        gaps = np.linalg.norm(centres[:, None] - centres[None], axis=2)[np.triu_indices(4, 1)]
        assert gaps.min() > 20.0

    def test_axes_of_a_flaw_lie_in_the_surface(self):
        flaw: Flaw = placed(named_part("block-c"), WorldFlaw(x_mm=20, y_mm=30, angle_deg=40, length_mm=2, depth_mm=1))
        axes = np.array([flaw.along, flaw.across, flaw.normal])
        assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-9)
        assert np.linalg.det(axes) == pytest.approx(1.0)

    def test_a_flaw_off_the_part_is_refused(self):
        with pytest.raises(TechniqueError, match=r"x = 250, y = 30 mm lies off the surface of block-a"):
            placed(named_part("block-a"), WorldFlaw(x_mm=250, y_mm=30, length_mm=1, depth_mm=1))

    def test_a_slot_wider_than_deep_is_refused_before_anything_starts(self):
        slot = WorldFlaw(x_mm=80, y_mm=40, length_mm=1.0, depth_mm=0.1, opening_mm=0.4)
        with pytest.raises(TechniqueError, match=r"opening_mm = 0.4: must lie from 0 to 0.05 mm"):
            facts_of(WorldSettings(part="plate", flaws="listed", slots=(slot,)))


class TestImperfections:
    def test_coil_sizes_are_off_within_the_tolerance_and_inductance_follows(self):
        nominal = WorldCoil()
        inductances = [air_inductance_h(real_coil(nominal, 0.02, seed)) for seed in range(12)]
        ideal = air_inductance_h(real_coil(nominal, 0.0, 0))
        off = np.array(inductances) / ideal - 1
        assert np.abs(off).max() < 0.05
        assert off.std() > 0.003

    def test_white_noise_is_relative_to_the_air_reactance_and_falls_with_the_aperture(self):
        options = IDEAL.model_copy(update={"noise": 1e-4})
        noise = ReadingNoise(options, 1)
        short = [noise.apply(1j, 40j, 0.0, options.short_s) for _ in range(4000)]
        long = [noise.apply(1j, 40j, 0.0, 16 * options.short_s) for _ in range(4000)]
        assert np.std(short) == pytest.approx(4e-3, rel=0.05)
        assert np.std(long) == pytest.approx(1e-3, rel=0.05)

    def test_flicker_wanders_slowly(self):
        noise = ReadingNoise(IDEAL.model_copy(update={"flicker": 1e-3}), 1)
        values = np.array([noise.apply(0j, 40j, 0.01 * k, 0.0056) for k in range(20_000)])
        assert np.abs(np.diff(values)).mean() < 0.5 * np.abs(values - values.mean()).mean()
        assert np.abs(values[:10_000].mean() - values[10_000:].mean()) > 1e-3

    def test_warm_wire_has_more_resistance(self):
        options = IDEAL.model_copy(update={"drift_k": 2.0, "wire_resistance_ohm": 1.0, "wire_per_k": 0.0039})
        noise = ReadingNoise(options, 1)
        swing = [noise.apply(0j, 40j, t, 0.0056).real for t in np.linspace(0, options.drift_period_s, 200)]
        assert max(swing) - min(swing) == pytest.approx(2 * 0.0039, rel=0.01)

    def test_null_offset_is_one_fixed_complex_value(self):
        noise = ReadingNoise(IDEAL.model_copy(update={"null_offset_ohm": 0.05}), 4)
        assert abs(noise.apply(0j, 40j, 0.0, 1.0)) == pytest.approx(0.05)
        assert noise.apply(0j, 40j, 0.0, 1.0) == noise.apply(0j, 40j, 9.0, 1.0)
