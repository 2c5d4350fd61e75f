"""The version of the format that logs are written in, as a metadata record.

1: has no such record; inputs are recorded in full. 2: inputs that are outputs of others are wired; checkpoints.
"""

from __future__ import annotations

from collections.abc import Mapping

NAME = "format"  # of the metadata record
VERSION = 2
BRANCHED = "branched"  # of the metadata record of a run that went on with other numbers
CHECKPOINT = "checkpoint/"  # begins the name of an attachment, before the number of the step


def checkpoint_step(attachment: str) -> int | None:
    """The number of the step that a checkpoint belongs to; None for other attachments."""
    number = attachment.removeprefix(CHECKPOINT)
    return int(number) if number != attachment and number.isdecimal() else None


class TooNew(ValueError):
    """A log of a format that is not known yet; the message is the end of a sentence."""


def check(record: Mapping[str, str]) -> None:
    """Whether a log can be read; raises TooNew, and ValueError where the record is damaged."""
    version = int(record.get("version", "0"))
    if version > VERSION:
        raise TooNew(f"has format {version} of a newer cotrack: this one reads formats 1 to {VERSION}")
