"""The page in a real browser: it draws the scene and asks nobody for anything."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from example_inspection import small_inspection

from eddyscan.report import render_html

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
QUIET = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--host-resolver-rules=MAP * ~NOTFOUND",
)


def opened(html: str, folder: Path) -> tuple[str, set[str]]:
    """Return the finished document and the hosts it asked, the browser's own calls home left out."""
    assert CHROMIUM is not None
    page, log = folder / "report.html", folder / "net.json"
    page.write_text(html, encoding="utf-8")
    own = (f"--user-data-dir={folder / 'profile'}", f"--log-net-log={log}", "--virtual-time-budget=8000", "--dump-dom")
    seen = subprocess.run(
        [CHROMIUM, *QUIET, *own, page.as_uri()], capture_output=True, text=True, timeout=110, check=True
    )
    events = json.loads(log.read_text(encoding="utf-8"))["events"]
    asked = [urlsplit(event["params"]["url"]) for event in events if "url" in event.get("params", {})]
    hosts = {url.hostname or "" for url in asked if url.scheme in ("http", "https", "ws", "wss")}
    return seen.stdout, {
        host for host in hosts if not host.endswith((".google.com", ".googleapis.com", ".gstatic.com"))
    }


needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this computer")


@pytest.mark.browser
@needs_browser
def test_the_page_draws_its_scene_and_asks_nobody(tmp_path: Path) -> None:
    html = render_html(small_inspection())
    assert "google" not in html
    document, hosts = opened(html, tmp_path)
    assert "js-plotly-plot" in document
    assert 'class="live" hidden' not in document
    assert hosts == set()


@pytest.mark.browser
@needs_browser
def test_a_page_that_asked_would_be_seen(tmp_path: Path) -> None:
    _, hosts = opened('<img src="http://outside.invalid/x.png">', tmp_path)
    assert hosts == {"outside.invalid"}
