"""Chapters about the path: the plan, and where the stage really was."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from eddyscan.core.plan import Coverage, ScanPlan
from eddyscan.report.blocks import Block, Chart, Facts, Note, Section, Table
from eddyscan.report.content import ReportContent
from eddyscan.report.figures_plan import path_figure, predicted_figure
from eddyscan.report.figures_position import axis_errors, error_figure, longest_row, position_figure
from eddyscan.report.tables import facts_of
from eddyscan.report.words import number, percent


def plan(content: ReportContent) -> Section:
    """Show the planned path, its coverage, and the lift-off and tilt it predicts."""
    if content.plan is None:
        return Section("plan", "Scan plan", "", (Note("No plan was made.", "missing"),))
    planned = content.plan
    lead = f"{planned.n_scan} readings in {planned.n_rows} rows, {_clock(planned.duration_s)} planned."
    target = content.technique.scan.lift_off_mm
    blocks: list[Block] = [
        Chart(partial(path_figure, planned, content.mesh), "The path from above, coloured in visiting order."),
        _coverage_facts(planned.coverage),
        _pose_facts(planned),
        Chart(partial(predicted_figure, planned, target), "What the plan predicts for every reading."),
    ]
    if planned.notes:
        blocks.append(Note("Notes of the planner: " + " ".join(planned.notes), "plain"))
    return Section("plan", "Scan plan", lead, tuple(blocks))


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes else f"{seconds:.1f} s"


def _coverage_facts(coverage: Coverage) -> Facts:
    return Facts(
        (
            ("swept, of the region inside the margin", percent(coverage.swept)),
            ("largest gap to the path", f"{coverage.largest_gap_mm:.2f} mm"),
            ("swept width used for the check", f"{coverage.footprint_mm:.2f} mm"),
            ("point distance, least / mean / largest", _triple(coverage.spacing_mm)),
            ("row distance, least / mean / largest", _triple(coverage.row_distance_mm)),
        ),
        "Plan coverage, checked independently of the planner",
    )


def _triple(values: tuple[float, float, float]) -> str:
    return " / ".join(f"{value:.3f}" for value in values) + " mm"


def _pose_facts(planned: ScanPlan) -> Facts:
    scan = planned.is_scan
    rows = []
    for name, unit, values in (
        ("lift-off", "mm", planned.lift_off_mm[scan]),
        ("tilt", "°", planned.tilt_deg[scan]),
        ("speed", "mm/s", planned.speed_mm_s[scan]),
    ):
        texts = " / ".join(number(float(v), 3) for v in (values.min(), values.mean(), values.max()))
        rows.append((f"{name}, least / mean / largest", f"{texts} {unit}"))
    rows.append(("lift-off, standard deviation", f"{1000 * planned.lift_off_mm[scan].std():.1f} µm"))
    return Facts(tuple(rows), "Predicted for the readings")


def alignment(content: ReportContent) -> Section | None:
    """Say how the part was found on the stage and what the coil read in air."""
    if content.record is None:
        return None
    meta = content.record.meta
    details = meta.get("alignment")
    if not isinstance(details, Mapping):
        text = "The record does not say how the part was found on the stage."
        return Section("alignment", "Part on the stage", "", (Note(text, "missing"), _pose_table(meta)))
    plain = {key: value for key, value in details.items() if not key.startswith("T_")}
    return Section("alignment", "Part on the stage", "", (facts_of(plain, "Alignment", wide=True), _pose_table(meta)))


def _pose_table(meta: Mapping[str, Any]) -> Table:
    """Return T_stage_part as a table an auditor can type in again."""
    rows = tuple(tuple(f"{value:.6f}".replace("-", "−") for value in row) for row in meta["T_stage_part"])
    title = "Pose of the part on the stage: T_stage_part [rotation, mm]"
    return Table(("x part", "y part", "z part", "origin [mm]"), rows, title, frozenset())


def positions(content: ReportContent) -> Section:
    """Compare planned and recorded axis positions."""
    title = "Planned and recorded positions"
    if content.record is None or len(content.record) == 0:
        return Section("positions", title, "", (Note("Nothing was scanned, so no positions are recorded.", "missing"),))
    record = content.record
    errors = axis_errors(record)
    rows = tuple(
        (
            f"{e.axis} stage",
            str(e.readings),
            f"{e.mean_um:+.3f}".replace("-", "−"),
            f"{e.std_um:.3f}",
            f"{e.largest_um:.3f}",
        )
        for e in errors
    )
    columns = ("axis", "readings", "mean error [µm]", "standard deviation [µm]", "largest [µm]")
    if not errors:
        return Section("positions", title, "", (Note("The record holds no axis positions.", "missing"),))
    return Section(
        "positions",
        title,
        "Recorded minus planned axis position after every move, as the stage itself reports it.",
        (
            Chart(
                partial(position_figure, record),
                f"Left: row {longest_row(record)} in x and z. Right: x and y.",
            ),
            Table(columns, rows, "Position error per axis"),
            Chart(partial(error_figure, record), "Position errors per axis; the line marks the mean."),
        ),
    )
