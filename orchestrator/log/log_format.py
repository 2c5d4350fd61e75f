"""Version of the log format, stored as a metadata record.

1: no such record; all inputs are recorded. 2: inputs that equal outputs of others are wired; checkpoints.
"""

from __future__ import annotations

from collections.abc import Mapping

NAME = "format"  # of the metadata record
VERSION = 2
BRANCHED = "branched"  # of the metadata record of a run that continues another one with changed parameters
INPUTS, UNRECORDED = "inputs", "not recorded"  # entry of the metadata ``run`` of a log without inputs
TEXTS = "texts.json"  # attachment at the end: texts by the numbers that a log holds for a String, by signal
CHECKPOINT = "checkpoint/"  # prefix of the name of an attachment, before the number of the step


def checkpoint_step(attachment: str) -> int | None:
    """Return the step number of a checkpoint attachment; None for other attachments."""
    number = attachment.removeprefix(CHECKPOINT)
    return int(number) if number != attachment and number.isdecimal() else None


class TooNew(ValueError):
    """The log has a newer format than this version reads; the message is the end of a sentence."""


def check_version(record: Mapping[str, str]) -> None:
    """Raise TooNew if this version cannot read the log's format, ValueError if the record is damaged."""
    version = int(record.get("version", "0"))
    if version > VERSION:
        raise TooNew(f"has format {version} of a newer cotrack: this one reads formats 1 to {VERSION}")
