"""How fast and how true records are written and read: ``python -m benchmarks.record_files [DATA]``.

DATA holds the real scan ``ect_cscan_brisect``; without it that part is left out.
Seed 7. Writes its section of docs/validation.md and docs/pictures/report-real-scan.png.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image

from benchmarks.validation_page import PICTURES, write_section
from eddyscan.core.frames import ComplexArray
from eddyscan.core.record import Reading, ScanRecord
from eddyscan.formats.record_csv_import import csv_channels
from eddyscan.formats.record_hdf5 import read_hdf5
from eddyscan.formats.record_nde import read_nde
from eddyscan.formats.records import RECORD_FORMATS, SqliteRecord, export_record, read_record, read_record_csv

READINGS, COMMITS, SEED = 25_921, 1000, 7
READERS = {"csv": read_record_csv, "nde": read_nde, "hdf5": lambda path: read_hdf5(path).record}


def readings(count: int) -> list[Reading]:
    """Return readings of a 161 x 161 grid with noise."""
    rng = np.random.default_rng(SEED)
    noise = rng.normal(size=(count, 5))
    return [
        Reading(
            row=k // 161,
            point=k % 161,
            time_s=0.05 * k,
            stage_mm=(k % 161 + 1e-3 * n[0], k // 161 + 1e-3 * n[1], 20 + 1e-3 * n[2]),
            frequency_hz=5e5,
            impedance_ohm=complex(2 + 0.01 * n[3], 40 + 0.01 * n[4]),
            flag=0,
            target_mm=(k % 161, k // 161, 20.0),
        )
        for k, n in enumerate(noise)
    ]


def commit_times_ms(folder: Path) -> np.ndarray:
    """Return how long each durable one-reading write took [ms]."""
    taken = []
    with SqliteRecord(folder / "one-by-one.sqlite") as sink:
        for reading in readings(COMMITS):
            began = time.perf_counter()
            sink.write([reading])
            taken.append(1e3 * (time.perf_counter() - began))
    return np.array(taken)


def format_lines(folder: Path) -> list[str]:
    """Write the record in every format, read it back, and compare bit for bit."""
    path = folder / "record.sqlite"
    with SqliteRecord(path) as sink:
        sink.note("T_stage_part", np.eye(4))
        sink.write(readings(READINGS))
    began = time.process_time()
    record = read_record(path)
    lines = [f"| sqlite | {path.stat().st_size / 1e6:.2f} | - | {time.process_time() - began:.2f} | yes |"]
    for name in RECORD_FORMATS:
        target = folder / f"record.{name}"
        began = time.process_time()
        export_record(record, name, target)
        written, back, same = time.process_time() - began, "-", "-"
        if name in READERS:
            began = time.process_time()
            again = READERS[name](target)
            back, same = f"{time.process_time() - began:.2f}", "yes" if identical(record, again) else "NO"
        lines.append(f"| {name} | {target.stat().st_size / 1e6:.2f} | {written:.2f} | {back} | {same} |")
    return lines


def identical(given: ScanRecord, back: ScanRecord) -> bool:
    """Tell whether every raw value came back bit for bit."""
    return all(
        np.array_equal(getattr(given, name), getattr(back, name))
        for name in ("row", "point", "time_s", "stage_mm", "frequency_hz", "impedance_ohm", "flag")
    )


def split(z: ComplexArray) -> tuple[np.ndarray, float]:
    """Cut readings in two along their widest direction (Otsu 1979); return the mask and the separation.

    The separation is the distance of the two medians over the robust scatter of the tighter group.
    """
    centred = z - z.mean()
    direction = np.exp(0.5j * np.angle((centred**2).mean()))
    along = (centred * np.conj(direction)).real
    edges = np.histogram_bin_edges(along, bins=256)
    between = [
        (along < edge).mean() * (along >= edge).mean() * (along[along < edge].mean() - along[along >= edge].mean()) ** 2
        for edge in edges[1:-1]
    ]
    low = along < edges[1:-1][int(np.argmax(between))]
    scatter = min(1.4826 * np.median(np.abs(along[m] - np.median(along[m]))) for m in (low, ~low))
    return low, float(abs(np.median(along[low]) - np.median(along[~low])) / scatter)


def real_lines(data: Path) -> list[str]:
    """Read the real scan, tell plate from air at each frequency, and draw it."""
    path = data / "ect_cscan_brisect" / "CoarseScanMultiFreq.csv"
    records = {name: read_record_csv(path, channel=name) for name in csv_channels(path)}
    draw(records)
    lines = []
    for record in records.values():
        low, apart = split(record.impedance_ohm)
        share = 100 * max(low.mean(), 1 - low.mean())
        mhz, rows = record.frequency_hz[0] / 1e6, record.row.max() + 1
        lines.append(f"| {mhz:.0f} | {len(record)} | {rows} | {share:.0f} | {apart:.0f} |")
    return lines


def draw(records: dict[str, ScanRecord]) -> None:
    """Draw the magnitude at every frequency where it was read."""
    from eddyscan.report.figures_signal import readings_figure
    from eddyscan.report.theme import PAPER, drawn

    first = next(iter(records.values()))
    maps = {
        f"|Z| at {r.frequency_hz[0] / 1e6:.0f} MHz [units of the file]": np.abs(r.impedance_ohm)
        for r in records.values()
    }
    figure = drawn(lambda theme: readings_figure(first, maps, theme), PAPER)
    figure.set_facecolor("white")
    target = PICTURES / "report-real-scan.png"
    figure.savefig(target, dpi=110)
    Image.open(target).convert("RGB").quantize(128, dither=Image.Dither.NONE).save(target, optimize=True)


def main() -> None:
    """Measure, print, and write the section."""
    data = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("../shared/data")
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as folder:
        taken = commit_times_ms(Path(folder))
        formats = format_lines(Path(folder))
    low, middle, high = np.percentile(taken, (5, 50, 99))
    body = [
        f"`python -m benchmarks.record_files`, seed {SEED}.",
        "",
        f"One reading, on the disk before `write()` returns, over {COMMITS} commits on a shared machine: "
        f"median {middle:.2f} ms, 5 % {low:.2f} ms, 99 % {high:.1f} ms.",
        "",
        f"| {READINGS} readings as | MB | written [CPU s] | read back [CPU s] | bit for bit |",
        "|---|---|---|---|---|",
        *formats,
    ]
    if (data / "ect_cscan_brisect").is_dir():
        body += [
            "",
            "A real scan made elsewhere (UNDT lab, MIT licence), read as CSV, plate told from air by Otsu's cut; "
            "separation in robust standard deviations of the tighter group:",
            "",
            "| MHz | readings | rows found | larger group [%] | separation |",
            "|---|---|---|---|---|",
            *real_lines(data),
            "",
            "![The real scan as read](pictures/report-real-scan.png)",
        ]
    print("\n".join(body))
    write_section("record-files", "Record files", "\n".join(body))


if __name__ == "__main__":
    main()
