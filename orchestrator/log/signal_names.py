"""Names of signals: the instance of a topic, patterns, suggestions for unknown names."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping


def owner(topic: str) -> str:
    """Return the instance of a topic; statistics have a prefix: "/stats/chassis" -> "stats.chassis"."""
    words = topic.strip("/").split("/")
    return f"stats.{words[1]}" if words[0] == "stats" and len(words) > 1 else words[0]


def matches(pattern: str, text: str) -> bool:
    """Whether ``pattern`` matches ``text``; ``*`` stands for any text, brackets are literal."""
    return re.fullmatch(".*".join(map(re.escape, pattern.split("*"))), text) is not None


def near(name: str, known: Mapping[str, object]) -> str:
    """Return "; did you mean ...?" with the known name nearest to ``name``, or an empty text.

    The shortest name that ends with ``name`` counts as the nearest.
    """
    ending = sorted((each for each in known if each.endswith(f".{name}")), key=len)
    close = ending or difflib.get_close_matches(name, known, 1, 0.0 if len(known) < 4 else 0.6)
    return f"; did you mean '{close[0]}'?" if close else ""
