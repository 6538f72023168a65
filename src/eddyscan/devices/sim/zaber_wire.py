"""Lines of the vendor's ASCII protocol: what a command says, what an answer looks like."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Command:
    """One command line: addressed device and axis (0 = all), message id, words."""

    device: int
    axis: int
    message_id: str | None
    words: tuple[str, ...]


@dataclass(frozen=True)
class Answer:
    """What a device says to one command."""

    data: str = "0"
    rejected: bool = False


def checksum(text: str) -> str:
    """Return the two hex digits of the longitudinal redundancy check: minus the sum of bytes, modulo 256."""
    return f"{-sum(text.encode('latin-1')) & 0xFF:02X}"


def parse(line: bytes) -> Command | None:
    """Return the command in `line`, or None when it is no command or its checksum is wrong."""
    text = line.decode("latin-1").strip("\r\n")
    if not text.startswith("/"):
        return None
    body, colon, digits = text[1:].rpartition(":")
    if not colon:
        body = text[1:]
    elif checksum(body) != digits.upper():
        return None
    words = body.split()
    numbers: list[str] = []
    while words and len(numbers) < 3 and words[0].isascii() and words[0].isdigit():
        numbers.append(words.pop(0))
    return Command(
        int(numbers[0]) if numbers else 0,
        int(numbers[1]) if len(numbers) > 1 else 0,
        numbers[2] if len(numbers) > 2 else None,
        tuple(words),
    )


def reply(command: Command, device: int, *, answer: Answer, busy: bool, warning: str) -> bytes:
    """Return the answer line of `device` to `command`."""
    message_id = "" if command.message_id is None else f" {command.message_id}"
    kind = "RJ" if answer.rejected else "OK"
    status = "BUSY" if busy else "IDLE"
    return f"@{device:02d} {command.axis}{message_id} {kind} {status} {warning} {answer.data}\r\n".encode("latin-1")


def alert(device: int, axis: int, *, busy: bool, warning: str) -> bytes:
    """Return the line a device sends on its own when an axis comes to rest."""
    return f"!{device:02d} {axis} {'BUSY' if busy else 'IDLE'} {warning}\r\n".encode("latin-1")
