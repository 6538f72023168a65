"""Chapters about what was asked for: result, part and procedure, equipment."""

from __future__ import annotations

from eddyscan.report.blocks import Block, Facts, Note, Section
from eddyscan.report.content import ReportContent
from eddyscan.report.tables import as_entries, settings_facts, table_of


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
    blocks: list[Block] = []
    devices = as_entries(meta.get("devices"))
    if devices:
        blocks.append(table_of([_flat(device) for device in devices], "Devices as they identified themselves"))
    else:
        blocks.append(Note("No device identities: nothing was scanned, or the record holds none.", "missing"))
    blocks += [
        settings_facts(technique.probe, "Probe"),
        settings_facts(technique.drive, "Operating point"),
        settings_facts(technique.plan, "Scan pattern"),
        settings_facts(technique.scan, "Motion and reading"),
        settings_facts(technique.analysis, "Analysis"),
    ]
    applied = meta.get("settings")
    if isinstance(applied, dict) and "probe" not in applied:
        blocks.append(_applied(applied))
    return Section("equipment", "Equipment and settings", "", tuple(blocks))


def _flat(device: dict[str, object]) -> dict[str, object]:
    """Drop a device's long settings list and say in words whether it was verified on hardware."""
    kept = {key: value for key, value in device.items() if key not in ("settings", "name")}
    if "verified" in kept:
        kept["verified"] = "verified" if kept["verified"] else "unverified on hardware"
    return kept


def _applied(applied: dict[str, object]) -> Facts:
    from eddyscan.report.tables import facts_of

    return facts_of(applied, "As applied by the devices")
