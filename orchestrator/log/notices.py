"""Sentences about a log that is read, which a command prints first on stderr."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from textwrap import shorten
from typing import Any

from orchestrator import __version__

TOPICS = 200  # characters of a notice


def cut_off(path: Path, t: float) -> str:
    """Return the notice for a log without a closing record, whose last record is at ``t`` s."""
    return f"{path} was cut off at t = {t:.6g} s: no closing record"


def failed(path: Path, message: str) -> str:
    """Return the notice for a log of a run that failed or left what its model holds for."""
    return f"{path}: its run failed: {message}"


def foreign(path: Path, header: Any, topics: Mapping[str, str]) -> str:
    """Return the sentence on an MCAP file that is no log of cotrack; ``topics``: with message type and encoding."""
    named = shorten(", ".join(f"{topic} ({kind})" for topic, kind in topics.items()), TOPICS, placeholder=" ...")
    wrote = f"profile '{header.profile}', library '{header.library}', topics {named or 'none'}"
    use = "'cotrack log info' lists its numbers, which serve as measured data"
    return f"{path} is an MCAP file of other software, no log of cotrack; {use}: {wrote}"


def stripped(path: Path) -> str:
    """Return the notice for a log without any metadata and attachments."""
    return f"{path} was rewritten by other software, which left out scene, status and results: it has signals alone"


def left_behind(path: Path) -> str:
    """Return the notice for a log that a killed run has left beside the one that it would have replaced."""
    return f"{path} was left by a run that was killed: 'cotrack resume' continues it, 'cotrack log recover' saves it"


def other_version(path: Path, versions: Mapping[str, str]) -> str:
    """Return the notice for a log of another cotrack version, empty for this one and for a log that names none.

    ``versions``: metadata of the log.
    """
    version = versions.get("cotrack", __version__)
    if version == __version__:
        return ""
    return f"{path} was made by cotrack {version}, and this is cotrack {__version__}, which computes other numbers"
