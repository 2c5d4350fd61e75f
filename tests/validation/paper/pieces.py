"""Cost of each model at equal error in a short piece of drive by explicit methods (section 8.3).

The vehicle as one differential equation starts from the state of the model's implicit co-simulation at ``BEGIN``, in
the middle of the ramp, and drives on for a piece. Adams' methods of variable step and order (the paper's) run at
several tolerances, the classical Runge-Kutta method at its largest stable step and below. The error of a run is the RMS
distance of the left chain's pins, at the end, from those of the same model by Runge-Kutta at a fraction of the step,
over the RMS of their paths' lengths. The cost of a method is that of its cheapest run with an error within ``EQUAL``.
Both sides of the vehicle are alike, and one of them is integrated, whatever the model. CPU times are medians of
``REPEATS``. The speed of a machine may vary by more than two chains differ, so the cost of an evaluation is measured in
turn.

A step of Adams' methods ends at each output at the latest and takes two evaluations, so no run has fewer than two per
interval of output. Between these two, joints that are kept as equations are projected with the factors of the first
evaluation. A projection costs less than an evaluation, and counts as one in numbers "with projections".
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from fmus.vehicles.tables import BadInput
from orchestrator.execution.monolithic import states_at
from orchestrator.log.time_series import Floats
from orchestrator.scene.kinds import Scene
from orchestrator.studies import Row
from tests.validation.paper.links import storage
from tests.validation.paper.models import CLOSED, RIGID_SPRING, named, scene
from tests.validation.paper.states import MAX_STEP, whole

BEGIN = 4.0  # s
LONG, QUICK = 0.2, 0.02  # s, of a piece
OUTPUT = 1.25e-3  # s between outputs: communication step of the scene
INTERVALS = 0.25, 1.0, 4.0, 16.0  # intervals of output for costs, times OUTPUT
AT = 1e-3  # tolerance of costs over intervals
REPEATS = 3
TURNS = 5
EQUAL = 1e-4  # error of pins at which costs are compared
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)  # of Adams' methods, relative and absolute
FRACTIONS = (1.0, 2.0)  # of the largest stable step
FINER = 4.0  # of the reference, times the last fraction
STIFFNESSES = (1e9, 1e10, 1e11)  # of the closing spring, N/m
ADAMS, RUNGE_KUTTA = "Adams", "Runge-Kutta"
TRACK = "left_track"


class Cost(NamedTuple):
    """Cost and error of one run."""

    method: str
    setting: float  # tolerance, or fraction of the stable step
    cpu: float  # s, median
    evaluations: int
    error: float
    order: float  # mean, of Adams' methods
    storage: float = math.nan  # bytes of all arrays of a chain's step
    least: float = math.nan  # CPU time of the fastest run, s
    most: float = math.nan  # and of the slowest one
    steps: int = 0
    projections: int = 0
    interval: float = OUTPUT  # of output, s


def rows(name: str, piece: float, settings: tuple[str, ...] = (), intervals: tuple[float, ...] = ()) -> list[Row]:
    """Rows of all runs of a model, and of the cheapest within EQUAL of each method.

    ``intervals`` of output, times OUTPUT, up to the length of the piece: a row each, by Adams' methods at AT.
    """
    label = named(name).label
    try:
        drive = Drive(scene(named(name), "track.link_outputs=false", *settings), piece)
        costs = [*drive.runs()]
        over = [drive.cost(ADAMS, AT, OUTPUT * part) for part in intervals if OUTPUT * part <= piece * (1.0 + 1e-9)]
    except (BadInput, RuntimeError, ValueError) as failure:
        return [Row("piece", label, {"model": name}, note=f"not there: {failure}")]
    common = {"model": name, "piece": piece}
    results = [
        Row(item, label, {**common, **figures(cost), "floor": 2 * round(piece / cost.interval)})
        for item, several in (("piece", costs), ("interval", over))
        for cost in several
    ]
    for method in (ADAMS, RUNGE_KUTTA):
        best = cheapest(costs, method)
        if best is None:
            results.append(Row("cost", label, {**common, "method": method}, note=f"none is within {EQUAL:g}"))
        else:
            results.append(Row("cost", label, {**common, **figures(best)}, True))
    return results


def figures(cost: Cost) -> dict[str, Any]:
    """Figures of a run, with the time of one evaluation, s."""
    each = cost.cpu / cost.evaluations if cost.evaluations else math.nan
    return {**cost._asdict(), "each": each, "counted": cost.evaluations + cost.projections}


def in_turn(name: str, piece: float) -> list[Row]:
    """Rows by method: CPU time of an evaluation, closed mesh over a rigid model, timed in turn."""
    label, models = f"{CLOSED.name} / {name}", (CLOSED.name, name)
    try:
        drives = [Drive(scene(named(each), "track.link_outputs=false"), piece) for each in models]
    except BadInput as refusal:
        return [Row("each", label, {"rigid": name}, note=f"not there: {refusal}")]
    rows_by_method = []
    for method, setting in ((ADAMS, AT), (RUNGE_KUTTA, FRACTIONS[0])):
        vehicles = [drive.vehicle(method, setting) for drive in drives]
        each = np.array(
            [[drive.evaluation_time(one) for drive, one in zip(drives, vehicles, strict=True)] for _ in range(TURNS)]
        )
        ratios = each[:, 0] / each[:, 1]
        figures = {"each": float(np.median(ratios)), "least": float(ratios.min()), "most": float(ratios.max())}
        rows_by_method.append(Row("each", label, {"rigid": name, "method": method, "piece": piece, **figures}, True))
    return rows_by_method


def stiff(stiffness: float, piece: float) -> list[Row]:
    """Row of the cost, by Adams' methods, of the rigid chain closed by a spring of this stiffness, N/m."""
    rows_of_run = rows(RIGID_SPRING.name, piece, (f"track.closure_stiffness={stiffness!r}",))
    return [
        replace(row.with_figures(stiffness=stiffness), item="stiffness")
        for row in rows_of_run
        if row.item == "cost" and row["method"] == ADAMS
    ]


def cheapest(costs: list[Cost], method: str) -> Cost | None:
    """Run of a method with fewest evaluations within EQUAL; None without one."""
    good = [cost for cost in costs if cost.method == method and cost.error <= EQUAL]
    return min(good, key=lambda cost: cost.evaluations, default=None)


class Drive:
    """Piece of drive of one model; raises what the monolith and the states raise."""

    def __init__(self, scene: Scene, piece: float) -> None:
        self.scene, self.piece = scene, piece
        self.start_state = states_at(_implicit(scene), BEGIN)

    @cached_property
    def exact(self) -> tuple[Floats, float]:
        """Reference positions of the pins at the end, m, and the RMS of their displacements, m."""
        vehicle = whole(self.scene, refine=FINER * FRACTIONS[-1])
        self._timed(vehicle, 1e-6, 1e-6)  # compiles and loads
        vehicle.begin_at(self.start_state.time, self.start_state.parts)
        start = vehicle.models[TRACK].pins()
        self._timed(vehicle, self.piece, OUTPUT)
        end = vehicle.models[TRACK].pins()
        return end, _rms(end - start)

    def runs(self) -> Iterator[Cost]:
        """Yield runs of Runge-Kutta at each fraction, of Adams at each tolerance, with outputs every OUTPUT."""
        for part in FRACTIONS:
            yield self.cost(RUNGE_KUTTA, part)
        for tolerance in TOLERANCES:
            yield self.cost(ADAMS, tolerance)

    def vehicle(self, method: str, setting: float, interval: float = OUTPUT) -> Any:
        """Vehicle with a method at a fraction of the stable step or at a tolerance, compiled for timing."""
        integration: dict[str, Any] = {"refine": setting}
        if method == ADAMS:  # only outputs and errors limit steps
            integration = {"integrator": "adams", "rtol": setting, "atol": setting, "refine": MAX_STEP / interval}
        vehicle = whole(self.scene, **integration)
        self._timed(vehicle, 1e-6, 1e-6)
        return vehicle

    def evaluation_time(self, vehicle: Any) -> float:
        """CPU time of an evaluation, s."""
        before = vehicle.effort.evaluations
        return self._timed(vehicle, self.piece, OUTPUT) / float(vehicle.effort.evaluations - before)

    def cost(self, method: str, setting: float, interval: float = OUTPUT) -> Cost:
        """Cost of a method at a fraction of the stable step or a tolerance; infinite error if the run fails."""
        exact, way = self.exact
        times = []
        try:
            vehicle = self.vehicle(method, setting, interval)
            for _ in range(REPEATS):
                before = vehicle.effort
                times.append(self._timed(vehicle, self.piece, interval))
        except RuntimeError:  # failure at a wide tolerance is a result
            return Cost(method, setting, np.nan, 0, np.inf, np.nan, interval=interval)
        chain, effort, sizes = vehicle.models[TRACK], vehicle.effort, storage(vehicle.models[TRACK])
        steps = int(effort.steps - before.steps)
        return Cost(
            method, setting, float(np.median(times)), int(effort.evaluations - before.evaluations),
            _rms(chain.pins() - exact) / way, float(effort.order), sizes["bytes"], min(times), max(times),
            steps, steps if sizes["multipliers"] else 0, interval,
        )  # fmt: skip

    def _timed(self, vehicle: Any, piece: float, interval: float) -> float:
        """CPU time, s, of a ``piece`` from BEGIN on with outputs every ``interval``, s."""
        vehicle.begin_at(self.start_state.time, self.start_state.parts)
        t, began = self.start_state.time, time.process_time()
        for _ in range(round(piece / interval)):
            vehicle.advance(t, interval)
            t += interval
        return time.process_time() - began


def _rms(vectors: Floats) -> float:
    """RMS of the lengths of vectors (n, 3)."""
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


def _implicit(scene: Scene) -> Scene:
    """Scene of the co-simulation before the piece, changed to implicit steps if its model has none."""
    if scene.track.coordinates is None:
        return scene
    track = scene.track.model_copy(update={"coordinates": None, "integrator": None})
    return scene.model_copy(update={"track": track})
