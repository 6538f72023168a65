"""Chapters that let others check: truth (simulation only), provenance, signatures."""

from __future__ import annotations

from eddyscan.report.blocks import Block, Facts, Note, Section, Signatures, Table
from eddyscan.report.content import ReportContent
from eddyscan.report.tables import blocks_of
from eddyscan.report.words import number


def truth(content: ReportContent) -> Section | None:
    """Measure the inspection against the hidden world; only a simulation has one."""
    if content.truth is None:
        return None
    warning = "Known only because this was a simulation. No step of the inspection saw these values."
    return Section("truth", "Against the hidden truth", "", (Note(warning, "warning"), *blocks_of(content.truth)))


def provenance(content: ReportContent) -> Section:
    """Name software, hashes of the data, and the time each step took."""
    blocks: list[Block] = [Facts((("software", f"eddyscan {content.software_version}"),), "Software")]
    if content.hashes:
        rows = tuple((name, digest) for name, digest in content.hashes.items())
        blocks.append(Table(("file", "SHA-256"), rows, "Data this report was made from", frozenset({0, 1})))
    else:
        blocks.append(
            Note("No hashes of the data were given: the files behind this report cannot be checked.", "missing")
        )
    if content.timings_s:
        total = sum(content.timings_s.values())
        rows = tuple((step, number(seconds, 3)) for step, seconds in content.timings_s.items())
        blocks.append(Table(("step", "time [s]"), (*rows, ("all steps", number(total, 3))), "Time taken"))
    return Section("provenance", "Data and software", "", tuple(blocks))


def signatures(content: ReportContent) -> Section:
    """Give the lines to sign on."""
    who = content.technique.procedure
    people = (("Operator", f"{who.operator}, level {who.operator_level}"), ("Reviewer", who.reviewer))
    return Section("signatures", "Signatures", "", (Signatures(people),))
