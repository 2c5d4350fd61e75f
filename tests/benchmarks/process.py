"""Measurements in processes of their own, which inherit no caches or threads."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]  # the measuring checkout
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


class Failed(RuntimeError):
    """A measurement could not be made; the message is one sentence."""


def environment(root: Path = ROOT) -> dict[str, str]:
    """Environment of a child process: packages of the checkout ``root``, one thread per library."""
    path = os.pathsep.join(filter(None, (str(root), os.environ.get("PYTHONPATH"))))
    return {**os.environ, **ONE_THREAD, "PYTHONPATH": path}


def last_line(text: str) -> str:
    """Last line of a process's output."""
    return (text.strip() or "no message").splitlines()[-1]


def isolated(module: str, **options: Any) -> Any:
    """Plain data that ``measure(**options)`` of a module of this folder returns; raises Failed."""
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
    """Measure in the child process and print the result as the last line on stdout."""
    result = import_module(f"tests.benchmarks.{module}").measure(**json.loads(options))
    sys.stdout.write(f"\n{json.dumps(result)}\n")


if __name__ == "__main__":
    child(*sys.argv[1:])
