"""Finds that are not mended yet: name of the file in ``corpus/`` -> pattern of what is wrong, and reason.

A find in this table does not fail the fuzzing. Its file in the corpus must still show it, until it is mended and leaves
the table.
"""

from __future__ import annotations

import re
from typing import NamedTuple


class Expected(NamedTuple):
    """A known find."""

    kind: str
    pattern: str
    reason: str


EXPECTED: dict[str, Expected] = {
    "cache-fifo": Expected("caches", r"hang: waits", "an unpacked file is opened without a look at its kind"),
    "cache-device": Expected(
        "caches",
        r"is not a zip archive that can be read: $|ComponentFailed",
        "an unpacked file is read without a look at its kind and size",
    ),
    "cache-other": Expected(
        "caches", r"the run on the damaged cache gives", "the checksum of an FMU does not cover its key"
    ),
    "output-name": Expected("commands", r"File name too long", "names of outputs are checked when they are written"),
    "recover-folder": Expected("commands", r"has an empty name", "'log recover' makes a name from that of a folder"),
    "long-scene": Expected("commands", r"^a sentence of", "the sentence repeats the name"),
    "long-analysis": Expected("commands", r"^a sentence of", "the sentence repeats the name"),
    "long-measure": Expected("scenes", r"^a sentence of", "the sentence lists all measures"),
    "fifo-vehicle": Expected("vehicles", r"hang: waits", "vehicle files are read without a look at their kind"),
    "long-quantity": Expected("vehicles", r"^a sentence of", "the sentence repeats pint's"),
    "fifo-points": Expected("points", r"hang: waits", "points are read without a look at the kind of file"),
    "device-points": Expected("points", r"MemoryError", "points are read without a look at the kind of file"),
    "many-points": Expected("points", r"MemoryError", "points have no limit of rows"),
    "log-topic": Expected("logs", r"KeyError", "messages of a topic whose component is unknown"),
    "checkpoint-kind": Expected("checkpoints", r"^a sentence of", "the sentence repeats what the checkpoint has"),
    "checkpoints-rare": Expected(
        "settings", r"cannot convert float infinity", "the steps between checkpoints are not finite"
    ),
    "long-seen-from": Expected("commands", r"^a sentence of", "the sentence repeats the name"),
    "long-vehicle": Expected("scenes", r"^a sentence of", "the sentence repeats the name"),
    "fifo-scene": Expected("scenes", r"hang: waits", "scene files are read without a look at their kind"),
    "large-vehicle": Expected("vehicles", r"MemoryError", "vehicle files are read without a limit of size"),
    "log-position": Expected("logs", r"could not convert string to float", "numbers of the scene are read as they are"),
}


def expected_name(kind: str, wrong: str) -> str:
    """Name of the known find that this is, else empty."""
    hits = (name for name, one in EXPECTED.items() if one.kind == kind and re.search(one.pattern, wrong))
    return next(hits, "")
