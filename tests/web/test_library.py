"""What the page reads and writes in inspection folders, without a server."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from eddyscan.core.errors import FileError, InputError, TechniqueError
from eddyscan.core.plain import plain
from eddyscan.core.technique import Technique
from eddyscan.web import settings, uploads
from eddyscan.web.decisions import decide, decisions
from eddyscan.web.library import Library
from eddyscan.web.link import framed
from eddyscan.web.packing import KINDS, packed
from tests.web.shelf_on_disk import analysed_inspection, planned_inspection

KNOWN = {1: (10.0, 20.0, 30.0)}


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    root = tmp_path_factory.mktemp("library")
    analysed_inspection(root / "plate-2")
    return root


@pytest.fixture
def library(kept, tmp_path):
    shutil.copytree(kept, tmp_path / "shelf")
    return Library(tmp_path / "shelf")


def unpacked(data: bytes) -> tuple[dict, dict]:
    """Read what the page's script reads, by the same rules."""
    size = int.from_bytes(data[:4], "little")
    head = json.loads(data[4 : 4 + size])
    kinds = {word: np.dtype(f"<{kind}") for kind, word in KINDS.items()}
    arrays = {
        name: np.frombuffer(data, kinds[e["type"]], int(np.prod(e["shape"])), 4 + size + e["offset"]).reshape(
            e["shape"]
        )
        for name, e in head["arrays"].items()
    }
    assert all((4 + size + e["offset"]) % 8 == 0 for e in head["arrays"].values())
    return head["facts"], arrays


@given(
    st.lists(
        npst.arrays(
            st.sampled_from([np.float32, np.float64, np.uint32, np.int32, np.uint8]),
            npst.array_shapes(min_dims=1, max_dims=2, min_side=0, max_side=7),
        ),
        max_size=4,
    ),
    st.dictionaries(st.text(max_size=5), st.floats(allow_nan=True), max_size=3),
)
def test_packed_arrays_come_back_whole(arrays, facts):
    named = {f"array {k}": array for k, array in enumerate(arrays)}
    told, back = unpacked(packed(named, facts))
    assert told == json.loads(json.dumps(plain(facts)))
    for name, array in named.items():
        np.testing.assert_array_equal(back[name], array)


def test_messages_turn_nan_to_null_and_name_their_bytes():
    line, _, payload = framed({"a": float("nan"), "b": np.float64(2)}, b"xyz").partition(b"\n")
    assert json.loads(line) == {"a": None, "b": 2.0, "bytes": 3}
    assert payload == b"xyz"


@given(st.text(max_size=90))
def test_uploaded_names_become_harmless(name):
    try:
        kept_as = uploads.safe_name(name, {"a.ply"})
    except InputError:
        return
    assert "/" not in kept_as
    assert "\\" not in kept_as
    assert not kept_as.startswith(".")
    assert kept_as != "a.ply"
    assert kept_as in uploads.BESIDE or kept_as.rsplit(".", 1)[1] in {s[1:] for s in uploads.SUFFIXES}


@pytest.mark.parametrize(
    ("name", "kept_as"),
    [
        ("view-3.ply", "view-3.ply"),
        ("../../etc/x.PLY", "x.ply"),
        ("C:\\data\\camera.json", "camera.json"),
        ("a b<script>.png", "upload-0.png"),
        ("a.ply", "upload-0.ply"),
    ],
)
def test_names_by_example(name, kept_as):
    assert uploads.safe_name(name, {"a.ply"}) == kept_as


@pytest.mark.parametrize("name", ["page.html", "x.toml", ".ply/..", "", None, "rig.toml"])
def test_other_kinds_of_files_are_refused(name):
    with pytest.raises(InputError, match="is no view"):
        uploads.safe_name(name, set())


@pytest.mark.parametrize(
    ("size", "free", "words"),
    [
        (None, 1 << 40, "did not say how big"),
        (0, 1 << 40, "is empty"),
        (2 << 30, 1 << 40, "the file has 2147 MB, the limit is 268 MB"),
        (1 << 20, 1 << 30, "are free on the disk"),
    ],
)
def test_uploads_are_refused_by_their_size(size, free, words):
    assert words in str(uploads.refusal(size, free))
    assert uploads.refusal(1 << 20, 1 << 40) is None


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("a.ply", b"PK\x03\x04", "is no PLY file"),
        ("a.png", b"<html>", "is no PNG file"),
        ("a.e57", b"x", "is no E57 file"),
        ("a.pcd", b"x", "is no PCD file"),
        ("a.xyz", b"one two three\n", "is no XYZ file"),
        ("a.xyz", b"\x00\xff", "is no XYZ file"),
        ("a.ply", b"", "is empty"),
        ("poses.json", b"{", "no valid JSON"),
        ("camera.json", b"7", "no JSON object"),
        ("camera.json", b"[" * 100_000, "no valid JSON"),
    ],
)
def test_content_must_be_what_the_name_says(tmp_path, name, data, words):
    path = tmp_path / "temporary"
    path.write_bytes(data)
    with pytest.raises(FileError, match=words):
        uploads.check_content(path, name)


@pytest.mark.parametrize("data", [b"# c\n1 2 3\n", b"1,2,3,4\n", b"1.0e2 -3 4 5 6 7\n"])
def test_tables_of_points_are_taken(tmp_path, data):
    (tmp_path / "t").write_bytes(data)
    uploads.check_content(tmp_path / "t", "a.xyz")


def test_form_shows_every_plain_value_with_unit_and_limits():
    sections = {s["section"]: {f["key"]: f for f in s["fields"]} for s in settings.form(Technique())}
    pitch = sections["plan"]["pitch_mm"]
    assert (pitch["value"], pitch["unit"], pitch["limits"], pitch["kind"]) == (5.0, "mm", "> 0", "number")
    assert sections["scan"]["speed_mm_s"]["unit"] == "mm/s"
    assert sections["drive"]["frequency_hz"]["unit"] == "Hz"
    assert sections["part"]["conductivity_ms_m"]["unit"] == "MS/m"
    assert sections["scan"]["mode"]["choices"] == ["step", "row", "pvt"]
    assert set(sections) == {"procedure", "part", "surface", "probe", "drive", "plan", "scan", "analysis"} & set(
        sections
    )


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"plan": {"pitch_mm": -1}}, "plan.pitch_mm", "greater than 0"),
        ({"plan": {"pitch_mm": "wide"}}, "plan.pitch_mm", "valid number"),
        ({"plan": {"pich_mm": 3}}, "plan.pich_mm", "unknown key"),
        ({"plam": {"pitch_mm": 3}}, "plam", "unknown key"),
        ({"probe": {"inner_radius_mm": 9}}, "probe", "must be below outer_radius_mm"),
    ],
)
def test_faults_of_typed_values_are_told_by_key(changes, key, words):
    assert words in settings.faults(Technique(), changes)[key]


@pytest.mark.parametrize("changes", [None, 3, [], {"plan": 3}])
def test_changes_that_are_no_tables_are_refused(changes):
    with pytest.raises(InputError, match="nothing was saved"):
        settings.faults(Technique(), changes)


def test_saving_keeps_other_values_and_logs_the_change(tmp_path):
    inspection = planned_inspection(tmp_path / "one")
    with pytest.raises(TechniqueError, match=r"not saved: plan\.step_mm"):
        settings.save(inspection, {"plan": {"step_mm": 0}}, "a test")
    told = settings.save(inspection, {"plan": {"step_mm": 7}}, "a test")
    assert told == {"changed": {"plan.step_mm": [10.0, 7.0]}}
    technique = inspection.technique()
    assert (technique.plan.step_mm, technique.plan.pitch_mm, technique.part.name) == (7.0, 20.0, "plate")
    assert '"plan.step_mm": [10.0, 7.0]' in (inspection.folder / "log.jsonl").read_text()


@pytest.mark.parametrize(
    ("given_", "words"),
    [
        ({"number": 2, "verdict": "accept", "name": "A"}, "there is no indication 2"),
        ({"number": 1, "verdict": "maybe", "name": "A"}, "is no decision"),
        ({"number": 1, "verdict": "accept", "name": " "}, "needs the name"),
        ({"number": 1, "verdict": "comment", "name": "A"}, "comment is empty"),
        ({"number": 1, "verdict": "reject", "name": "A" * 81}, "too long"),
        ({}, "there is no indication None"),
    ],
)
def test_unusable_decisions_are_refused(tmp_path, given_, words):
    inspection = planned_inspection(tmp_path / "one")
    with pytest.raises(InputError, match=words):
        decide(inspection, given_, KNOWN)
    assert decisions(inspection) == []


def test_decisions_pile_up_and_survive_a_torn_line(tmp_path):
    inspection = planned_inspection(tmp_path / "one")
    for verdict in ("accept", "reject"):
        decide(inspection, {"number": 1, "verdict": verdict, "name": "A", "comment": "ü\n"}, KNOWN)
    with (inspection.folder / "decisions.jsonl").open("a") as file:
        file.write('{"number": 1, "verd')
    made = decisions(inspection)
    assert [entry["verdict"] for entry in made] == ["accept", "reject"]
    assert made[0]["centre_mm"] == [10.0, 20.0, 30.0]
    assert made[0]["time"].endswith("+00:00")


def test_overview_tells_every_step_and_its_figure(library):
    told, _ = library.answer({"ask": "overview", "name": "plate-2"})
    steps = {step["name"]: step for step in told["steps"]}
    assert list(steps) == ["views", "surface", "plan", "align", "record", "cscan", "report"]
    assert steps["surface"]["figure"] == "200 × 100 mm, views agree to 0.021 mm"
    assert steps["record"]["figure"] == "100 of 100 readings"
    assert steps["cscan"]["figure"] == "2 indications, 2 to decide"
    assert (steps["report"]["state"], steps["report"]["figure"]) == ("missing", "")
    assert told["virtual"] is True


def test_damaged_folders_are_listed_as_damaged(library):
    (library.shelf.root / "plate-2" / "technique.toml").write_text("[plan\n")
    (entry,) = library.answer({"ask": "list"})[0]["inspections"]
    assert entry["state"] == "damaged"
    assert "no valid TOML" in entry["fault"]


@pytest.mark.parametrize("scene", ["surface", "cloud", "plan", "record", "cscan"])
def test_scenes_hold_what_the_files_hold(library, scene):
    _, arrays = unpacked(library.answer({"ask": "scene", "name": "plate-2", "scene": scene})[1])
    rows = {"surface": "vertices", "cloud": "points", "plan": "coil", "record": "rows", "cscan": "covered"}
    assert len(arrays[rows[scene]]) >= 100
    if scene == "record":
        assert arrays["rows"].shape == (100, 10)
        np.testing.assert_allclose(arrays["rows"][:, 5], 30.5, atol=0.02)
    if scene == "plan":
        assert int((arrays["kind"] == 0).sum()) == 100


def test_scene_of_a_missing_step_says_so(library):
    shutil.rmtree(library.shelf.root / "plate-2" / "5-cscan")
    with pytest.raises(FileError, match="is not there yet"):
        library.answer({"ask": "scene", "name": "plate-2", "scene": "cscan"})


def test_rewritten_step_is_read_anew(library):
    first = library.answer({"ask": "scene", "name": "plate-2", "scene": "plan"})[1]
    planned_inspection(library.shelf.root / "other", step_mm=25.0)
    shutil.rmtree(library.shelf.root / "plate-2" / "3-plan")
    shutil.move(library.shelf.root / "other" / "3-plan", library.shelf.root / "plate-2" / "3-plan")
    assert library.answer({"ask": "scene", "name": "plate-2", "scene": "plan"})[1] != first


def test_duplicate_takes_technique_and_rig_and_no_data(library):
    library.answer({"ask": "duplicate", "name": "plate-2", "new": "copy"})
    folder = library.shelf.root / "copy"
    assert (folder / "technique.toml").read_text() == (library.shelf.root / "plate-2" / "technique.toml").read_text()
    assert sorted(p.name for p in folder.iterdir()) == ["1-views", "log.jsonl", "rig.toml", "technique.toml"]
    with pytest.raises(FileError, match="already"):
        library.answer({"ask": "duplicate", "name": "plate-2", "new": "copy"})


@pytest.mark.parametrize("seed", [-1, 1.5, "1", True, 2**31, None])
def test_seeds_are_whole_numbers(library, seed):
    with pytest.raises(InputError, match="is no whole number"):
        library.answer({"ask": "make", "new": "fresh", "part": "plate", "seed": seed})
