"""``python -m tests.benchmarks.guests``: cost of a step of FMUs of users, in their own processes and in the run's."""

from __future__ import annotations

import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from orchestrator.cosim.coupling import coupling
from orchestrator.cosim.graph import connect
from orchestrator.execution.loading import load_scene
from orchestrator.results.table import Column, Table
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import any_from_table
from tests.benchmarks.timing import quiet
from tests.support import foreign_fmus
from tests.support.foreign_fmus import Variable

H, STEPS, REPEATS, NUMBERS = 1e-3, 2000, 5, (1, 2, 8)
VARIABLES = (
    Variable("u", "input"), Variable("x", "output"), Variable("start", "parameter"), Variable("T", "parameter", 1.0),
)  # fmt: skip
COLUMNS = (
    Column("fmus", "FMUs"),
    Column("own", "own processes, us a step and FMU", form=".1f"),
    Column("inside", "process of the run, us a step and FMU", form=".1f"),
)


def cost(fmu: Path, n: int, in_process: bool, steps: int = STEPS) -> float:
    """Wall time of a step of n FMUs, each with an input from the one before it, us per FMU."""
    fmus = {f"f{k}": {"file": str(fmu), "in_process": in_process} for k in range(n)}
    connections = [f"f{k}.x -> f{k + 1}.u" for k in range(n - 1)]
    table = {"name": "g", "title": "g", "assembly": "fmus", "fmu": fmus, "connections": connections}
    scene = any_from_table(table | {"run": {"step": H, "stop": steps * H}}, "guests.toml")
    with ExitStack() as stack:
        placed, graph, components = load_scene(scene, assemble(scene), stack)
        scheme = stack.enter_context(coupling(placed.run.coupling.scheme)(connect(graph, components)))
        scheme.advance(0.0, H)
        with quiet():
            began = time.perf_counter()
            for k in range(1, steps):
                scheme.advance(k * H, H)
            return 1e6 * (time.perf_counter() - began) / (steps - 1) / n


def measured(repeats: int = REPEATS, steps: int = STEPS) -> Table:
    """Least cost of the repeats, both ways in turn."""
    with tempfile.TemporaryDirectory() as folder:
        fmu = foreign_fmus.build(Path(folder, "lag.fmu"), "lag", VARIABLES)
        rows = []
        for n in NUMBERS:
            runs = [[cost(fmu, n, inside, steps) for inside in (False, True)] for _ in range(repeats)]
            rows.append((n, *map(min, zip(*runs, strict=True))))
    return Table("FMUs of users", COLUMNS, rows)


if __name__ == "__main__":
    print(measured())
