"""The page in a real browser on a stand-in for the line: buttons, keys, two browsers, decisions, comparison."""

from __future__ import annotations

import time

import pytest
from selenium.webdriver.common.keys import Keys

from eddyscan.web.decisions import decisions
from tests.web.browser import Hand, chromium
from tests.web.shelf_on_disk import analysed_inspection, behave

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def driver():
    with chromium() as made:
        yield made


@pytest.fixture
def hand(driver, served):
    driver.get("about:blank")
    driver.get_log("browser")
    made = Hand(driver, served.running.address)
    yield made
    complaints = made.complaints()
    driver.get("about:blank")
    assert complaints == []


def count(hand: Hand) -> int:
    return int(hand.js("return eddyscan.readings.count"))


def test_hundred_clicks_on_every_button_of_every_step(hand, inspection):
    hand.refusals_expected = True
    behave(inspection, ticks=2, tick_s=0.01)
    hand.open("plate-1/plan")
    for step in ("views", "surface", "plan", "align", "cscan", "report"):
        hand.go(f"plate-1/{step}")
        hand.find(f"[data-step='{step}'][aria-current]")
        hand.js(
            "for (let k = 0; k < 100; k++) document.querySelectorAll('#main button:not(.pick), #theme')"
            ".forEach((b) => { if (!['Open', 'Choose files'].includes(b.textContent)) b.click(); });"
        )
        hand.wait(lambda: not hand.js("return eddyscan.running"))
    hand.js("document.querySelectorAll('.message').forEach((note) => note.remove())")
    hand.go("plate-1/plan")
    hand.wait(lambda: hand.js("return document.querySelectorAll('#steps .step').length") == 7)
    assert hand.js("return document.querySelectorAll('.viewer canvas').length") == 1


def test_escape_stops_while_typing_and_two_browsers_see_it(hand, served, inspection):
    behave(inspection, interval_s=0.1)
    hand.open("plate-1/record")
    with chromium() as second:
        other = Hand(second, served.door.access.address("viewer"))
        other.open("plate-1/record")
        assert "READ-ONLY" in other.text("#badges")
        assert not second.find_elements("css selector", "#do-record")
        hand.click("#do-record")
        other.wait(lambda: count(other) > 5)
        hand.go("plate-1/plan")
        hand.find("[id='plan.pitch_mm']").send_keys("7", Keys.ESCAPE)
        hand.job_is("record", "stopped")
        other.job_is("record", "stopped")
        assert count(other) < 100
        hand.go("plate-1/record")
        hand.click("#do-record")
        other.job_is("record", "running")
        hand.wait(lambda: count(hand) > 20)
        other.click("#stop")
        hand.job_is("record", "stopped")


def test_pause_by_key_and_page_closed_in_the_middle_loses_nothing(hand, inspection):
    behave(inspection, interval_s=0.03)
    hand.open("plate-1/record")
    hand.click("#do-record")
    hand.wait(lambda: count(hand) > 5)
    hand.js("document.activeElement.blur()")
    hand.press("p")
    hand.job_is("record", "paused")
    held = count(hand)
    hand.open("plate-1/record")
    hand.wait(lambda: count(hand) >= held)
    hand.press("p")
    hand.job_is("record", "done")
    hand.wait(lambda: count(hand) == 100)


def test_indication_is_shown_in_list_picture_chart_and_plane_and_decided(hand, inspection):
    analysed = analysed_inspection(inspection.folder.parent / "plate-2")
    hand.open("plate-2/cscan")
    hand.wait(lambda: hand.js("return Boolean(eddyscan.room.picture.data.cscan) && eddyscan.readings.count") == 100)
    x, y, _ = hand.js("const v = eddyscan.room.picture.viewer; v.draw(); return v.onScreen([160, 70, 30])")
    hand.drag("#picture canvas", (x, y), (0, 0))
    hand.wait(lambda: "Indication 2" in hand.text("#details"))
    hand.click("#indication-1")
    hand.wait(lambda: "Indication 1" in hand.text("#details"))
    assert hand.js("return eddyscan.room.picture.viewer.has('here')")
    marked = hand.js("return eddyscan.readings.near([100, 50, 30], 6)")
    assert marked
    hand.type("#who", "")
    hand.click("#decide-accept")
    hand.wait(lambda: "needs the name of the person" in hand.messages())
    hand.refusals_expected = True
    hand.type("#who", "A. Person")
    hand.type("#comment", "scratch, seen by eye")
    hand.picture("results")
    hand.click("#decide-reject")
    hand.wait(lambda: "rejected" in hand.text(".called"))
    (made,) = decisions(analysed)
    assert (made["number"], made["verdict"], made["name"]) == (1, "reject", "A. Person")
    hand.open("plate-2/cscan")
    hand.wait(lambda: "1 to decide" in hand.text("#steps"))


def test_two_inspections_side_by_side_and_found_by_search(hand, inspection):
    root = inspection.folder.parent
    analysed_inspection(root / "plate-2")
    analysed_inspection(root / "plate-3")
    hand.open()
    hand.type("#search", "plate-3")
    hand.wait(lambda: hand.js("return document.querySelectorAll('.shelf tbody tr').length") == 1)
    hand.picture("list")
    hand.click(".shelf tbody button")
    hand.find("[data-step='cscan']")
    hand.go("plate-3/report")
    hand.wait(lambda: hand.js("return document.querySelectorAll('#compare-with option').length") == 2)
    hand.click("#compare")
    hand.wait(lambda: hand.js("return document.querySelectorAll('.viewer canvas').length") == 2)
    hand.wait(lambda: "indications" in hand.text("#details"))
    hand.picture("compare")
    hand.go("plate-3/cscan")
    hand.wait(lambda: hand.js("return document.querySelectorAll('.viewer canvas').length") == 1)


def test_empty_and_error_states_say_what_to_do(hand, inspection):
    behave(inspection, refuse=True)
    hand.open("plate-1/cscan")
    hand.wait(lambda: "After the scan" in hand.text("#details"))
    hand.go("plate-1/plan")
    hand.click("#do-plan")
    hand.wait(lambda: "Lower the pitch" in hand.messages())


def test_everything_is_reached_by_keyboard_in_both_themes(hand):
    hand.open("plate-1/plan")
    hand.find("#do-plan")
    seen = set()
    for _ in range(60):
        hand.press(Keys.TAB)
        seen.add(hand.js("const a = document.activeElement; return a.id || a.dataset.step || a.tagName"))
    assert {"home", "theme", "stop", "views", "surface", "plan", "record", "do-plan", "CANVAS", "dry-run"} <= seen
    before = hand.js("return eddyscan.room.picture.viewer.camera.yaw")
    hand.js("document.querySelector('.viewer canvas').focus()")
    hand.press(Keys.ARROW_LEFT)
    assert hand.js("return eddyscan.room.picture.viewer.camera.yaw") != before
    for theme in ("dark", "light"):
        hand.js("eddyscan.theme(arguments[0])", theme)
        time.sleep(0.1)
        assert least_contrast(hand) >= 4.5


def least_contrast(hand: Hand) -> float:
    """Return the least contrast of text against its card (WCAG 2.2, 1.4.3)."""
    return float(
        hand.js(
            """
            const light = (c) => { const [r, g, b] = c.map((v) => { v /= 255;
              return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4; });
              return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
            const of = (text) => (text.match(/[\\d.]+/g) || []).slice(0, 4).map(Number);
            const behind = (e) => { for (; e; e = e.parentElement) { const c = of(getComputedStyle(e).backgroundColor);
              if (c.length === 3 || c[3] > 0.9) return c.slice(0, 3); } return [255, 255, 255]; };
            return Math.min(...[...document.querySelectorAll(arguments[0])]
              .filter((e) => e.offsetParent && !e.disabled && e.textContent.trim())
              .map((e) => { const pair = [light(of(getComputedStyle(e).color)), light(behind(e))];
                const [a, b] = pair.sort((p, q) => q - p);
                return (a + 0.05) / (b + 0.05); }));
            """,
            "#steps, #details, #top, #bottom, h2, td, .quiet, .warning, button",
        )
    )
