"""Names of signals: the instance of a topic, patterns, suggestions for unknown names, descriptions in a log."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from xml.etree import ElementTree

from orchestrator.files.budget import DOCUMENT, check_size
from orchestrator.log.container import LogUnreadable

Names = str | Sequence[str]  # one, or a list
MAX_SUGGESTIONS = 3  # names that a message suggests
NO_TEXTS: Mapping[str, str] = MappingProxyType({})


def owner(topic: str) -> str:
    """Return the instance of a topic; statistics have a prefix: "/stats/chassis" -> "stats.chassis"."""
    words = topic.strip("/").split("/")
    return f"stats.{words[1]}" if words[0] == "stats" and len(words) > 1 else words[0]


def listed(names: Names | Iterable[Names]) -> list[str]:
    """Return a name, or names of which some may be in lists, as one list."""
    return [names] if isinstance(names, str) else [name for each in names for name in listed(each)]


def matches(pattern: str, text: str) -> bool:
    """Whether ``pattern`` matches ``text``; ``*`` stands for any text, brackets are literal."""
    return re.fullmatch(".*".join(map(re.escape, pattern.split("*"))), text) is not None


def near(name: str, known: Mapping[str, object], texts: Mapping[str, str] = NO_TEXTS) -> str:
    """Return "; did you mean ...?" with known names like an unknown one, or an empty text.

    ``texts``: descriptions of known names.
    """
    close = worded(name, known, texts) or difflib.get_close_matches(name, known, 1, 0.0 if len(known) < 4 else 0.6)
    return f"; {did_you_mean(close)}" if close else ""


def components(name: str, known: Iterable[str]) -> str:
    """Return a hint at the components of a vector or rotation that is called by its name, or an empty text."""
    parts = [one.removeprefix(f"{name}.") for one in known if one.startswith(f"{name}.")]
    if not parts or not {*parts} <= {*"wxyz"}:
        return ""
    return f": it has the components {', '.join(f'.{part}' for part in sorted(parts))}; '{name}.*' is all of them"


def worded(name: str, known: Iterable[str], texts: Mapping[str, str]) -> list[str]:
    """Return the shortest MAX_SUGGESTIONS names that have all words of ``name`` in themselves or their descriptions."""
    words = _words(name)
    found = [one for one in known if words and words <= _words(one) | _words(texts.get(one, ""))]
    return sorted(found, key=len)[:MAX_SUGGESTIONS]


def did_you_mean(names: Iterable[str]) -> str:
    """Return the question "did you mean 'a' or 'b'?"."""
    return f"did you mean {' or '.join(map(repr, names))}?"


def _words(text: str) -> set[str]:
    return set(re.findall(r"[a-z]+|[0-9]+", text.lower()))


def recorded_texts(attachment: Callable[[str], bytes], instance: str) -> dict[str, str]:
    """Return the descriptions by the variables of an instance; none if the document is missing or damaged.

    ``attachment``: reads an attached file by its name; may raise LookupError, LogUnreadable.
    """
    try:
        content = attachment(f"{instance}.modelDescription.xml")
        check_size(content, DOCUMENT)
        tree = ElementTree.fromstring(content)
    except (LogUnreadable, ElementTree.ParseError, LookupError, ValueError):  # LookupError: an unknown encoding, too
        return {}
    return {each.get("name", ""): each.get("description", "") for each in tree.iter("ScalarVariable")}
