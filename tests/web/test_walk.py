"""The whole operator's path in a real browser on the virtual cell."""

from __future__ import annotations

import re
from urllib.parse import urlsplit

import pytest

from eddyscan.formats.records import read_record
from eddyscan.inspection import Inspection
from tests.web.browser import Hand, chromium

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.timeout(400)]
NAME = "walk"


def quick_cell(inspection: Inspection) -> None:
    """Make the virtual cell quick: fast clock, three views, coarse facets, one pass."""
    text = inspection.rig_file.read_text()
    for key, value in {"time_factor": "20.0", "mesh_edge_mm": "2.0", "views": "3"}.items():
        text = re.sub(rf"^{key} = \S+", f"{key} = {value}", text, count=1, flags=re.M)
    inspection.rig_file.write_text(text)
    technique = inspection.technique_file.read_text()
    inspection.technique_file.write_text(re.sub(r"^passes = \S+", "passes = 1", technique, flags=re.M))


def handle(hand: Hand, axis: int, side: int) -> tuple[float, float]:
    """Return where a handle of the crop box is on the canvas [px]."""
    x, y, _ = hand.js(
        "const v = eddyscan.room.picture.viewer; v.draw();"
        "return v.onScreen(v.crop.handles().find((h) => h.axis === arguments[0] && h.side === arguments[1]).at)",
        axis,
        side,
    )
    return float(x), float(y)


def test_operator_walks_from_new_inspection_to_report(tmp_path, serve):
    served = serve(tmp_path / "shelf", line="eddyscan.pipeline")
    inspection = Inspection(tmp_path / "shelf" / NAME)
    with chromium() as driver:
        hand = Hand(driver, served.running.address)
        hand.open()
        begin(hand, inspection)
        views_and_surface(hand)
        crop_box(hand, inspection)
        technique_and_plan(hand, inspection)
        scan_with_pause_and_stop(hand, inspection)
        results_and_report(hand, inspection)
        hosts = {urlsplit(url).hostname for url in hand.requests() if url.startswith(("http", "ws"))}
        assert hosts == {"127.0.0.1"}
        assert hand.complaints() == []


def begin(hand: Hand, inspection: Inspection) -> None:
    hand.wait(lambda: "No inspection yet" in hand.text("#main"))
    hand.picture("empty")
    hand.type("#new-name", NAME)
    hand.click("#new")
    hand.find("#do-views")
    quick_cell(inspection)


def views_and_surface(hand: Hand) -> None:
    hand.click("#do-views")
    hand.job_is("views", "done", seconds=40)
    hand.wait(lambda: hand.js("return document.querySelectorAll('.thumbs canvas').length") == 3)
    hand.go(f"{NAME}/surface")
    hand.click("#do-surface")
    hand.wait(lambda: hand.job()["step"] == "surface")
    hand.picture("views")
    hand.job_is("surface", "done", seconds=100)
    hand.wait(lambda: hand.js("return eddyscan.room.picture.viewer.has('cloud')"))
    hand.picture("surface")


def crop_box(hand: Hand, inspection: Inspection) -> None:
    hand.click("#crop")
    before = float(hand.find("#crop-x-1").get_attribute("value"))
    x, y = handle(hand, 0, 1)
    middle = handle(hand, 0, 0)
    hand.drag("#picture canvas", (x, y), (0.15 * (middle[0] - x), 0.15 * (middle[1] - y)))
    hand.wait(
        lambda: float(hand.find("#crop-x-1").get_attribute("value")) < before - 5, what="crop box follows the hand"
    )
    hand.picture("crop")
    hand.click("#crop-save")
    hand.wait(lambda: "out of date" in hand.text("#steps"))
    kept = inspection.technique().surface.crop
    assert kept is not None
    assert kept.x_mm is not None
    assert kept.x_mm[1] < before - 5
    hand.click("#crop-off")
    hand.wait(lambda: inspection.technique().surface.crop is None)


def technique_and_plan(hand: Hand, inspection: Inspection) -> None:
    hand.go(f"{NAME}/plan")
    hand.type("[id='plan.pitch_mm']", "-4")
    hand.wait(lambda: "greater than 0" in hand.text(".form"), what="the limit is told as typed")
    assert not hand.find("#save-technique").is_enabled()
    hand.type("[id='plan.pitch_mm']", "12")
    hand.type("[id='plan.step_mm']", "6")
    hand.click("#save-technique")
    hand.wait(lambda: inspection.technique().plan.pitch_mm == 12)
    hand.wait(lambda: not hand.js("return eddyscan.running"))
    hand.click("#do-plan")
    hand.job_is("plan", "done", seconds=40)
    hand.click("#dry-run")
    hand.wait(lambda: hand.js("return eddyscan.room.picture.viewer.has('probe')"))
    hand.picture("plan")
    hand.go(f"{NAME}/align")
    hand.click("#do-align")
    hand.job_is("check", "done", seconds=60)
    hand.wait(lambda: "inside the travel" in hand.text("#details"))
    hand.picture("align")


def scan_with_pause_and_stop(hand: Hand, inspection: Inspection) -> None:
    hand.go(f"{NAME}/record")
    hand.click("#do-record")
    hand.wait(lambda: hand.js("return eddyscan.readings.count") > 20, 90, "readings arrive")
    hand.picture("scan")
    hand.press("p")
    hand.job_is("record", "paused")
    held = hand.js("return eddyscan.readings.count")
    hand.click("#pause")
    hand.wait(lambda: hand.js("return eddyscan.readings.count") > held + 3, what="the scan goes on after Pause")
    hand.click("#stop")
    hand.job_is("record", "stopped")
    kept = len(read_record(inspection.file("record", "record.sqlite")))
    assert kept > held
    hand.wait(lambda: "Go on with the scan" in hand.text("#do-record"))
    hand.picture("stopped")
    hand.click("#do-record")
    hand.job_is("record", "done", seconds=100)
    record = read_record(inspection.file("record", "record.sqlite"))
    keys = list(zip(record.row.tolist(), record.point.tolist(), strict=True))
    assert len(keys) == len(set(keys)) > kept
    assert hand.js("return eddyscan.readings.count") == len(keys)


def results_and_report(hand: Hand, inspection: Inspection) -> None:
    hand.go(f"{NAME}/cscan")
    hand.click("#do-cscan")
    hand.job_is("cscan", "done", seconds=60)
    hand.wait(lambda: hand.js("return Boolean(eddyscan.room.picture.data.cscan)"))
    hand.go(f"{NAME}/report")
    hand.click("#do-report")
    hand.job_is("report", "done", seconds=90)
    hand.click("#open-report")
    link = hand.wait(lambda: hand.find("#report-link").get_attribute("href"))
    page = hand.driver.current_window_handle
    hand.driver.switch_to.new_window("tab")
    hand.driver.get(link)
    assert "eddyscan" in hand.driver.page_source.lower()
    hand.picture("report")
    hand.driver.close()
    for other in hand.driver.window_handles:
        if other != page:
            hand.driver.switch_to.window(other)
            hand.driver.close()
    hand.driver.switch_to.window(page)
