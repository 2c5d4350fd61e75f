"""Store of finished cases as JSON files, so an interrupted study continues where it was.

A file is named after the case and the sources that computed it: changed sources make another file.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from functools import cache
from pathlib import Path

from fmus.cache.files import write
from orchestrator.studies import Case, Row

PACKAGES = ("fmus", "orchestrator")


@cache
def sources(module: str) -> str:
    """Hash of all sources and scenes of the installed packages, and of the folder of an outside module."""
    digest = hashlib.sha256()
    root = Path(__file__).parents[2]
    folder = "/".join(module.split(".")[:2])  # tests.validation.x: tests/validation
    for package in dict.fromkeys((*PACKAGES, folder)):
        for file in sorted((root / package).rglob("*")):
            if file.suffix in (".py", ".toml"):
                digest.update(file.relative_to(root).as_posix().encode() + b"\0")
                digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


class Store:
    """Rows of finished cases in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def _file(self, case: Case) -> Path:
        """File of a case. Limits of time do not count: a case that took too long is not repeated."""
        identity = [
            case.item,
            case.name,
            case.function.__qualname__,
            repr(case.arguments),
            sources(case.function.__module__),
        ]
        return self._folder / f"{hashlib.sha256(json.dumps(identity).encode()).hexdigest()[:24]}.json"

    def get(self, case: Case) -> list[Row] | None:
        """Rows of a case; None if it is not finished or its file is unreadable."""
        try:
            return [Row(**row) for row in json.loads(self._file(case).read_text())["rows"]]
        except (OSError, ValueError, TypeError, KeyError):
            return None

    def put(self, case: Case, rows: list[Row]) -> None:
        """Store the rows of a case, whole or not at all."""
        self._folder.mkdir(parents=True, exist_ok=True)
        content = {"case": case.name, "rows": [asdict(row) for row in rows]}
        write(self._file(case), json.dumps(content, indent=1).encode())
