"""Compilation of kernels ahead of a run, in a child process.

The compiled kernels go to the cache, where the component's FMU finds them. An error of the child is ignored: the FMU
meets the same error and reports it.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from fmus.cache.files import cache_folder, private_folder, read_checked, write_checked
from fmus.cache.sources import ROOT, search_path, source_hash
from fmus.kernels.jit import COMPILED

Recipe = tuple[str, Mapping[str, Any], Mapping[str, Any]]  # kind of component, its config, its parameters


def start_compilation(parts: Sequence[Recipe], patience: int = 0) -> subprocess.Popen[str] | None:
    """Start a process that compiles the kernels of parts in turn; None where all are compiled already.

    ``patience`` is the niceness of the process: 0, or a larger number to give way to others.
    """
    left = [part for part in parts if not _is_done(part[0])]
    if not left:
        return None
    COMPILED.info("kernels of %s are compiled beside", ", ".join(kind for kind, _, _ in left))
    child = subprocess.Popen(
        [sys.executable, "-m", "fmus.ahead.kernels", str(patience)],
        stdin=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": search_path(ROOT.parent)},
        text=True,
    )
    assert child.stdin is not None
    with child.stdin as stream:
        json.dump(left, stream)
    return child


def _mark(kind: str) -> Path:
    """File that marks the kernels of a kind of component as compiled from the present sources."""
    return cache_folder() / "kernels" / "ahead" / f"{kind}-{source_hash()[:20]}"


def _is_done(kind: str) -> bool:
    try:
        return read_checked(_mark(kind)) is not None
    except OSError:  # the cache cannot be used: compiled kernels would not be kept
        return True


def _child() -> None:
    from fmus.components import model_of  # the parent does not need it

    signal.signal(signal.SIGTERM, signal.default_int_handler)  # an exception: no half-written file stays in the cache
    if hasattr(os, "nice"):
        os.nice(int(sys.argv[1]))
    for kind, config, parameters in json.load(sys.stdin):
        with suppress(Exception):
            model = model_of(kind)(config)
            model.compile({port.name: port.start for port in model.ports if port.causality == "parameter"} | parameters)
            private_folder(_mark(kind).parent)
            write_checked(_mark(kind), b"")


if __name__ == "__main__":
    _child()
