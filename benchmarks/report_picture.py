"""The picture of the report in the documentation: ``python -m benchmarks.report_picture REPORT.html``.

Opens a finished report in headless Chromium and keeps its head and its 3-D scene.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

from benchmarks.validation_page import PICTURES

WIDTH, HEIGHT = 1280, 4400
QUIET = ("--headless", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
ALONE = ("--hide-scrollbars", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-sync")


def screenshot(report: Path, target: Path) -> None:
    """Photograph the whole upper part of a report."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        raise SystemExit("No Chromium on the PATH.")
    with tempfile.TemporaryDirectory() as profile:
        own = (f"--user-data-dir={profile}", f"--window-size={WIDTH},{HEIGHT}", f"--screenshot={target}")
        command = [browser, *QUIET, *ALONE, "--virtual-time-budget=9000", *own, report.resolve().as_uri()]
        subprocess.run(command, check=True, capture_output=True, timeout=180)


def scene_rows(picture: Image.Image) -> tuple[int, int]:
    """Return where the 3-D scene begins and ends: the tallest framed box of the main column."""
    import numpy as np

    column = np.asarray(picture.convert("L"), dtype=int)[:, 295]
    framed = (column < 235) & (column > 200)
    best, start = (0, 0), None
    for y, on in enumerate([*framed, False]):
        if on and start is None:
            start = y
        elif not on and start is not None:
            best = max(best, (start, y), key=lambda span: span[1] - span[0])
            start = None
    return best


def main() -> None:
    """Make docs/pictures/report-page.png."""
    report = Path(sys.argv[1])
    with tempfile.TemporaryDirectory() as folder:
        screenshot(report, Path(folder) / "page.png")
        page = Image.open(Path(folder) / "page.png").convert("RGB")
    top, bottom = scene_rows(page)
    head, scene = page.crop((0, 0, WIDTH, 386)), page.crop((0, top - 102, WIDTH, bottom + 40))
    whole = Image.new("RGB", (WIDTH, head.height + scene.height), "white")
    whole.paste(head, (0, 0))
    whole.paste(scene, (0, head.height))
    small = whole.resize((960, round(whole.height * 960 / WIDTH)), Image.Resampling.LANCZOS)
    target = PICTURES / "report-page.png"
    target.parent.mkdir(parents=True, exist_ok=True)
    small.quantize(220, dither=Image.Dither.NONE).save(target, optimize=True)
    print(f"{target}: {small.width} x {small.height} px, {target.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
