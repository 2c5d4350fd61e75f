"""Import of modules of ``fmus`` after the folder from which the package was loaded has been deleted.

All FMUs of a process share the ``fmus`` of the first one, and a tool may delete the folder of an FMU that it has freed.
Modules that are imported later are then found in the FMUs that are still unpacked, each in a folder of ``sys.path``, if
they are of the same build.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType


class SameBuild:
    """Finder for ``sys.meta_path``, used after all others."""

    def __init__(self, package: str, build: str, other: Callable[[str], Exception]) -> None:
        self.package, self._build, self._other = package, build, other

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Spec of a module in the first unpacked FMU of this build in ``sys.path``.

        Raises ``other(build)`` where only FMUs of other builds have it.
        """
        top, *inner = name.split(".")
        if top != self.package or not inner or any(Path(folder).is_dir() for folder in path or ()):
            return None  # another package, or the folder still exists and has no such module
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
