"""A short piece of the drive by explicit methods: what each model costs at equal error (section 8.3).

The vehicle as one differential equation begins at the state that the implicit co-simulation of the model has at
``BEGIN``, in the middle of the ramp, and drives on for a piece. Adams' methods of variable step and order (the paper's)
run at several tolerances, the classical Runge-Kutta method at its largest stable step and below. The error of a run is
the RMS distance of the pins of the left chain, at the end, from those of the same model by Runge-Kutta at a fraction of
the step, over the RMS of the ways that they went. A method's cost is that of its cheapest run within ``EQUAL``; both
sides of the vehicle are alike and one of them is integrated, whatever the model.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fmus.vehicle import BadInput
from orchestrator.execution.states import states_at
from orchestrator.log.time_series import Floats
from orchestrator.scene.scene import TrackScene
from orchestrator.studies.paper.links import storage
from orchestrator.studies.paper.models import RIGID_SPRING, named, scene
from orchestrator.studies.paper.states import whole
from orchestrator.studies.tables import Row

BEGIN = 4.0  # s
LONG, QUICK = 0.2, 0.02  # s, of a piece
OUTPUT = 1.25e-3  # s, the communication step of the scene: that of outputs
EQUAL = 1e-4  # error of pins that costs are compared at
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)  # of Adams' methods, relative and absolute
FRACTIONS = (1.0, 2.0)  # of the largest stable step
FINER = 4.0  # the reference's, times the last
STIFFNESSES = (1e9, 1e10, 1e11)  # of the closing spring, N/m
ADAMS, RUNGE_KUTTA = "Adams", "Runge-Kutta"
TRACK = "left_track"


class Cost(NamedTuple):
    """One run."""

    method: str
    setting: float  # tolerance, or fraction of the stable step
    cpu: float  # s
    evaluations: int
    error: float
    order: float  # mean, of Adams' methods
    storage: float = math.nan  # bytes of all arrays that a chain steps with


def rows(name: str, piece: float, settings: tuple[str, ...] = ()) -> list[Row]:
    """The runs of a model, a row each, and the cheapest within EQUAL of each method."""
    wanted = scene(named(name), "track.link_outputs=false", *settings)
    label = named(name).label
    if isinstance(wanted, str):
        return [Row("piece", label, {"model": name}, note=f"not there: {wanted}")]
    try:
        costs = [*runs(wanted, piece)]
    except (BadInput, RuntimeError, ValueError) as failure:
        return [Row("piece", label, {"model": name}, note=f"not there: {failure}")]
    common = {"model": name, "piece": piece}
    found = [Row("piece", label, {**common, **figures(cost)}) for cost in costs]
    for method in (ADAMS, RUNGE_KUTTA):
        best = cheapest(costs, method)
        if best is None:
            found.append(Row("cost", label, {**common, "method": method}, note=f"none is within {EQUAL:g}"))
        else:
            found.append(Row("cost", label, {**common, **figures(best)}, True))
    return found


def figures(cost: Cost) -> dict[str, Any]:
    """Of a run, with the time of one evaluation, s."""
    return {**cost._asdict(), "each": cost.cpu / cost.evaluations if cost.evaluations else math.nan}


def stiff(stiffness: float, piece: float) -> list[Row]:
    """The cost of the rigid chain that a spring of this stiffness, N/m, closes, by Adams' methods."""
    found = rows(RIGID_SPRING.name, piece, (f"track.closure_stiffness={stiffness!r}",))
    return [
        replace(row.having(stiffness=stiffness), item="stiffness")
        for row in found
        if row.item == "cost" and row["method"] == ADAMS
    ]


def cheapest(costs: list[Cost], method: str) -> Cost | None:
    """The run of a method that takes least time within EQUAL; None where there is none."""
    good = [cost for cost in costs if cost.method == method and cost.error <= EQUAL]
    return min(good, key=lambda cost: cost.cpu, default=None)


def runs(wanted: TrackScene, piece: float) -> Iterator[Cost]:
    """All runs of a model; raises what the monolith and the states raise."""
    begun = states_at(_implicit(wanted), BEGIN)
    start, exact, *_ = _driven(wanted, begun, piece, refine=FINER * FRACTIONS[-1])
    way = float(np.sqrt(np.mean(np.sum((exact - start) ** 2, axis=1))))
    ways: list[tuple[str, float, dict[str, Any]]] = [
        *((RUNGE_KUTTA, part, {"refine": part}) for part in FRACTIONS),
        *((ADAMS, tol, {"integrator": "adams", "rtol": tol, "atol": tol}) for tol in TOLERANCES),
    ]
    for method, setting, integration in ways:
        try:
            _, pins, cpu, effort, size = _driven(wanted, begun, piece, **integration)
        except RuntimeError:  # a tolerance too wide for it is a result
            yield Cost(method, setting, np.nan, 0, np.inf, np.nan)
            continue
        off = float(np.sqrt(np.mean(np.sum((pins - exact) ** 2, axis=1)))) / way
        yield Cost(method, setting, cpu, int(effort.evaluations), off, float(effort.order), size)


def _implicit(wanted: TrackScene) -> TrackScene:
    """The scene whose co-simulation leads to the piece: with implicit steps where the coordinates have none."""
    if wanted.track.coordinates is None:
        return wanted
    track = wanted.track.model_copy(update={"coordinates": None, "integrator": None})
    return wanted.model_copy(update={"track": track})


def _driven(
    wanted: TrackScene, begun: Any, piece: float, **integration: Any
) -> tuple[Floats, Floats, float, Any, float]:
    """Pins (n, 3) before and after the piece, CPU time, s, effort, and bytes of a chain's arrays."""
    vehicle = whole(wanted, **integration)
    vehicle.begin_at(begun.time, begun.parts)
    before = vehicle.models[TRACK].pins()
    vehicle.advance(begun.time, 1e-6)  # what has to be compiled or loaded is
    vehicle.begin_at(begun.time, begun.parts)
    first, t = vehicle.effort, begun.time
    began = time.process_time()
    for _ in range(round(piece / OUTPUT)):
        vehicle.advance(t, OUTPUT)
        t += OUTPUT
    cpu = time.process_time() - began
    effort = vehicle.effort._replace(evaluations=vehicle.effort.evaluations - first.evaluations)
    chain = vehicle.models[TRACK]
    return before, chain.pins(), cpu, effort, storage(chain)["bytes"]
