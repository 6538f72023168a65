"""SCPI headers as the simulated meter compares them."""

from __future__ import annotations


def short_form(head: str) -> str:
    """Return a header in short upper-case form, default nodes left out: FREQuency:CW? -> FREQ?."""
    query = head.endswith("?")
    words = [word for word in head.rstrip("?").upper().split(":") if word]
    short = [_short_word(word) for word in words]
    for tail in (["CW"], ["LEV"], ["TYPE"], ["IMM"], ["DATA"], ["ASC"], ["NEXT"]):
        if len(short) > 1 and short[-1:] == tail:
            short = short[:-1]
    if short[:2] == ["FETC", "IMP"]:
        short = ["FETC"]
    return ":".join(short) + ("?" if query else "")


def _short_word(word: str) -> str:
    if word.startswith("*") or len(word) <= 4:
        return word
    return word[:3] if word[3] in "AEIOU" else word[:4]
