"""Modules of ``fmus`` found again after the folder that it was loaded from is gone.

All FMUs of a process share the first one's ``fmus``, and a tool may delete the folder of an FMU that it is done with.
What is imported after that lies in the FMUs that are still unpacked, each in a folder of ``sys.path``; those of the
same build are as good as the first.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType


class SameBuild:
    """A finder for ``sys.meta_path``, asked after all others."""

    def __init__(self, package: str, build: str, other: Callable[[str], Exception]) -> None:
        self.package, self._build, self._other = package, build, other

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The module in the newest unpacked FMU of this build; raises ``other(build)`` if there are others only."""
        top, *inner = name.split(".")
        if top != self.package or not inner or any(Path(folder).is_dir() for folder in path or ()):
            return None  # not ours, or simply not there
        others = []
        for resources in map(Path, sys.path):
            try:
                build = (resources / "build.txt").read_text().strip()
            except OSError:
                continue
            spec = PathFinder.find_spec(name, [str(resources.joinpath(top, *inner[:-1]))])
            if spec is not None and build == self._build:
                return spec
            others.append(build)
        if others:
            raise self._other(others[0])
        return None
