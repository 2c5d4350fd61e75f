"""``python -m tests.benchmarks.instructions [STEPS]``: instructions of the steps of a native track and of the vehicle.

The vehicle of ``straight`` runs with both kinds of links in the host in C under callgrind (Debian package valgrind),
which counts ``fmi2DoStep``: numbers that no load of the machine changes. Callgrind counts each byte of a large block
that is copied or zeroed at once (``rep movsb``) as an instruction.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from fmus.native.machine_code import ANY, LEVELS
from orchestrator.results.table import Table
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load
from tests.support.c_host import HOST, built, order_text

STEP, TRACK = 1e-3, "left_track"
FIGURES = "mean", "median", "99 %", "99.9 %", "most"


def counts(links: str, steps: int, folder: Path) -> np.ndarray:
    """Instructions (2, steps) of the left track and of the vehicle; raises CalledProcessError, FileNotFoundError.

    The code is that for any processor: valgrind 3.19 does not know an instruction of the other.
    """
    os.environ["COTRACK_CACHE"] = str(folder / "cache")
    LEVELS.update(dict.fromkeys(LEVELS, ANY))
    settings = [f"run.step={STEP!r} s", f"track.step={STEP!r} s", f"run.stop={STEP * (steps + 1000)!r} s"]
    assembly = assemble(placed(load("straight", links, settings)))
    names = [part.name for part in sorted(assembly.parts, key=lambda part: part.stage)]  # as they step
    program = folder / "host"
    subprocess.run(["gcc", "-std=gnu11", "-O2", "-DCOUNTED", "-o", program, HOST, "-ldl"], check=True)
    order = order_text(assembly, built(assembly), STEP, steps)
    callgrind = ["valgrind", "-q", "--tool=callgrind", "--collect-atstart=no", f"--callgrind-out-file={folder}/out"]
    subprocess.run([*callgrind, program], input=order, text=True, check=True, stdout=subprocess.DEVNULL)
    dumps = ((folder / f"out.{k}").read_text() for k in range(1, steps * len(names) + 1))
    each = np.array([int(re.search(r"^summary: (\d+)", dump, re.M)[1]) for dump in dumps])  # type: ignore[index]
    each = each.reshape(steps, len(names))
    return np.array([each[:, names.index(TRACK)], each.sum(axis=1)])


def main() -> None:
    """Print a table: thousands of instructions, and their ratio to the median."""
    steps, rows = int(sys.argv[1]) if len(sys.argv) > 1 else 8_000, []
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        for links in ("flexible", "rigid"):
            for name, n in zip(("track", "vehicle"), counts(links, steps, Path(folder)), strict=True):
                figures = [n.mean(), np.median(n), np.quantile(n, 0.99), np.quantile(n, 0.999), n.max()]
                rows.append([f"{name}, {links}", *(f"{each / 1e3:.0f} ({each / figures[1]:.2f})" for each in figures)])
    columns = [(name, "") for name in ("links", *FIGURES)]
    print(Table.of("Instructions of a step, thousands (over the median)", columns, rows).markdown())


if __name__ == "__main__":
    main()
