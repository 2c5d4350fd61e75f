"""Savings by leaving parts out of a scene, with unchanged results.

A case is a pair of runs, with and without a part. Time: both run in turn in one fresh process with compiled kernels;
the ratio is the median of the pairs' ratios, with their least and largest. Memory: the peak of a fresh process for
each. Parts that no scene can declare without use (a chassis beside a rig, a ground far below it) are added to the
assembly here.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.cosim import master
from orchestrator.cosim.initialisation import load_components
from orchestrator.cosim.observers import Logging
from orchestrator.execution.manifest import open_log
from orchestrator.execution.prepared_run import PreparedRun
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results import output_files
from orchestrator.results.table import Column, Table
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.kinds import Scene
from orchestrator.scene.parts import CHASSIS, TRACK, Assembly, Part
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load
from orchestrator.studies import Case, Row

TITLE = "What leaving out saves"
WORKERS = 1  # timed pairs need the machine for themselves
PAIRS = 5
# Allowed differences. Pin forces are those of Newton's last evaluation, with corrections of up to 1e-9 m left; a link
# of 3e9 N makes 20 N of that, and 1e-6 of the largest force is 20 mN.
MOTION, FORCE = 3e-8, 1e-6  # 30 and 100 times the growth of one ulp of gravity in the displaced hanging chain
SMALLEST_SCALE = 1e-2  # of a scale: with a smaller value, in SI, a unit hardly occurs in a run
SPEED_OF = {"m": "m/s", "rad": "rad/s"}  # rates for units that a run hardly shows, taken from its positions
SOFT = ("m", "m/s", "rad", "rad/s", "1")  # units of motion; others are forces, stresses and energies
DEPTH = 900.0  # m from a chain to a ground out of reach; places of a vehicle end at 1 km
BRIEF = "run.stop=10 ms"

COLUMNS = (
    Column("item", "scene"),
    Column("case", "left out"),
    Column("cpu_with", "CPU with, s", ".3f"),  # of all threads while stepping and recording
    Column("cpu_without", "without, s", ".3f"),
    Column("cpu_ratio", "CPU ratio", ".3f"),  # without over with: median, least, largest of the pairs
    Column("cpu_least", "least", ".3f"),
    Column("cpu_largest", "largest", ".3f"),
    Column("wall_ratio", "wall ratio", ".3f"),
    Column("wall_least", "least", ".3f"),
    Column("wall_largest", "largest", ".3f"),
    Column("memory_with", "peak with, MB", ".0f"),
    Column("memory_without", "without, MB", ".0f"),
    Column("log_with", "log with, kB", ".0f"),
    Column("log_without", "without, kB", ".0f"),
    Column("motion", "motion differs", ".1e"),  # common results, relative to the largest of their unit
    Column("force", "forces differ", ".1e"),
    Column("ok", "ok"),
    Column("note", "note"),
)
KEYS = tuple(column.key for column in COLUMNS[2:-2])  # keys of figures


class PairedRun(NamedTuple):
    """One run of a pair."""

    settings: tuple[str, ...] = ()
    added: str = ""  # name in ADDED of a part of the assembly
    estimated: bool = False


ADDED: dict[str, Callable[[Scene, Assembly], Assembly]] = {
    "chassis": lambda scene, a: a._replace(parts=(*a.parts, _idle_chassis(scene))),
    "ground": lambda scene, a: a._replace(parts=tuple(_over_ground(part) for part in a.parts)),
}

HALF, PLANAR = PairedRun(("symmetric=true",)), PairedRun(("symmetric=true", "planar=true"))
NO_LINKS = PairedRun(("track.link_outputs=false",))
ALONE = (  # chains without a vehicle
    ("lateral dofs", PairedRun(), PairedRun(("planar=true",))),
    ("a chassis that nothing touches", PairedRun(added="chassis"), PairedRun()),
    ("a ground out of reach", PairedRun(added="ground"), PairedRun()),
    ("outputs per link every 10 steps", PairedRun(), NO_LINKS),
)
RAMP = ("drive.ramp_start=0 s",)  # without rest at the start
# Scene: end of a quick and of a full run, s, common settings, and names of parts with both sides.
SCENES: dict[str, tuple[float, float, tuple[str, ...], tuple[tuple[str, PairedRun, PairedRun], ...]]] = {
    "straight": (
        0.5,
        2.0,
        RAMP,
        (
            ("the right half", PairedRun(), HALF),
            ("lateral dofs", HALF, PLANAR),
            ("right half and lateral dofs", PairedRun(), PLANAR),
            ("outputs per link every 20 ms", PairedRun(), NO_LINKS),
            ("outputs per link every step", PairedRun(("run.links=1",)), NO_LINKS),
            ("nine outputs of ten", PairedRun(), PairedRun(("run.outputs=10",))),
            ("the estimate of the error", PairedRun(estimated=True), PairedRun()),
        ),
    ),
    "settle": (0.5, 2.0, (), (("the right half", PairedRun(), HALF), ("lateral dofs", HALF, PLANAR))),
    "rig": (1.0, 3.0, RAMP, ALONE),
    "hanging_chain": (0.5, 1.0, ("track.start=displaced",), ALONE),
}


def cases(quick: bool, scene: str | None = None) -> list[Case]:
    """Pairs on four scenes, or on one; quick pairs are shorter. Raises BadInput."""
    if scene is not None and scene not in SCENES:
        raise BadInput(f"study leaving-out: scene '{scene}' must be one of {', '.join(SCENES)}")
    all_cases = []
    for name, (brief, long, base, omissions) in SCENES.items():
        if scene not in (None, name):
            continue
        stop = brief if quick else long
        common = (f"run.stop={stop} s", "run.outputs=1", *base)
        for omission, *sides in omissions:
            pair = tuple(side._replace(settings=(*common, *side.settings)) for side in sides)
            all_cases.append(Case(name, omission, compare, (name, pair, 3 if quick else PAIRS), 20.0 * stop))
    return all_cases


def compare(scene: str, sides: tuple[PairedRun, PairedRun], pairs: int) -> list[Row]:
    """Time both sides in turn, measure their memory, and compare their logs."""
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        timed = _run_task({"scene": scene, "sides": sides, "pairs": pairs, "folder": folder})
        peaks = [_run_task({"scene": scene, "sides": [side], "pairs": 0, "folder": folder})["peak"] for side in sides]
        motion, force = difference(*(Path(folder) / f"{k}.mcap" for k in (0, 1)))
    costs = np.array(timed["costs"])  # (pairs, side, (cpu, wall))
    medians = np.median(costs, axis=0)
    ratios = costs[:, 1] / costs[:, 0]
    spreads = np.array([np.median(ratios, axis=0), ratios.min(axis=0), ratios.max(axis=0)])  # (statistic, (cpu, wall))
    ok = motion <= MOTION and force <= FORCE
    figures = [
        *medians[:, 0].tolist(),
        *spreads.T.ravel().tolist(),
        *peaks,
        *(size / 1000 for size in timed["log"]),
        motion,
        force,
    ]
    return [Row("", "", dict(zip(KEYS, figures, strict=True)), ok)]


def difference(first: Path, second: Path) -> tuple[float, float]:
    """Largest differences of motion and of forces between two logs, at common times.

    They are relative to the largest common value of the same unit or, for a speed that hardly occurs, to the fastest
    change of its position.
    """
    scale: dict[str, float] = {}
    fastest: dict[str, float] = {}
    largest: dict[str, float] = {}
    with Log(first) as a, Log(second) as b:
        for topic in sorted(set(a.topics) & set(b.topics)):
            if topic.startswith("/stats"):
                continue
            left, right = a.read(topic), b.read(topic)
            _, i, j = np.intersect1d(np.rint(left.t * 1e9), np.rint(right.t * 1e9), return_indices=True)
            for name in set(left.names) & set(right.names):
                column = left.names.index(name)
                x, y = left.values[i, column], right.values[j, right.names.index(name)]
                unit = a.topics[topic].units[column]
                scale[unit] = max(scale.get(unit, 0.0), float(np.abs(x).max(initial=0.0)))
                largest[unit] = max(largest.get(unit, 0.0), float(np.abs(x - y).max(initial=0.0)))
                if unit in SPEED_OF:
                    rate = np.abs(np.diff(x) / np.diff(left.t[i])).max(initial=0.0)
                    fastest[SPEED_OF[unit]] = max(fastest.get(SPEED_OF[unit], 0.0), float(rate))
    for unit, rate in fastest.items():
        if scale.get(unit, 0.0) < SMALLEST_SCALE:
            scale[unit] = rate
    relative = {unit: value / max(scale[unit], SMALLEST_SCALE) for unit, value in largest.items()}
    soft = (value for unit, value in relative.items() if unit in SOFT)
    return max(soft, default=0.0), max((value for unit, value in relative.items() if unit not in SOFT), default=0.0)


# --- runs, in a process of their own ---------------------------------------------------------------


def _run_task(task: dict[str, Any]) -> Any:
    process = subprocess.run(
        [sys.executable, "-m", "orchestrator.studies.leaving_out"],
        input=json.dumps(task),
        text=True,
        capture_output=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    if process.returncode:
        raise ChildProcessError((process.stderr.strip() or "no message").splitlines()[-1])
    return json.loads(process.stdout.splitlines()[-1])


def _main() -> None:
    task = json.load(sys.stdin)
    sides = [PairedRun(tuple(settings), *rest) for settings, *rest in task["sides"]]
    paths = [Path(task["folder"]) / f"{k}.mcap" for k in range(len(sides))]
    if not task["pairs"]:
        run(task["scene"], sides[0], Path(task["folder"]) / "peak.mcap")
        json.dump({"peak": peak()}, sys.stdout)
        return
    for side in sides:
        brief = side._replace(settings=(*side.settings, BRIEF), estimated=False)
        run(task["scene"], brief, Path(task["folder"]) / "warm.mcap")
    costs = []
    for k in range(task["pairs"]):
        cost = {i: run(task["scene"], sides[i], paths[i]) for i in ((0, 1), (1, 0))[k % 2]}
        costs.append([cost[0], cost[1]])
    json.dump({"costs": costs, "log": [path.stat().st_size for path in paths]}, sys.stdout)


def run(name: str, side: PairedRun, path: Path) -> tuple[float, float]:
    """CPU and wall time, s, of stepping and recording a scene; with an estimate, of the whole run."""
    scene = load(name, "flexible", side.settings)
    if side.estimated:
        cpu, wall = time.process_time(), time.perf_counter()
        summary = simulate(scene, path, estimated=True)
        if summary["status"] != "ok":
            raise RuntimeError(summary["message"])
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        return cpu, wall
    scene = placed(scene)
    assembly = assemble(scene)
    if side.added:
        assembly = ADDED[side.added](scene, assembly)
    with ExitStack() as stack:
        graph = system(assembly)
        components = load_components(graph, scene.run.times, stack)
        prepared = PreparedRun.prepare(scene, graph, components)
        with open_log(path, scene, graph, components, prepared.scheme) as recorder:
            cpu, wall = time.process_time(), time.perf_counter()
            outcome = master.run(
                prepared.scheme, prepared.step_control, [Logging(recorder, list(components.values()), 100)]
            )
            recorder.close(outcome.status, outcome.message, outcome.steps)
            cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    if outcome.status != "ok":
        raise RuntimeError(outcome.message)
    return cpu, wall


def _idle_chassis(scene: Scene) -> Part:
    config = {"vehicle": scene.vehicle.model_dump(), "chassis": {"sides": ["left", "right"]}}
    return Part("chassis", "Chassis", config, {}, CHASSIS)


def _over_ground(part: Part) -> Part:
    if part.stage != TRACK:
        return part
    vehicle = part.config["vehicle"]  # the ground lies where road wheels would stand
    wheel = {**vehicle["road_wheel"], "z": np.subtract(vehicle["road_wheel"]["z"], DEPTH).tolist()}
    track = {**part.config["track"], "ground": True}
    return part._replace(config={**part.config, "track": track, "vehicle": {**vehicle, "road_wheel": wheel}})


def peak() -> float:
    """Peak memory of this process, MB."""
    try:  # unlike getrusage, this excludes the parent process
        status = Path("/proc/self/status").read_text(encoding="utf-8")
        return float(status.partition("VmHWM:")[2].split()[0]) / 1024.0
    except (OSError, IndexError):
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2.0**20 if sys.platform == "darwin" else 1024.0)


# --- tables ----------------------------------------------------------------------------------------


def table(rows: Sequence[Row], title: str = "") -> Table:
    """Table of the rows."""
    return Table.of_records(title, COLUMNS, [row.cells() for row in rows])


def draw(rows: Sequence[Row], title: str) -> output_files.Picture:
    """Draw bars of the remaining cost: CPU time with its spread, log size."""
    drawn_rows = [row for row in rows if math.isfinite(row["cpu_ratio"])][::-1]
    figure = output_files.new_figure(9.0, 1.2 + 0.42 * len(drawn_rows))
    axes = figure.subplots()
    positions = np.arange(len(drawn_rows))
    middle, low, high = (
        np.array([row[key] for row in drawn_rows]) for key in ("cpu_ratio", "cpu_least", "cpu_largest")
    )
    axes.barh(positions + 0.2, middle, 0.38, xerr=(middle - low, high - middle), color="tab:blue", label="CPU time")
    axes.barh(
        positions - 0.2,
        [row["log_without"] / row["log_with"] for row in drawn_rows],
        0.38,
        color="tab:orange",
        label="log",
    )
    axes.set_yticks(positions, [f"{row.item}: {row.case}" for row in drawn_rows], fontsize=8)
    axes.axvline(1.0, color="0.5", linewidth=0.8)
    axes.set_xlabel("without over with")
    axes.set_title(title, fontsize=10)
    axes.legend(fontsize=8)
    return figure


def write(folder: Path, name: str, rows: Sequence[Row], title: str) -> list[Path]:
    """Write table and figure; raises OSError if the folder cannot be written."""
    return output_files.save_results(folder, name, table(rows, title), draw(rows, title))


if __name__ == "__main__":
    _main()
