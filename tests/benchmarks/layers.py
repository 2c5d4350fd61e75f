"""Time of a communication step, us: by component and layer, of the master, of a Newton iteration.

A run of ``straight`` is logged. Each component then gets its recorded inputs again, at each layer alone: model, slave
called from Python, FMU by fmpy. All do the same work to the last bit, which the log proves.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from fmus.fmi.build import build
from orchestrator.cosim.component import Component
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log, Series
from orchestrator.results.table import ABOUT, COST, Column, Table
from orchestrator.scene.parts import TRACK, Part
from tests.benchmarks import exchange, kernels, own
from tests.benchmarks.timing import Floats, laps, per_step

Row = dict[str, Any]

SCENE, H = "straight", 1e-3
STOP, QUICK_STOP = 2.0, 0.2  # s; figures are of the second half
SETTINGS = ("run.step=1 ms", "track.step=1 ms", "run.outputs=1", "drive.ramp_start=0 s")  # moves from the start
# Row: track model, settings, component; rows of one scene share its log.
COMPONENTS: dict[str, tuple[str, tuple[str, ...], str]] = {
    "track, flexible": ("flexible", (), "left_track"),
    "chassis": ("flexible", (), "chassis"),
    "drive": ("flexible", (), "left_drive"),
    "track, rigid": ("rigid", (), "left_track"),
    "track, beam": ("flexible", ("track.element=beam",), "left_track"),
}
LAYERS = (
    Column("part", "part", "", ABOUT),
    Column("kernel", "kernel, us", ".1f", COST),
    Column("model", "model's step, us", ".1f", COST),
    Column("slave", "slave's do_step, us", ".1f", COST),
    Column("values", "slave's get and set, us", ".1f", COST),
    Column("fmi", "FMI step, us", ".1f", COST),
    Column("exchange", "FMI get and set, us", ".1f", COST),
)
NEWTON = (
    Column("part", "chain of 64 links on the vehicle", "", ABOUT),
    Column("matrix", "evaluation with matrix, us", ".1f", COST),
    Column("residual", "residual alone, us", ".1f", COST),
    Column("factor", "factor, us", ".1f", COST),
    Column("solve", "solve, us", ".1f", COST),
    Column("evaluations", "evaluations a step", ".2f"),
    Column("matrices", "matrices a step", ".2f"),
)


def measure(quick: bool, repeats: int) -> list[Table]:
    """Tables of components, master and Newton iterations."""
    stop = QUICK_STOP if quick else STOP
    layers: list[Row] = []
    newton: list[Row] = []
    master: list[Row] = []
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        for track, settings in dict.fromkeys(each[:2] for each in COMPONENTS.values()):
            scene = own.scene(SCENE, track, (*SETTINGS, f"run.stop={stop} s", *settings))
            path = Path(folder) / "run.mcap"
            summary = simulate(scene, path)
            if summary["status"] != "ok":
                raise RuntimeError(summary["message"])
            for row, (*of, name) in COMPONENTS.items():
                if of == [track, settings]:
                    with Log(path) as log:
                        inputs, outputs = log.read(f"/{name}/in"), log.read(f"/{name}/out")
                    layer, iteration = replayed(own.part(scene, name), inputs, outputs, repeats)
                    layers.append({"part": row, **layer})
                    newton += [{"part": row.removeprefix("track, "), **iteration}] if iteration else []
            if not settings:
                master.append({"tracks": track, **exchange.measure(scene, Path(folder) / "again.mcap", repeats)})
    window = f"{0.5 * stop:g} to {stop:g} s of `{SCENE}` that drives off at once, H = 1 ms"
    of_steps = f"CPU time, {window}: the least of {repeats} repeats of each step, their mean."
    nested = "Each layer has the one before in it; get and set come besides."
    whole = "The same of the whole run. The exchange is a step without what happens inside the components."
    return [
        Table.of_records("A step by part and layer", LAYERS, layers, (of_steps, nested)),
        Table.of_records("A step of the vehicle outside its components", exchange.COLUMNS, master, (whole,)),
        Table.of_records("A Newton iteration", NEWTON, newton, (f"At the end of that; the least of {repeats} loops.",)),
    ]


def replayed(part: Part, inputs: Series, outputs: Series, repeats: int) -> tuple[dict[str, float], dict[str, float]]:
    """Times of a component with recorded inputs: by layer, and those of a track's Newton iteration."""
    times: dict[str, list[Floats]] = {column.key: [] for column in LAYERS[1:]}
    model = None
    for _ in range(repeats):
        model = own.started(part)
        for face, feed in (("kernel", _kernel), ("model", _model), ("slave", _slave), ("FMU", _fmu)):
            durations, last = feed(part, model, inputs, len(outputs.names))
            if not np.array_equal(last, outputs.values[-1]):
                raise RuntimeError(f"{part.name}: the {face} does not repeat what the log holds")
            for key, each in durations.items():
                times[key].append(each)
    steps = len(inputs.t)
    layer = {key: per_step(each, steps // 2) for key, each in times.items()}
    if model is None or part.stage != TRACK:
        return layer, {}
    evaluations, matrices = (model.counters[1:3] / steps).tolist()
    return layer, {**kernels.parts(part.kind, model, H, repeats), "evaluations": evaluations, "matrices": matrices}


Fed = tuple[dict[str, Floats], Floats]  # times of every step, us; last outputs


def _model(part: Part, model: Any, inputs: Series, outputs: int) -> Fed:
    y = np.empty(outputs)
    (step,) = laps(len(inputs.t), lambda k: model.step(inputs.t[k], H, inputs.values[k]))
    model.outputs(y)
    return {"model": step}, y


def _kernel(part: Part, _: Any, inputs: Series, outputs: int) -> Fed:
    model, kernel = own.started(part), list[float]()
    with kernels.timed(model, kernel):
        _, y = _model(part, model, inputs, outputs)
    return {"kernel": np.array(kernel)}, y


def _slave(part: Part, _: Any, inputs: Series, outputs: int) -> Fed:
    slave, u = own.slave(part), inputs.values.tolist()
    count = len(inputs.names)
    into, out, y = list(range(count)), list(range(count, count + outputs)), np.empty(outputs)

    def get(k: int) -> None:
        y[:] = slave.get_real(out)

    put, step, got = laps(
        len(u), lambda k: slave.set_real(into, u[k]), lambda k: slave.do_step(float(inputs.t[k]), H), get
    )
    return {"slave": step, "values": put + got}, y


def _fmu(part: Part, _: Any, inputs: Series, outputs: int) -> Fed:
    with Component(build(part.kind, part.config), part.name) as component:
        component.initialise(part.parameters)

        def put(k: int) -> None:
            component.u[:] = inputs.values[k]
            component.write()

        into, step, out = laps(
            len(inputs.t), put, lambda k: component.step(float(inputs.t[k]), H), lambda k: component.read()
        )
        return {"fmi": step, "exchange": into + out}, component.y.copy()
