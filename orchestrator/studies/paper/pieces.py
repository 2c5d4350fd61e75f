"""A short piece of the drive by explicit methods: what each model costs at equal error (section 8.3).

The vehicle as one differential equation begins at the state that the implicit co-simulation of the model has at
``BEGIN``, in the middle of the ramp, and drives on for a piece. Adams' methods of variable step and order (the paper's)
run at several tolerances, the classical Runge-Kutta method at its largest stable step and below. The error of a run is
the RMS distance of the pins of the left chain, at the end, from those of the same model by Runge-Kutta at a fraction of
the step, over the RMS of the ways that they went. A method's cost is that of its cheapest run within ``EQUAL``; both
sides of the vehicle are alike and one of them is integrated, whatever the model. CPU times are medians of ``REPEATS``.

A step of Adams' methods ends at each output at the latest, and takes two evaluations: no run has fewer than two an
interval of output. Between these two the pins of rigid links are projected, which is no evaluation and counts as what
it takes of one: the number of evaluations with projections is N + steps times the time of a projection over that of an
evaluation.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fmus.physics.chain.kinds import close, derivative
from fmus.physics.chain.state import moving
from fmus.vehicle import BadInput
from orchestrator.execution.states import states_at
from orchestrator.log.time_series import Floats
from orchestrator.scene.scene import TrackScene
from orchestrator.studies.paper.links import storage
from orchestrator.studies.paper.models import RIGID_SPRING, named, scene
from orchestrator.studies.paper.states import LONGEST, whole
from orchestrator.studies.tables import Row

BEGIN = 4.0  # s
LONG, QUICK = 0.2, 0.02  # s, of a piece
OUTPUT = 1.25e-3  # s, the communication step of the scene: that of outputs
INTERVALS = 0.25, 1.0, 4.0, 16.0  # of output, times OUTPUT: what costs are shown over
AT = 1e-3  # tolerance at which they are
REPEATS = 3
PROJECTIONS, DRIFT = 21, 1e-8  # that are timed, and what a step drifts, m
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
    cpu: float  # s, median
    evaluations: int
    error: float
    order: float  # mean, of Adams' methods
    storage: float = math.nan  # bytes of all arrays that a chain steps with
    least: float = math.nan  # CPU time of the fastest run, s
    most: float = math.nan  # and of the slowest one
    steps: int = 0
    projection: float = math.nan  # CPU time of a projection, s
    interval: float = OUTPUT  # of output, s

    @property
    def counted(self) -> float:
        """Evaluations with projections."""
        one = (self.cpu - self.steps * self.projection) / self.evaluations
        return self.evaluations + self.steps * self.projection / one


def rows(name: str, piece: float, settings: tuple[str, ...] = (), intervals: tuple[float, ...] = ()) -> list[Row]:
    """The runs of a model, a row each, and the cheapest within EQUAL of each method.

    ``intervals`` of output, times OUTPUT, as long as the piece is: a row each, by Adams' methods at AT.
    """
    wanted = scene(named(name), "track.link_outputs=false", *settings)
    label = named(name).label
    if isinstance(wanted, str):
        return [Row("piece", label, {"model": name}, note=f"not there: {wanted}")]
    try:
        drive = Drive(wanted, piece)
        costs = [*drive.runs()]
        over = [drive.cost(ADAMS, AT, OUTPUT * part) for part in intervals if OUTPUT * part <= piece * (1.0 + 1e-9)]
    except (BadInput, RuntimeError, ValueError) as failure:
        return [Row("piece", label, {"model": name}, note=f"not there: {failure}")]
    common = {"model": name, "piece": piece}
    found = [Row("piece", label, {**common, **figures(cost)}) for cost in costs]
    found += [
        Row("interval", label, {**common, **figures(cost), "floor": 2 * round(piece / cost.interval)}) for cost in over
    ]
    for method in (ADAMS, RUNGE_KUTTA):
        best = cheapest(costs, method)
        if best is None:
            found.append(Row("cost", label, {**common, "method": method}, note=f"none is within {EQUAL:g}"))
        else:
            found.append(Row("cost", label, {**common, **figures(best)}, True))
    return found


def figures(cost: Cost) -> dict[str, Any]:
    """Of a run, with the time of one evaluation, s."""
    done = cost.evaluations > 0
    each, counted = (cost.cpu / cost.evaluations, cost.counted) if done else (math.nan, math.nan)
    return {**cost._asdict(), "each": each, "counted": counted}


def stiff(stiffness: float, piece: float) -> list[Row]:
    """The cost of the rigid chain that a spring of this stiffness, N/m, closes, by Adams' methods."""
    found = rows(RIGID_SPRING.name, piece, (f"track.closure_stiffness={stiffness!r}",))
    return [
        replace(row.having(stiffness=stiffness), item="stiffness")
        for row in found
        if row.item == "cost" and row["method"] == ADAMS
    ]


def cheapest(costs: list[Cost], method: str) -> Cost | None:
    """The run of a method that takes fewest evaluations within EQUAL; None where there is none."""
    good = [cost for cost in costs if cost.method == method and cost.error <= EQUAL]
    return min(good, key=lambda cost: cost.evaluations, default=None)


class Drive:
    """The piece of one model; raises what the monolith and the states raise."""

    def __init__(self, wanted: TrackScene, piece: float) -> None:
        self.wanted, self.piece = wanted, piece
        self.begun = states_at(_implicit(wanted), BEGIN)
        vehicle = whole(wanted, refine=FINER * FRACTIONS[-1])
        self._timed(vehicle, 1e-6, 1e-6)  # what has to be compiled or loaded is
        vehicle.begin_at(self.begun.time, self.begun.parts)
        start = vehicle.models[TRACK].pins()
        self._timed(vehicle, piece, OUTPUT)
        self.exact = vehicle.models[TRACK].pins()
        self.way = _rms(self.exact - start)

    def runs(self) -> Iterator[Cost]:
        """Runge-Kutta at each fraction, Adams at each tolerance, at outputs every OUTPUT."""
        for part in FRACTIONS:
            yield self.cost(RUNGE_KUTTA, part)
        for tolerance in TOLERANCES:
            yield self.cost(ADAMS, tolerance)

    def cost(self, method: str, setting: float, interval: float = OUTPUT) -> Cost:
        """Of a method at a fraction of the stable step, or at a tolerance; infinite error where it cannot be kept."""
        integration: dict[str, Any] = {"refine": setting}
        if method == ADAMS:  # no step is bounded but by outputs and errors
            integration = {"integrator": "adams", "rtol": setting, "atol": setting, "refine": LONGEST / interval}
        times = []
        try:
            vehicle = whole(self.wanted, **integration)
            self._timed(vehicle, 1e-6, 1e-6)
            for _ in range(REPEATS):
                before = vehicle.effort
                times.append(self._timed(vehicle, self.piece, interval))
        except RuntimeError:  # a tolerance too wide for it is a result
            return Cost(method, setting, np.nan, 0, np.inf, np.nan, interval=interval)
        chain, effort = vehicle.models[TRACK], vehicle.effort
        return Cost(
            method, setting, float(np.median(times)), int(effort.evaluations - before.evaluations),
            _rms(chain.pins() - self.exact) / self.way, float(effort.order), storage(chain)["bytes"], min(times),
            max(times), int(effort.steps - before.steps), projection(chain), interval,
        )  # fmt: skip

    def _timed(self, vehicle: Any, piece: float, interval: float) -> float:
        """CPU time, s, of a ``piece`` from BEGIN on with outputs every ``interval``, s."""
        vehicle.begin_at(self.begun.time, self.begun.parts)
        t, began = self.begun.time, time.process_time()
        for _ in range(round(piece / interval)):
            vehicle.advance(t, interval)
            t += interval
        return time.process_time() - began


def projection(chain: Any) -> float:
    """CPU time of taking back what a step did to the joints, s: the median of some, poses off by ``DRIFT``."""
    times, q = [], chain.s.q.copy()
    off = DRIFT * np.random.default_rng(0).standard_normal(q.shape)
    system = chain.system()
    rates = np.zeros(sum(part.size for part in moving(chain.s).values()))
    for _ in range(PROJECTIONS):
        chain.s.q[:] = q
        derivative(*system, chain.s, chain.work, rates)
        chain.s.q[:] += off
        began = time.thread_time()
        close(chain.link, chain.s, chain.work)
        times.append(time.thread_time() - began)
    chain.s.q[:] = q
    return float(np.median(times))


def _rms(off: Floats) -> float:
    """Of the lengths of vectors (n, 3)."""
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))


def _implicit(wanted: TrackScene) -> TrackScene:
    """The scene whose co-simulation leads to the piece: with implicit steps where the coordinates have none."""
    if wanted.track.coordinates is None:
        return wanted
    track = wanted.track.model_copy(update={"coordinates": None, "integrator": None})
    return wanted.model_copy(update={"track": track})
