"""Chapters about the signal: reference checks, maps, coverage as examined, indications."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from eddyscan.core.indication import Indication
from eddyscan.core.plan import Uncovered
from eddyscan.report.blocks import Block, Chart, Facts, Note, Section, Table
from eddyscan.report.content import ReportContent
from eddyscan.report.figures_coverage import coverage_figure, examined_share, share_texts
from eddyscan.report.figures_indication import indication_figure
from eddyscan.report.figures_signal import (
    cscan_figure,
    lift_off_figure,
    plane_figure,
    reading_maps,
    readings_figure,
    strip_figure,
)
from eddyscan.report.tables import as_entries, facts_of, table_of
from eddyscan.report.words import MISSING, number, percent, plus_minus

NO_SCAN = Note("Nothing was scanned.", "missing")


def references(content: ReportContent) -> Section:
    """Show the responses of the reference block before and after the scan."""
    entries = reference_entries(content)
    if not entries:
        text = "No reference check is recorded, so amplitudes are not related to a reference notch."
        return Section("references", "Reference checks", "", (Note(text, "missing"),))
    blocks: list[Block] = [table_of(entries, "Responses of the reference block, before and after")]
    failed = sum(entry.get("passed") is False for entry in entries)
    if failed:
        text = (
            f"{failed} of {len(entries)} reference checks failed: "
            "what was scanned since the last good one counts as not examined."
        )
        blocks.append(Note(text, "warning"))
    return Section("references", "Reference checks", "", tuple(blocks))


def reference_entries(content: ReportContent) -> list[dict[str, Any]]:
    """Return what the record noted of its runs over the reference block, in order."""
    return [] if content.record is None else as_entries(content.record.meta.get("references"))


def reference_amplitude(entries: Sequence[Mapping[str, Any]]) -> tuple[float, str] | None:
    """Return amplitude [ohm] and name of the first reference notch, or None when no check states one."""
    for entry in entries:
        milli = entry.get("amplitude_mohm")
        amplitude = entry.get("amplitude_ohm", None if milli is None else 1e-3 * milli)
        if amplitude:
            depth = entry.get("notch_depth_mm")
            return float(amplitude), "the reference notch" if depth is None else f"the {depth:g} mm reference notch"
    return None


def signals(content: ReportContent) -> Section:
    """Show the raw signals and the mapped channels."""
    record = content.record
    if record is None or len(record) == 0:
        return Section("signals", "Signals", "", (NO_SCAN,))
    maps = reading_maps(record, content.residual_ohm, content.lift_off_mm)
    flagged = int((record.flag != 0).sum())
    lead = f"{len(record)} readings at {number(float(np.median(record.frequency_hz)) / 1000)} kHz, {flagged} flagged."
    blocks: list[Block] = [Chart(partial(readings_figure, record, maps), "Every reading where it was taken.")]
    if content.cscan is not None and content.cscan.channels:
        names = list(content.cscan.channels)
        blocks.append(Chart(partial(cscan_figure, content.cscan, names), "C-scan on the surface, seen from above."))
    if content.lift_off_mm is not None and np.isfinite(content.lift_off_mm).any():
        target = content.technique.scan.lift_off_mm
        draw = partial(lift_off_figure, content.lift_off_mm, content.coarse_lift_off_mm, target)
        blocks.append(Chart(draw, "Actual lift-off, told by the probe.", half=True))
    blocks.append(Chart(partial(plane_figure, record, content.lift_off_mm), "Raw impedance, unrotated.", half=True))
    blocks.append(Chart(partial(strip_figure, record, content.residual_ohm), "Raw signals over time."))
    if content.statistics:
        blocks.append(facts_of(content.statistics, "Statistics of the analysis", wide=True))
    return Section("signals", "Signals and maps", lead, tuple(blocks))


def coverage(content: ReportContent) -> Section:
    """Show what was examined, and list what was not and why."""
    blocks: list[Block] = []
    if content.cscan is not None:
        limit = content.technique.analysis.lift_off_max_mm
        text = f"Examined: a reading within {limit:g} mm lift-off speaks for the spot."
        blocks += [Chart(partial(coverage_figure, content.cscan), text, half=True), _examined_facts(content)]
    else:
        blocks.append(Note("No C-scan, so nothing can be called examined.", "missing"))
    planned = () if content.plan is None else content.plan.coverage.uncovered
    left_out = [("planning", spot) for spot in planned] + [("examination", spot) for spot in content.not_examined]
    if left_out:
        blocks.append(_uncovered_table(left_out))
    elif content.plan is not None:
        blocks.append(Note("The plan leaves out nothing inside the margin.", "good"))
    return Section("coverage", "Examined, and what was not covered", "", tuple(blocks))


def _examined_facts(content: ReportContent) -> Facts:
    assert content.cscan is not None
    share, area = examined_share(content.cscan), content.cscan.mesh.area_mm2 / 100
    examined, rest = share_texts(share)
    rows = [
        ("whole surface", f"{area:.1f} cm²"),
        ("examined", f"{examined}, {share * area:.1f} cm²"),
        ("not examined", f"{rest}, {(1 - share) * area:.1f} cm²"),
    ]
    if content.plan is not None:
        rows.append(("planned, inside the margin", percent(content.plan.coverage.swept)))
    rows.append(("margin left at the edge", f"{content.technique.plan.margin_mm:g} mm by the technique"))
    return Facts(tuple(rows), "Coverage")


def _uncovered_table(left_out: Sequence[tuple[str, Uncovered]]) -> Table:
    rows = []
    for found_in, spot in sorted(left_out, key=lambda entry: -entry[1].area_mm2):
        centre = MISSING if spot.centre_mm is None else ", ".join(f"{v:.1f}" for v in spot.centre_mm)
        rows.append((spot.reason, f"{spot.area_mm2:.1f}", centre, found_in))
    columns = ("reason", "area [mm²]", "centre x, y, z [mm]", "found in")
    return Table(columns, tuple(rows), "Not covered, and why", frozenset({0, 3}))


def indications(content: ReportContent) -> Section:
    """List every indication, then show each by itself."""
    title = "Indications"
    if content.indications is None:
        return Section("indications", title, "", (Note("The signals were not analysed for indications.", "missing"),))
    level = content.technique.analysis.threshold_mad
    lead = f"Called where the residual exceeds {level:g} robust standard deviations of itself over the part."
    if content.record is not None:
        lead += f" {false_call_basis(level, len(content.record))}"
    if not content.indications:
        return Section("indications", title, lead, (Note("No indication in the examined area.", "good"),))
    blocks: list[Block] = [indication_table(content.indications, reference_amplitude(reference_entries(content)))]
    if content.record is not None and len(content.record):
        for one in content.indications:
            x, y, z = one.centre_mm
            caption = (
                f"Indication {one.number} at x {x:.1f}, y {y:.1f}, z {z:.1f} mm. The middle row is drawn strong in the "
                "impedance plane; amplitudes and phases in the table stay unrotated."
            )
            blocks.append(Chart(partial(indication_figure, content, one), caption))
    return Section("indications", title, lead, tuple(blocks))


def false_call_basis(level: float, readings: int) -> str:
    """Say how many false calls Gaussian noise alone would give."""
    expected = readings * math.erfc(level / math.sqrt(2.0))
    return f"Gaussian noise alone would cross that level {number(expected, 2)} times in {readings} readings."


def indication_table(found: Sequence[Indication], reference: tuple[float, str] | None = None) -> Table:
    """Return the table an auditor expects, one line per indication; dB against the reference notch when it is known."""
    rows = tuple(
        (
            str(one.number),
            *(f"{v:.1f}" for v in one.centre_mm),
            f"{one.extent_mm:.1f}",
            f"{one.angle_deg:.0f}",
            number(1000 * one.amplitude_ohm),
            *(
                []
                if reference is None
                else [f"{20 * math.log10(one.amplitude_ohm / reference[0]):+.1f}".replace("-", "−")]
            ),
            f"{one.phase_deg:.0f}",
            f"{one.snr:.1f}",
            plus_minus(one.length_mm, one.length_uncertainty_mm),
            plus_minus(one.depth_mm, one.depth_uncertainty_mm),
            one.classification,
        )
        for one in found
    )
    columns = (
        "no.",
        "x [mm]",
        "y [mm]",
        "z [mm]",
        "extent [mm]",
        "angle [°]",
        "amplitude [mΩ]",
        *([] if reference is None else ["re notch [dB]"]),
        "phase [°]",
        "SNR",
        "length [mm]",
        "depth [mm]",
        "class",
    )
    title = "Indications, part frame" + ("" if reference is None else f"; dB re {reference[1]}")
    return Table(columns, rows, title, frozenset({len(columns) - 1}))
