"""A headless Chromium that can reach this computer only, and words for what a person does in it."""

from __future__ import annotations

import contextlib
import io
import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--force-prefers-reduced-motion",
    "--window-size=1500,980",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)
PICTURES = os.environ.get("EDDYSCAN_PICTURES")


def missing() -> str | None:
    """Return why there can be no browser here, or None."""
    absent = [name for name in ("chromium", "chromedriver") if shutil.which(name) is None]
    return f"not installed: {', '.join(absent)} (Debian: chromium, chromium-driver)" if absent else None


@contextlib.contextmanager
def chromium() -> Iterator[Any]:
    """Yield a driver; skip with the reason where Chromium is missing."""
    reason = missing()
    if reason:
        pytest.skip(reason)
    from selenium import webdriver
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service

    profile = tempfile.mkdtemp(prefix="eddyscan-chromium-")
    options = Options()
    options.binary_location = str(shutil.which("chromium"))
    for flag in (*FLAGS, f"--user-data-dir={profile}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"performance": "ALL", "browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(str(shutil.which("chromedriver"))))
    try:
        yield driver
    finally:
        driver.quit()
        shutil.rmtree(profile, ignore_errors=True)


class Hand:
    """A person at the page."""

    def __init__(self, driver: Any, address: str) -> None:
        self.driver = driver
        self.address = address
        self.refusals_expected = False

    def open(self, place: str = "") -> None:
        self.driver.get("about:blank")
        self.driver.get(self.address + (f"#/{place}" if place else ""))
        self.wait(lambda: self.js("return document.getElementById('wire').textContent.includes('connected')"))

    def go(self, place: str) -> None:
        self.js("location.hash = '#/' + arguments[0]", place)

    def js(self, script: str, *arguments: Any) -> Any:
        return self.driver.execute_script(script, *arguments)

    def find(self, css: str) -> Any:
        from selenium.webdriver.common.by import By

        self.wait(lambda: self.driver.find_elements(By.CSS_SELECTOR, css), what=css)
        return self.driver.find_element(By.CSS_SELECTOR, css)

    def click(self, css: str) -> None:
        self.wait(lambda: self.find(css).is_enabled() and self.find(css).is_displayed(), what=f"{css} enabled")
        self.find(css).click()

    def type(self, css: str, text: str) -> None:
        field = self.find(css)
        field.clear()
        field.send_keys(text)

    def text(self, css: str) -> str:
        return str(self.find(css).text)

    def press(self, key: str) -> None:
        from selenium.webdriver.common.action_chains import ActionChains

        ActionChains(self.driver).send_keys(key).perform()

    def drag(self, css: str, start: tuple[float, float], by: tuple[float, float]) -> None:
        """Drag from `start` [px from the element's corner]."""
        from selenium.webdriver.common.action_chains import ActionChains

        element = self.find(css)
        size = element.size
        x, y = start[0] - size["width"] / 2, start[1] - size["height"] / 2
        chain = ActionChains(self.driver, duration=60)
        chain.move_to_element_with_offset(element, round(x), round(y)).click_and_hold()
        for _ in range(4):
            chain.move_by_offset(round(by[0] / 4), round(by[1] / 4))
        chain.release().perform()

    def wait(self, good: Callable[[], Any], seconds: float = 20.0, what: Any = "") -> Any:
        from selenium.common.exceptions import JavascriptException, StaleElementReferenceException

        until = time.monotonic() + seconds
        while time.monotonic() < until:
            with contextlib.suppress(StaleElementReferenceException, JavascriptException):
                if value := good():
                    return value
            time.sleep(0.05)
        complaint = f"not within {seconds} s: {what() if callable(what) else what or good}; says: {self.messages()}"
        if PICTURES:
            self.driver.save_screenshot("/tmp/page-failed.png")
        raise AssertionError(complaint)

    def messages(self) -> str:
        return str(self.js("return document.getElementById('messages')?.textContent || ''"))

    def job(self) -> dict[str, Any]:
        return dict(self.js("return eddyscan.job || {}"))

    def job_is(self, step: str, *states: str, seconds: float = 20.0) -> None:
        def there() -> bool:
            job = self.job()
            if job.get("step") == step and job.get("state") == "failed" and "failed" not in states:
                raise AssertionError(f"{step} failed: {job.get('message')}")
            return job.get("step") == step and job.get("state") in states

        self.wait(there, seconds, lambda: f"{step} {states}; is {self.job()}")

    def picture(self, name: str) -> None:
        """Keep a screenshot for the walk-through when EDDYSCAN_PICTURES names a folder."""
        if not PICTURES:
            return
        from PIL import Image

        self.js("document.querySelectorAll('.message').forEach((note) => note.remove())")
        time.sleep(0.4)
        shot = Image.open(io.BytesIO(self.driver.get_screenshot_as_png())).convert("RGB")
        shot.quantize(160).save(Path(PICTURES) / f"page-{name}.png", optimize=True)

    def requests(self) -> list[str]:
        """Return the address of every request since the last call."""
        found = []
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                found.append(message["params"]["request"]["url"])
            elif message["method"] == "Network.webSocketCreated":
                found.append(message["params"]["url"])
        return found

    def complaints(self) -> list[str]:
        """Return what the browser's console complained about, drawing speed aside."""
        quiet = ["GPU stall", "GL Driver Message", "software WebGL", "Canvas2D: Multiple readback"]
        quiet += ["status of 400", "status of 409"] if self.refusals_expected else []
        said = [str(entry["message"]) for entry in self.driver.get_log("browser")]
        return [line for line in said if not any(word in line for word in quiet)]
