"""A measurement in a process of its own: nothing before it has warmed, filled or pinned anything."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]  # of the checkout that measures
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


class Failed(RuntimeError):
    """A measurement could not be made; the message is one sentence."""


def environment(root: Path = ROOT) -> dict[str, str]:
    """Of a child: the packages of the checkout ``root``, one thread to a library."""
    path = os.pathsep.join(filter(None, (str(root), os.environ.get("PYTHONPATH"))))
    return {**os.environ, **ONE_THREAD, "PYTHONPATH": path}


def last_line(text: str) -> str:
    """What a process said at the end."""
    return (text.strip() or "no message").splitlines()[-1]


def isolated(module: str, **options: Any) -> Any:
    """What ``measure(**options)`` of a module of this folder returns as plain data; raises Failed."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.benchmarks.process", module, json.dumps(options)],
        capture_output=True,
        text=True,
        env=environment(),
    )
    if done.returncode:
        raise Failed(last_line(done.stderr))
    return json.loads(done.stdout.splitlines()[-1])


def child(module: str, options: str) -> None:
    """The other end: the last line on stdout is what was measured."""
    found = import_module(f"tests.benchmarks.{module}").measure(**json.loads(options))
    sys.stdout.write(f"\n{json.dumps(found)}\n")


if __name__ == "__main__":
    child(*sys.argv[1:])
