"""Chains of links, closed and open: steps per second of CPU time at a known error, ours and those of peers.

All codes get the motion of ``motion`` and are compared with the same reference. Ours is timed as the chain's own
``advance``, one call for all steps as for the peers, as the model's ``step``, and as an FMU that a run loads, steps
and logs. Flexible chains are planar, as the peers' are; one with lateral dofs is measured too. Rigid links without
ground also move in joint coordinates by explicit methods, by ``advance``.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results.table import ABOUT, COST, Column, Table
from tests.benchmarks import motion
from tests.benchmarks.motion import CASES, Case, Floats
from tests.benchmarks.peers import PEERS, runs
from tests.benchmarks.timing import cpu, least

STEPS = (2e-3, 1e-3, 5e-4)  # s
H = 1e-3  # s, for measurements at one step only
RADII = (0.4, 0.9)  # spectral radii: our default, and Exudyn's
JOINTED_STEPS = (14e-3, 12.5e-3, 10e-3, 5e-3, 2e-3, 1e-3)  # s, of Runge-Kutta in joint coordinates
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)  # of the method of Dormand and Prince
TARGETS = (1e-5, 1e-8)  # errors at which codes are compared
LAYERS = ("ours, chain's advance", "ours, FMU with its log", "ours, model, lateral dofs")  # not compared
COLUMNS = (
    Column("case", "chain", "", ABOUT),
    Column("code", "code", "", ABOUT),
    Column("step", "step, ms", ".3g", ABOUT),
    Column("rate", "steps a CPU second", ",.0f"),
    Column("cpu", "CPU ms a simulated second", ".1f", COST),
    Column("error", "error", ".1e"),
)
EQUAL = (
    Column("case", "chain", "", ABOUT),
    Column("code", "code", "", ABOUT),
    Column("step", "step, ms", ".3g", ABOUT),
    Column("rate", "steps a CPU second", ",.0f"),
    Column("cpu", "CPU ms a simulated second", ".1f"),
    Column("ratio", "times our best", ".2f"),
)
NOTES = (
    "Error: RMS distance of the pins from a converged reference at the end, over the RMS of the ways that they went.",
    "On the ground only our code is measured: the peers have other contact laws.",
)

Run = dict[str, Any]


def measure(quick: bool, repeats: int) -> list[Table]:
    """Runs of all cases and codes; without ``quick`` also the cost of each at equal error."""
    rows: list[Run] = []
    notes: list[str] = []
    for name, case in CASES.items():
        stop = case.quick if quick else case.stop
        case_runs = ours(name, stop, quick, repeats)
        for peer in PEERS:
            theirs, reason = runs(peer, name, quick, repeats)
            case_runs += [{**run, "code": f"{peer.name}, {run['code']}"} for run in theirs]
            notes += [f"{reason}."] * (bool(reason) and f"{reason}." not in notes)
        rows += [row(name, case, stop, run) for run in case_runs]
    window = "; ".join(f"{name} {case.quick if quick else case.stop:g} s" for name, case in CASES.items())
    notes.append(f"CPU time, the least of {repeats} repeats; simulated: {window}.")
    tables = [Table.of_records("Chains", COLUMNS, rows, (*NOTES, *notes))]
    if not quick:
        tables += [
            Table.of_records(f"The same at an error of {target:g}", EQUAL, equal(rows, target), (
                "Between the steps measured, or at the cheapest that is good enough; empty: none is.",
            ))
            for target in TARGETS
        ]  # fmt: skip
    return tables


def row(name: str, case: Case, stop: float, run: Run) -> Run:
    """Figures of a run that took ``cpu`` s for ``stop`` s in steps of ``step`` s and ended with ``pins``."""
    return {
        "case": name,
        "code": run["code"],
        "step": 1e3 * run["step"],
        "rate": stop / run["step"] / run["cpu"],
        "cpu": 1e3 * run["cpu"] / stop,
        "error": motion.error(case, stop, np.array(run["pins"])),
    }


def ours(name: str, stop: float, quick: bool, repeats: int) -> list[Run]:
    """Runs of our code by layer, and of the model by step."""
    case = CASES[name]
    again = repeats + 1  # the first run may compile
    timings = [("ours, chain's advance", H, least(again, stepped, case, stop, H, "advance"))]
    for radius in RADII:
        code = "ours, model" if radius == RADII[0] else f"ours, model, spectral radius {radius:g}"
        for step in (H,) if quick else STEPS:
            changes = {"spectral_radius": radius}
            timings.append((code, step, least(again, stepped, case, stop, step, "step", changes)))
    if case.planar:
        whole = case._replace(planar=False)
        timings.append(("ours, model, lateral dofs", H, least(again, stepped, whole, stop, H, "step")))
    if not case.ground:
        timings.append(("ours, FMU with its log", H, least(again, logged, case, stop)))
    runs = [{"code": code, "step": step, "cpu": spent, "pins": pins} for code, step, (spent, pins) in timings]
    if case.track == "rigid" and not case.ground:
        for integrator, points in (("runge_kutta", case.steps(JOINTED_STEPS)), ("dormand_prince", TOLERANCES)):
            for point in points[-2:] if quick else points:
                spent, (pins, step) = least(again, jointed, case, stop, integrator, point)
                runs.append(
                    {"code": f"ours, joint coordinates, {integrator}", "step": step, "cpu": spent, "pins": pins}
                )
    return runs


def jointed(case: Case, stop: float, integrator: str, point: float) -> tuple[float, tuple[Floats, float]]:
    """CPU time, s, pins and mean step, s, in joint coordinates; ``point``: step, s, or tolerance."""
    step, changes = point, dict[str, Any]()
    if integrator == "dormand_prince":
        step, changes = stop, {"adams.rtol": point, "adams.atol": point}
    model = motion.model(case, step, formulation="recursive", integrator=integrator, **changes)
    spent, _ = cpu(lambda: model.advance(0.0, stop))
    return spent, (motion.pins(model), stop / float(model.counters[0]))


def stepped(
    case: Case, stop: float, h: float, layer: str, changes: Mapping[str, Any] | None = None
) -> tuple[float, Floats]:
    """CPU time, s, and pins of a model stepped by its ``step``, or of its chain by ``advance``."""
    model, none = motion.model(case, h, **(changes or {})), np.zeros(0)

    def steps() -> None:
        for k in range(round(stop / h)):
            model.step(k * h, h, none)

    spent, _ = cpu(steps if layer == "step" else lambda: model.advance(0.0, stop))
    return spent, motion.pins(model)


def logged(case: Case, stop: float) -> tuple[float, Floats]:
    """CPU time, s, and last pins of the scene as ``cotrack run`` runs it."""
    scene = motion.scene(case, f"run.stop={stop}", f"run.step={H}", f"track.step={H}")
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        result = simulate(scene, Path(folder) / "loop.mcap")
        if result["status"] != "ok":
            raise RuntimeError(result["message"])
        with Log(folder + "/loop.mcap") as log:
            links = log.read("/chain/links")
    if abs(links.t[-1] - stop) > 1e-9:
        raise RuntimeError(f"the log has no pins at {stop:g} s")
    return float(result["cpu_time"]), motion.places(list(links.names), links.values[-1])


def equal(rows: list[Run], target: float) -> list[Run]:
    """Cost of codes at the error ``target``, relative to our cheapest."""
    costs: list[Run] = []
    for name, case in CASES.items():
        if case.ground:
            continue
        codes = dict.fromkeys(row["code"] for row in rows if row["case"] == name)
        mine = []
        for code in codes:
            if code not in LAYERS:
                at = at_target([row for row in rows if (row["case"], row["code"]) == (name, code)], target)
                mine.append({"case": name, "code": code, **at})
        reached = [row for row in mine if row["cpu"] is not None]
        ours = min((row["cpu"] for row in reached if row["code"].startswith("ours")), default=np.nan)
        for row in reached:
            row["ratio"] = row["cpu"] / ours
        costs += mine
    return costs


def at_target(rows: list[Run], target: float) -> Run:
    """Step, rate and cost of a code at the error ``target``, interpolated, or None."""
    rows, keys = sorted(rows, key=lambda row: -row["step"]), ("step", "rate", "cpu")
    good = [k for k, row in enumerate(rows) if row["error"] <= target]
    if not good:
        return dict.fromkeys(keys)
    reached = [{key: rows[k][key] for key in keys} for k in good]
    if good[0] > 0:
        worse, best = rows[good[0] - 1 : good[0] + 1]
        part = np.log(target / best["error"]) / np.log(worse["error"] / best["error"])
        reached.append({key: float(best[key] ** (1.0 - part) * worse[key] ** part) for key in keys})
    return min(reached, key=lambda at: at["cpu"])
