"""Chapters about what was asked for: result, part and procedure, equipment."""

from __future__ import annotations

from typing import Any

from eddyscan.report.blocks import Block, Note, Section
from eddyscan.report.content import ReportContent
from eddyscan.report.headline import gap_between_readings_mm
from eddyscan.report.tables import as_entries, facts_of, settings_facts, table_of

DEVICES = ("stage", "instrument", "camera")


def result(content: ReportContent) -> Section:
    """State what limits the verdict: simulation, deviations from the procedure, warnings."""
    blocks: list[Block] = []
    if content.simulated:
        blocks.append(
            Note(
                "Simulation: every picture, position and signal came from the virtual cell, none from a part.",
                "warning",
            )
        )
    if content.deviations:
        blocks.extend(Note(f"Deviation from the procedure: {text}", "warning") for text in content.deviations)
    elif content.record is not None:
        blocks.append(Note("No deviation from the procedure was recorded.", "plain"))
    gap, coil = gap_between_readings_mm(content), 2 * content.technique.probe.outer_radius_mm
    if gap is not None and content.record is not None:
        text = (
            f"Readings stand up to {gap:g} mm apart, the coil is {coil:g} mm wide: a flaw between them gives no signal."
        )
        blocks.append(Note(text, "warning"))
    blocks.extend(Note(text, "warning") for text in content.notes)
    return Section("result", "Result", "", tuple(blocks))


def procedure(content: ReportContent) -> Section:
    """Name the part, the document and the people."""
    technique = content.technique
    return Section(
        "procedure",
        "Part and procedure",
        "",
        (
            settings_facts(technique.part, "Part"),
            settings_facts(technique.procedure, "Procedure"),
        ),
    )


def equipment(content: ReportContent) -> Section:
    """Name the devices and the settings, as the technique fixes them and as they were applied."""
    technique = content.technique
    meta = {} if content.record is None else content.record.meta
    blocks: list[Block] = [*_devices(meta)]
    blocks += [
        settings_facts(technique.probe, "Probe"),
        settings_facts(technique.drive, "Operating point"),
        settings_facts(technique.plan, "Scan pattern"),
        settings_facts(technique.scan, "Motion and reading"),
        settings_facts(technique.analysis, "Analysis"),
    ]
    if isinstance(meta.get("settings"), dict):
        blocks.append(facts_of(meta["settings"], "As applied by the devices"))
    return Section("equipment", "Equipment and settings", "", tuple(blocks))


def _devices(meta: dict[str, Any]) -> list[Block]:
    """Return the tables of devices and axes a record names."""
    entries = as_entries(meta.get("devices"))
    entries += [meta[kind] for kind in DEVICES if isinstance(meta.get(kind), dict)]
    if not entries:
        return [Note("No device identities: nothing was scanned, or the record holds none.", "missing")]
    blocks: list[Block] = [table_of([_identity(entry) for entry in entries], "Devices as they identified themselves")]
    axes = as_entries(meta.get("axes"))
    if axes:
        blocks.append(table_of([_axis(axis) for axis in axes], "Axes as they reported themselves"))
    return blocks


def _identity(device: dict[str, Any]) -> dict[str, Any]:
    """Keep who it is, and say in words whether the driver was ever run on hardware."""
    kept = {key: value for key, value in device.items() if key not in ("settings", "name", "verified")}
    if "verified" in device:
        kept["driver"] = "verified on hardware" if device["verified"] else "not verified on hardware"
    return kept


def _axis(axis: dict[str, Any]) -> dict[str, Any]:
    """Put the unit of an axis into the names of its values."""
    unit = str(axis.get("unit", "mm"))
    named = {"lower": unit, "upper": unit, "resolution": unit, "max_speed": f"{unit}/s", "acceleration": f"{unit}/s²"}
    return {f"{key} [{named[key]}]" if key in named else key: value for key, value in axis.items() if key != "unit"}
