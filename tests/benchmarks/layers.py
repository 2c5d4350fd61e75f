"""Time of a communication step, us, by component and layer.

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
from orchestrator.scene.parts import Part
from tests.benchmarks import own
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
    Column("model", "model's step, us", ".1f", COST),
    Column("slave", "slave's do_step, us", ".1f", COST),
    Column("values", "slave's get and set, us", ".1f", COST),
    Column("fmi", "FMI step, us", ".1f", COST),
    Column("exchange", "FMI get and set, us", ".1f", COST),
)


def measure(quick: bool, repeats: int) -> list[Table]:
    """Table of components."""
    stop = QUICK_STOP if quick else STOP
    rows: list[Row] = []
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
                    rows.append({"part": row, **replayed(own.part(scene, name), inputs, outputs, repeats)})
    window = f"{0.5 * stop:g} to {stop:g} s of `{SCENE}` that drives off at once, H = 1 ms"
    of_steps = f"CPU time, {window}: the least of {repeats} repeats of each step, their mean."
    nested = "Each layer has the one before in it; get and set come besides."
    return [Table.of_records("A step by part and layer", LAYERS, rows, (of_steps, nested))]


def replayed(part: Part, inputs: Series, outputs: Series, repeats: int) -> dict[str, float]:
    """Times of a component with recorded inputs by layer."""
    times: dict[str, list[Floats]] = {column.key: [] for column in LAYERS[1:]}
    for _ in range(repeats):
        for face, feed in (("model", _model), ("slave", _slave), ("FMU", _fmu)):
            durations, last = feed(part, inputs, len(outputs.names))
            if not np.array_equal(last, outputs.values[-1]):
                raise RuntimeError(f"{part.name}: the {face} does not repeat what the log holds")
            for key, each in durations.items():
                times[key].append(each)
    return {key: per_step(each, len(inputs.t) // 2) for key, each in times.items()}


Fed = tuple[dict[str, Floats], Floats]  # times of every step, us; last outputs


def _model(part: Part, inputs: Series, outputs: int) -> Fed:
    model, y = own.started(part), np.empty(outputs)
    (step,) = laps(len(inputs.t), lambda k: model.step(inputs.t[k], H, inputs.values[k]))
    model.outputs(y)
    return {"model": step}, y


def _slave(part: Part, inputs: Series, outputs: int) -> Fed:
    slave, u = own.slave(part), inputs.values.tolist()
    count = len(inputs.names)
    into, out, y = list(range(count)), list(range(count, count + outputs)), np.empty(outputs)

    def get(k: int) -> None:
        y[:] = slave.get_real(out)

    put, step, got = laps(
        len(u), lambda k: slave.set_real(into, u[k]), lambda k: slave.do_step(float(inputs.t[k]), H), get
    )
    return {"slave": step, "values": put + got}, y


def _fmu(part: Part, inputs: Series, outputs: int) -> Fed:
    with Component(build(part.kind, part.config), part.name) as component:
        component.initialise(part.parameters)

        def put(k: int) -> None:
            component.u[:] = inputs.values[k]
            component.write()

        into, step, out = laps(
            len(inputs.t), put, lambda k: component.step(float(inputs.t[k]), H), lambda k: component.read()
        )
        return {"fmi": step, "exchange": into + out}, component.y.copy()
