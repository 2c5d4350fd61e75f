"""Kernels compiled in a process beside: a component's model is started and takes a step, as its FMU will do.

What it compiles is found in the cache. What it cannot do, the FMUs will say.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from fmus.cache import cache_folder, keep, kept, own
from fmus.jit import COMPILED, ROOT, source_hash

STEP = 1e-3  # s
Recipe = tuple[str, Mapping[str, Any], Mapping[str, Any]]  # kind of component, its config, its parameters


def begun(part: Recipe, patience: int = 0) -> subprocess.Popen[str] | None:
    """A process that compiles what the part needs; None where there is nothing to compile.

    With ``patience`` it gives way to others, as ``nice`` does.
    """
    if _done(part[0]):
        return None
    COMPILED.info("kernels of %s are compiled beside", part[0])
    child = subprocess.Popen(
        [sys.executable, "-m", "fmus.ahead", str(patience)],
        stdin=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": str(ROOT.parent)},
        text=True,
    )
    assert child.stdin is not None
    with child.stdin as orders:
        json.dump(part, orders)
    return child


def _mark(kind: str) -> Path:
    """The file that says that the kernels of these sources were compiled here for a kind of component."""
    return cache_folder() / "kernels" / "ahead" / f"{kind}-{source_hash()[:20]}"


def _done(kind: str) -> bool:
    try:
        return kept(_mark(kind)) is not None
    except OSError:  # nothing would be kept
        return True


def _child() -> None:
    from fmus.build import KINDS  # which the parent has no use for

    if hasattr(os, "nice"):
        os.nice(int(sys.argv[1]))
    kind, config, parameters = json.load(sys.stdin)
    with suppress(Exception):
        model = import_module(f"fmus.{KINDS[kind].partition('/')[0]}.model").Model(config)
        reals = [port for port in model.ports if isinstance(port.start, float)]
        given = {port.name: port.start for port in model.ports if port.causality == "parameter"}
        model.initialise(given | parameters)
        model.step(0.0, STEP, np.array([port.start for port in reals if port.causality == "input"]))
        model.outputs(np.zeros(sum(port.causality == "output" for port in reals) - model.link_ports))
        if model.link_ports:
            model.link_outputs(np.zeros(model.link_ports))
        own(_mark(kind).parent)
        keep(_mark(kind), b"")


if __name__ == "__main__":
    _child()
