"""Answers of commands about logs, asked of the version that made ``logs/old_logs.tar.xz`` and of this one.

The logs were made on 2026-11-29 with 0.4.0 (d4ae4d72); its answers, ``answers.json``, lie beside them. They are of a
bench with each coupling, with both links, native and not, of variable steps, cut off, recovered and resumed; a chain;
vehicles with both links.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from orchestrator.log.reader import Log

Ask = Callable[..., tuple[int, str]]  # a command line -> exit status, stdout
ANALYSES = "power", "joints", "links"


def answers(path: Path, ask: Ask) -> dict[str, Any]:
    """All that is asked of one log."""
    status, said = ask("log", "verify", path)
    found: dict[str, Any] = {"verify": status, "whole": "is whole" in said, "arrays": arrays(path)}
    if not status:
        found["digest"] = json.loads(ask("log", "info", path, "--json")[1])["digest"]
    for what in ANALYSES:
        found[what] = _table(*ask("analyse", path, what, "--json"))
    return found


def compared(folder: Path, ask: Ask) -> dict[str, Any]:
    """Comparisons of two logs: of two couplings, and of a run with one that was interrupted and resumed."""
    status, said = ask("compare", folder / "tracks_first.mcap", folder / "resumed.mcap", "--bits")
    return {
        "couplings": _table(*ask("compare", folder / "jacobi.mcap", folder / "gauss_seidel.mcap", "--json")),
        "resumed": [status, said.splitlines()[-1]],
    }


def arrays(path: Path) -> dict[str, str]:
    """SHA-256 of times and values of each topic."""
    found = {}
    with Log(path, unfinished=True) as log:
        for topic in log.topics:
            series = log.read(topic)
            found[topic] = hashlib.sha256(series.t.tobytes() + series.values.tobytes()).hexdigest()[:16]
    return found


def _table(status: int, said: str) -> Any:
    """JSON of an answer, without paths; the status alone of a refusal."""
    return json.loads(said.replace(str(Path.cwd()), "")) if said.startswith(("{", "[")) else status
