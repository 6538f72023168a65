"""What the report states is what the data hold."""

from __future__ import annotations

import base64
import dataclasses
import io
import json
import re

import numpy as np
import pytest
from example_inspection import (
    example_plan,
    example_record,
    example_views,
    measured_mesh,
    small_inspection,
    whole_inspection,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.image import imread

from eddyscan.core.cloud import PointCloud
from eddyscan.core.cscan import CScan
from eddyscan.core.frames import Array
from eddyscan.core.indication import Indication
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import named_part
from eddyscan.report.blocks import Chart, Facts, Table
from eddyscan.report.content import NominalComparison
from eddyscan.report.envelopes import MOST_POINTS, envelope, sparse
from eddyscan.report.figures_coverage import examined_share, share_texts, vertex_areas
from eddyscan.report.figures_indication import lift_off_rotation, neighbourhood
from eddyscan.report.figures_position import axis_errors, longest_row
from eddyscan.report.figures_signal import cscan_figure, median_ohm, reading_maps
from eddyscan.report.figures_surface import heights, profile
from eddyscan.report.figures_views import view_picture
from eddyscan.report.headline import headline
from eddyscan.report.mesh_thinning import on_border, thinned
from eddyscan.report.scene import scene_json
from eddyscan.report.sections import sections
from eddyscan.report.sections_result import false_call_basis, indication_table, reference_amplitude
from eddyscan.report.tables import blocks_of
from eddyscan.report.theme import PAPER, VARIABLES, drawn, to_svg
from eddyscan.report.words import flattened, label, number, percent, plus_minus


def decoded(array: dict[str, str]) -> np.ndarray:
    return np.frombuffer(base64.b64decode(array["bdata"]), dtype="<" + array["dtype"])


@settings(deadline=None)
@given(st.lists(st.tuples(*[st.floats(-0.1, 0.1)] * 3), min_size=1, max_size=40))
def test_position_errors_are_mean_and_standard_deviation_per_axis(errors_mm: list[tuple[float, float, float]]) -> None:
    record, _, _ = example_record(example_plan(30.0, 30.0))
    known = np.resize(np.array(errors_mm), record.target_mm.shape)
    record = dataclasses.replace(record, stage_mm=record.target_mm + known)
    for k, found in enumerate(axis_errors(record)):
        assert found.mean_um == pytest.approx(1000 * known[:, k].mean(), abs=1e-6)
        assert found.std_um == pytest.approx(1000 * known[:, k].std(), abs=1e-6)
        assert found.largest_um == pytest.approx(1000 * np.abs(known[:, k]).max(), abs=1e-6)


def test_an_axis_without_positions_is_left_out() -> None:
    record, _, _ = example_record(example_plan(30.0, 30.0))
    stage = record.stage_mm.copy()
    stage[:, 2] = np.nan
    assert [error.axis for error in axis_errors(dataclasses.replace(record, stage_mm=stage))] == ["x", "y"]
    assert longest_row(record) == 0


@pytest.mark.parametrize("part", ["block-a", "blade", "dome"])
def test_a_surface_lifted_by_a_tenth_shows_a_tenth_everywhere(part: str) -> None:
    exact = named_part(part).top_mesh(2.0)
    lifted = SurfaceMesh(exact.vertices + np.array([0.0, 0.0, 0.1]), exact.faces, exact.normals)
    line = profile(lifted, NominalComparison(part, exact, np.eye(4)))
    np.testing.assert_allclose(line.measured_mm - line.nominal_mm, 0.1, atol=1e-9)
    np.testing.assert_allclose(line.spread_mm, 0.0, atol=1e-9)
    assert np.isfinite(line.x_mm).all()
    assert (np.diff(line.x_mm) > 0).all()


def test_the_profile_of_a_block_is_its_sine() -> None:
    line = profile(named_part("block-a").top_mesh(1.0), None)
    np.testing.assert_allclose(line.measured_mm, 30 + 7.5 * np.sin(2 * np.pi * line.x_mm / 150), atol=0.02)
    assert line.spread_mm.max() < 0.05
    assert np.isnan(line.nominal_mm).all()


def test_heights_beside_the_surface_are_unknown() -> None:
    plate = named_part("plate").top_mesh(10.0)
    np.testing.assert_allclose(heights(plate, np.array([[50.0, 50.0], [300.0, 50.0]])), [30.0, np.nan])


def test_vertex_areas_add_up_to_the_surface() -> None:
    mesh = measured_mesh(7.0)
    assert vertex_areas(mesh).sum() == pytest.approx(mesh.area_mm2)


def test_half_a_covered_plate_is_half_examined() -> None:
    plate = named_part("plate").top_mesh(1.0)
    assert examined_share(CScan(plate, plate.vertices[:, 0] < 100.0)) == pytest.approx(0.5, abs=0.005)


@settings(deadline=None)
@given(st.floats(0, 1))
def test_examined_and_not_examined_add_up_and_never_flatter(share: float) -> None:
    examined, rest = (float(text.removesuffix(" %")) for text in share_texts(share))
    assert examined + rest == pytest.approx(100.0)
    assert examined <= 100 * share + 1e-6
    assert (percent(share) == "100.0 %") == (share == 1.0)


@settings(deadline=None)
@given(st.integers(20, 400))
def test_a_thinned_mesh_keeps_vertices_and_form(most: int) -> None:
    mesh = named_part("block-a").top_mesh(4.0)
    keep, faces = thinned(mesh, most)
    assert len(keep) <= most
    assert len(np.unique(keep)) == len(keep)
    assert faces.min() >= 0
    assert faces.max() < len(keep)
    light = SurfaceMesh.from_triangles(mesh.vertices[keep], faces)
    assert light.area_mm2 == pytest.approx(mesh.area_mm2, rel=0.5)


def test_a_thinned_mesh_keeps_its_outline_straight() -> None:
    mesh = named_part("plate").top_mesh(2.0)
    keep, faces = thinned(mesh, 1500)
    rim = mesh.vertices[keep][on_border(faces)]
    beside = np.minimum.reduce([rim[:, 0], 200 - rim[:, 0], rim[:, 1], 100 - rim[:, 1]])
    np.testing.assert_allclose(beside, 0.0, atol=1e-9)
    np.testing.assert_allclose(rim.min(axis=0)[:2], 0.0, atol=4.0)
    np.testing.assert_allclose(rim.max(axis=0)[:2], [200.0, 100.0], atol=4.0)


def test_a_small_mesh_stays_as_it_is() -> None:
    mesh = named_part("block-a").top_mesh(20.0)
    keep, faces = thinned(mesh, 10_000)
    np.testing.assert_array_equal(keep, np.arange(len(mesh.vertices)))
    assert faces is mesh.faces


def refuse(constant: str) -> float:
    raise AssertionError(f"{constant} is no JSON")


def test_the_scene_is_strict_json_with_matching_arrays() -> None:
    content = small_inspection()
    assert content.cscan is not None
    scene = json.loads(scene_json(content), parse_constant=refuse)
    surface, path, indications = scene["data"]
    n = len(content.cscan.mesh.vertices)
    assert all(decoded(surface[axis]).shape == (n,) for axis in "xyz")
    assert max(decoded(surface[corner]).max() for corner in "ijk") == n - 1
    for button in scene["layout"]["updatemenus"][0]["buttons"]:
        values = decoded(button["args"][0]["intensity"][0])
        assert values.shape == (n,)
        assert np.isfinite(values).all()
    assert {"lift-off [mm]", "residual [Ω]", "height [mm]"} <= {
        b["label"] for b in scene["layout"]["updatemenus"][0]["buttons"]
    }
    assert content.plan is not None
    np.testing.assert_allclose(decoded(path["x"]), content.plan.T_part_probe[:, 0, 3], rtol=1e-6)
    assert indications["text"] == ["1", "2"]


def test_the_scene_keeps_true_proportions() -> None:
    view = json.loads(scene_json(small_inspection()))["layout"]["scene"]
    sides = {axis: float(np.ptp(view[f"{axis}axis"]["range"])) for axis in "xyz"}
    scale = {axis: view["aspectratio"][axis] / sides[axis] for axis in "xyz"}
    assert scale["y"] == pytest.approx(scale["x"])
    assert scale["z"] == pytest.approx(scale["x"])
    assert max(view["aspectratio"].values()) == pytest.approx(2.0)


def test_the_strongest_crack_signal_is_not_clipped_in_the_scene() -> None:
    content = whole_inspection(edge_mm=4.0)
    assert content.cscan is not None
    button = next(
        b for b in json.loads(scene_json(content))["layout"]["updatemenus"][0]["buttons"] if "residual" in b["label"]
    )
    assert button["args"][0]["cmax"][0] == pytest.approx(np.nanmax(content.cscan.channels["residual_ohm"]))


def test_depth_pictures_are_transparent_where_nothing_was_seen() -> None:
    view = example_views()[0]
    picture = view_picture(view)
    pixels = imread(io.BytesIO(picture.png))
    step = round(view.camera.width / pixels.shape[1])
    np.testing.assert_array_equal(pixels[..., 3] > 0, np.isfinite(view.depth_mm[::step, ::step]))
    assert "view-0.png" in picture.caption
    blank = dataclasses.replace(view, depth_mm=np.full_like(view.depth_mm, np.nan))
    assert "no depth at all" in view_picture(blank).caption


def test_a_cloud_has_a_picture_too() -> None:
    cloud = PointCloud(np.random.default_rng(0).uniform(0, 50, (500, 3)), name="a.ply")
    picture = view_picture(cloud)
    assert "a.ply · 500 points" in picture.caption
    assert imread(io.BytesIO(picture.png)).shape[2] == 4


@settings(deadline=None)
@given(st.floats(0.1, 6.2), st.floats(0.5, 50.0))
def test_growing_lift_off_is_turned_to_the_left(direction_rad: float, slope: float) -> None:
    lift: Array = np.linspace(0.3, 0.8, 50)
    z = (3 + 40j) + slope * np.exp(1j * direction_rad) * lift
    turned = lift_off_rotation(z, lift) * z
    assert np.diff(turned.real).max() < 0
    np.testing.assert_allclose(turned.imag, turned.imag[0], atol=1e-6)


def test_without_lift_off_nothing_is_turned() -> None:
    z = np.array([1 + 1j, 2 + 2j])
    assert lift_off_rotation(z, None) == 1.0
    assert lift_off_rotation(z, np.array([0.5, 0.5])) == 1.0


def test_the_neighbourhood_holds_the_indication_and_sound_metal() -> None:
    one = Indication(1, (0.0, 0.0, 0.0), 3.0, 0.0, 0.1, 0.0, 10.0)
    positions = np.array([[0.0, 0, 0], [3.9, 0, 0], [9.0, 0, 0]])
    assert neighbourhood(positions, one, 0.5).tolist() == [True, True, False]
    assert neighbourhood(positions, one, 5.0).tolist() == [True, True, True]


def test_maps_show_changes_from_the_median() -> None:
    record, lift, residual = example_record(example_plan(20.0, 10.0))
    maps = reading_maps(record, residual, lift)
    assert list(maps) == [
        "resistance, change from its median [mΩ]",
        "reactance, change from its median [mΩ]",
        "lift-off told by the probe [mm]",
        "residual: crack channel [mΩ]",
    ]
    assert np.median(next(iter(maps.values()))) == pytest.approx(0, abs=1e-9)
    assert median_ohm(np.array([np.nan + 0j])) == 0


def test_the_headline_counts_and_never_says_good_without_a_scan() -> None:
    content = small_inspection()
    assert headline(content).verdict.startswith("2 indications above the call level")
    fine = content.technique.plan.model_copy(update={"pitch_mm": 0.5, "step_mm": 0.5})
    dense = dataclasses.replace(content, technique=content.technique.model_copy(update={"plan": fine}), indications=())
    assert headline(dense).kind == "good"
    sparse = headline(dataclasses.replace(content, indications=()))
    assert sparse.kind == "missing"
    assert "too far apart to exclude short flaws" in sparse.verdict
    assert headline(dataclasses.replace(content, indications=None)).kind == "missing"


def test_amplitudes_are_stated_against_the_reference_notch() -> None:
    one = Indication(1, (1.0, 2.0, 3.0), 3.0, 0.0, 0.04, 90.0, 12.0)
    reference = reference_amplitude([{"when": "warm-up"}, {"amplitude_mohm": 80.0, "notch_depth_mm": 0.5}])
    assert reference == (pytest.approx(0.08), "the 0.5 mm reference notch")
    table = indication_table([one], reference)
    assert dict(zip(table.columns, table.rows[0], strict=True))["re notch [dB]"] == "−6.0"
    assert "dB re the 0.5 mm reference notch" in table.title
    plain = indication_table([one])
    assert "re notch [dB]" not in plain.columns
    assert dict(zip(plain.columns, plain.rows[0], strict=True))["length [mm]"] == "–"
    assert reference_amplitude([]) is None


def test_the_false_call_basis_is_the_gaussian_tail() -> None:
    assert "2.7 times in 1000 readings" in false_call_basis(3.0, 1000)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (0.0309, "0.0309"),
        (500000.0, "500000"),
        (-1.5, "−1.5"),
        (float("nan"), "–"),
        (None, "–"),
        (1e-12, "1.000e-12"),
    ],
)
def test_numbers_read_well(value: float | None, text: str) -> None:
    assert number(value) == text


@settings(deadline=None)
@given(st.floats(1e-4, 1e5))
def test_numbers_keep_four_digits(value: float) -> None:
    assert float(number(value)) == pytest.approx(value, rel=1e-3)


def test_names_become_words_with_units() -> None:
    assert label("lift_off_rms_um") == "lift-off root mean square [µm]"
    assert label("speed_mm_s") == "speed [mm/s]"
    assert list(flattened({"lift_off_mm": {"mean": 0.5}, "flaws": [{"found": True}], "note": None})) == [
        ("lift-off [mm] · mean", "0.5"),
        ("flaws 1 · found", "yes"),
        ("note", "–"),
    ]
    assert plus_minus(1.234, 0.05) == "1.23 ± 0.05"
    assert plus_minus(None, None) == "–"


@settings(deadline=None)
@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=300), st.integers(1, 40))
def test_an_envelope_keeps_every_extreme(values: list[float], bins: int) -> None:
    y: Array = np.array(values)
    x, low, high = envelope(np.arange(float(len(y))), y, bins)
    assert len(x) <= bins
    assert low.min() == y.min()
    assert high.max() == y.max()
    assert (low <= high).all()


def test_an_envelope_of_nothing_is_empty() -> None:
    assert all(len(part) == 0 for part in envelope(np.zeros(2), np.full(2, np.nan)))


def test_sparse_keeps_no_more_than_it_may() -> None:
    for count in (0, 1, 2999, 3000, 3001, 71225):
        assert len(range(count)[sparse(count)]) <= 3000


def test_no_picture_inside_a_drawing_holds_a_stand_in_colour() -> None:
    """A rasterised line would keep the stand-in for its colour and come out black."""
    content = whole_inspection(pitch_mm=2.0, step_mm=1.0, edge_mm=4.0)
    assert content.record is not None
    assert len(content.record) > MOST_POINTS
    stand_ins = {tuple(int(c[k : k + 2], 16) for k in (1, 3, 5)) for c in VARIABLES}
    charts = [b for chapter in sections(content) for b in chapter.blocks if isinstance(b, Chart)]
    pictures = 0
    for chart in charts:
        for data in re.findall(r'href="data:image/png;base64,([^"]+)"', to_svg(chart.draw, chart.caption)):
            pixels = (255 * imread(io.BytesIO(base64.b64decode(data)))).round().astype(int)
            solid = pixels[pixels[..., 3] == 255][:, :3]
            assert not stand_ins & set(map(tuple, np.unique(solid, axis=0).tolist())), chart.caption
            pictures += 1
    assert pictures >= 6


def test_a_dome_is_profiled_along_its_middle_and_a_block_over_all_of_y() -> None:
    dome = profile(named_part("dome").top_mesh(1.0), None)
    assert "the middle, y 44.0 to 56.0 mm" in dome.how
    inside = np.abs(dome.x_mm - 50) < 40
    expected = np.sqrt(50.0**2 - (dome.x_mm[inside] - 50) ** 2)
    np.testing.assert_allclose(dome.measured_mm[inside], expected, atol=0.5)
    assert profile(named_part("block-a").top_mesh(2.0), None).how == "averaged over y"


def test_lists_of_findings_become_tables() -> None:
    facts, table = blocks_of({"flaws": {"found": 1, "each": [{"depth_mm": 1.0}, {"depth_mm": 0.5}]}})
    assert isinstance(facts, Facts)
    assert facts.rows == (("flaws · found", "1"),)
    assert isinstance(table, Table)
    assert (table.title, table.columns, table.rows) == ("Flaws · each", ("depth [mm]",), (("1",), ("0.5",)))


def test_a_channel_nobody_speaks_for_is_said_not_drawn() -> None:
    plate = named_part("plate").top_mesh(20.0)
    cscan = CScan(plate, np.zeros(len(plate.vertices), bool), {"score": np.zeros(len(plate.vertices))})
    figure = drawn(lambda theme: cscan_figure(cscan, ["score"], theme), PAPER)
    assert "no reading speaks here" in [text.get_text() for text in figure.axes[0].texts]
