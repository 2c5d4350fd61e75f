"""``python -m tests.benchmarks.instructions LINKS [STEPS]``: instructions of the steps of a native track.

The vehicle of ``straight`` runs in the host in C under callgrind (Debian package valgrind), which counts
``fmi2DoStep`` of the left track: a number for each step that no load of the machine changes. Some minutes for 30,000.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from fmus.native.emit import ANY, LEVELS
from orchestrator.results.table import Table
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load
from tests.c_host import HOST, built, order_text

STEP, COUNTED = 1e-3, "left_track"
FIGURES = "median", "99 %", "99.9 %", "most"


def counts(links: str, steps: int, folder: Path) -> np.ndarray:
    """Instructions of each step; raises CalledProcessError, FileNotFoundError without valgrind.

    The code is that for any processor: valgrind 3.19 does not know an instruction of the other.
    """
    os.environ["COTRACK_CACHE"] = str(folder / "cache")
    LEVELS.update(dict.fromkeys(LEVELS, ANY))
    settings = [f"run.step={STEP!r} s", f"track.step={STEP!r} s", f"run.stop={STEP * (steps + 1000)!r} s"]
    assembly = assemble(placed(load("straight", links, settings)))
    number = [part.name for part in assembly.parts].index(COUNTED)
    program = folder / "host"
    subprocess.run(["gcc", "-std=gnu11", "-O2", f"-DCOUNTED={number}", "-o", program, HOST, "-ldl"], check=True)
    order = order_text(assembly, built(assembly), STEP, steps)
    callgrind = ["valgrind", "-q", "--tool=callgrind", "--collect-atstart=no", f"--callgrind-out-file={folder}/out"]
    subprocess.run([*callgrind, program], input=order, text=True, check=True, stdout=subprocess.DEVNULL)
    dumps = [(folder / f"out.{k}").read_text() for k in range(1, steps + 1)]
    return np.array([int(re.search(r"^summary: (\d+)", dump, re.M)[1]) for dump in dumps])  # type: ignore[index]


def main() -> None:
    """Print a table: thousands of instructions, and their ratio to the median."""
    links, steps = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 30_000
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        n = counts(links, steps, Path(folder))
    figures = [np.median(n), np.quantile(n, 0.99), np.quantile(n, 0.999), n.max()]
    shown = [f"{each / 1e3:.0f} ({each / figures[0]:.2f})" for each in figures]
    columns = [(name, "") for name in ("links", *FIGURES)]
    print(Table.of("Instructions of a step, thousands (over the median)", columns, [[links, *shown]]).markdown())


if __name__ == "__main__":
    main()
