"""Monolith of a scene: the components' own models as parts of one state, with their outputs.

The parts start as their FMUs do and have the same outputs; the monolith alone integrates them. A vehicle whose two
sides are alike is computed on its left side and mirrored, as by a chassis with left ports alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.cache.sources import ROOT, reachable_hash
from fmus.components import COMPONENT_KINDS, folder
from fmus.drives import mount as mounts
from fmus.drives import shaft
from fmus.interface.model import Floats, InvalidParameter, StepFailed
from fmus.interface.ports import TOLERANCE, TOLERANCES
from fmus.monolith.equations import (
    CHAIN_FAILED,
    CHASSIS_FAILED,
    DONE,
    STEP_TOO_SHORT,
    intervals,
    march,
    march_adaptively,
    ramps,
    rates,
    without_jumps,
)
from fmus.monolith.layout import Hull, Sources, hull, lay_out
from fmus.monolith.parts import (
    CHAINS,
    DIFFERENTIAL,
    SPROCKETS,
    MonolithPart,
    chain_size,
    chain_system,
    copy_state,
    initialised_model,
    mirror_chain,
    mirror_drive,
    mirrored,
    set_state,
    shaft_states,
    sprockets,
)
from fmus.monolith.spins import HALF, SPIN, side
from fmus.physics.integrate.adams import EVALUATIONS, ORDERS, REJECTED, RESTARTS, STEPS, adams
from fmus.physics.integrate.runge_kutta import RK4
from fmus.physics.rotation import quat_rotate
from fmus.physics.vector import vector
from fmus.track.choices import ADAMS, EXPLICIT

MAX_STEP = 1e-3  # s, internal step where nothing else bounds it
INTEGRATORS = EQUAL, ADAPTIVE = EXPLICIT, ADAMS


def content() -> str:
    """Hash of all sources that the monolith's physics can reach, those of the components' models included."""
    models = [
        reachable_hash(f"fmus.{folder(kind)}.model", ROOT / folder(kind) / "model.py") for kind in COMPONENT_KINDS
    ]
    return "".join([reachable_hash(__name__, Path(__file__)), *models])


class Effort(NamedTuple):
    """Counts of an integration so far."""

    steps: int
    evaluations: int  # of the whole right-hand side
    rejected: int  # steps
    restarts: int  # at order 1, without a past
    order: float  # mean of all steps


class Monolith:
    """Chains, chassis and drives of a scene as x' = f(t, x), integrated explicitly.

    ``integrator`` is "runge_kutta", the classical method in equal steps, or "adams", methods of variable step and order
    with the tolerances ``rtol`` and ``atol``, the latter in the units of the state, SI. A driver is not integrated: its
    demands follow from the outputs and hold until the next ones.

    ``connections`` name a source with its outputs and a target with its inputs. ``models``, by name, give the outputs.
    ``step`` is the internal step, s: the largest stable one over ``refine``, for Adams' methods an upper limit.
    ``halved`` = False computes both sides of a vehicle even if they are alike. ``effort`` counts steps and evaluations.
    Raises InvalidParameter or StepFailed if a part cannot start.
    """

    def __init__(
        self,
        parts: Sequence[MonolithPart],
        connections: Sequence[Any],
        refine: float = 1.0,
        halved: bool = True,
        integrator: str = EQUAL,
        rtol: float = TOLERANCE,
        atol: float = TOLERANCE,
    ) -> None:
        if integrator not in INTEGRATORS:
            raise InvalidParameter(f"integrator = '{integrator}': a monolith has {' and '.join(INTEGRATORS)}")
        for name, tolerance in (("rtol", rtol), ("atol", atol)):
            if not TOLERANCES.least <= tolerance <= TOLERANCES.most:
                raise InvalidParameter(f"{name} = {tolerance:g}: must be {TOLERANCES.text}")
        self.models = {part.name: initialised_model(part.kind, part.config, part.parameters) for part in parts}
        self._kinds = {part.name: part.kind for part in parts}
        self._mirrored = mirrored(parts) if halved else {}
        own = [part for part in parts if part.name not in self._mirrored]
        self._chains = [part.name for part in own if part.kind in CHAINS]
        self._joined = any(part.kind == DIFFERENTIAL for part in own)
        drives = [(part, self.models[part.name]) for part in own if part.kind in SPROCKETS]
        self._sprockets = [sprocket for drive in drives for sprocket in sprockets(*drive)]
        self._spun = [state for drive in drives for state in shaft_states(*drive)]
        self._shafts = [without_jumps(drive) for _, model in drives for drive in model.shafts]
        self._driver = next((part.name for part in own if part.kind == "Driver"), "")
        if not self._chains:
            raise InvalidParameter("a monolith needs a chain")
        if any("ground" in part.config["chassis"] for part in own if part.kind == "Chassis"):
            raise InvalidParameter("a monolith has no contact of hull and bare wheels with the ground")
        if any({"hitch", "seats"} & {*part.config["chassis"]} for part in own if part.kind == "Chassis"):
            raise InvalidParameter("a monolith tows nothing and has no seats: leave out [hitch] and seats")
        self._sources = Sources(connections)
        self._adaptive = (rtol, atol) if integrator == ADAPTIVE else None
        self._lay_out(next((part for part in own if part.kind == "Chassis"), None))
        self._begin()
        limits = []
        if not self._adaptive:
            limits = [self.models[name].stable_step for name in self._chains]
            limits += [1.0 / shaft.substeps(drive, 1.0) for drive in self._shafts]
        self.step = min([*limits, MAX_STEP]) / refine
        self.effort = Effort(0, 0, 0, 0, RK4.order)
        self._reached = np.nan  # s, by Adams' methods, whose past ends there

    # ---------------------------------------------------------------- start

    def _lay_out(self, part: MonolithPart | None) -> None:
        """Allocate state and sums, and collect the arguments of the kernels; ``part``: the chassis, if any."""
        chains = {name: self.models[name] for name in self._chains}
        sizes = [chain_size(model) for model in chains.values()]
        turned = self._shafts[:1] if self._joined else self._shafts  # the chassis does not turn a difference of sides
        chassis = hull(part, bool(self._mirrored), turned) if part else Hull()
        self._chassis, self._tree = chassis.name, chassis.tree
        size, self._sums, self._slots, self._ports = lay_out(
            chains, sizes, chassis, self._sprockets, self._joined, self._sources
        )
        self._body, self._spin, self._spins = self._ports.body, self._ports.shafts, self._ports.spins
        if self._adaptive:
            self._adams = adams(size, self._sums.size, *self._adaptive)
            self.x, self._y = self._adams.x[:size], self._adams.y[:size]
        else:
            self.x, self._y, self._k = np.zeros(size), np.zeros(size), np.zeros((len(RK4.b), size))
        self._system = (
            tuple(
                chain_system(model, slot, self._y[slot.start : slot.end])
                for model, slot in zip(chains.values(), self._slots, strict=True)
            ),
            tuple(self._shafts) or None,
            self._tree,
            self._ports,
        )

    def _begin(self) -> None:
        """Copy the models' states into x."""
        for name, slot in zip(self._chains, self._slots, strict=True):
            copy_state(self.models[name], self.x[slot.start : slot.end])
        if self._chassis:
            self.x[self._body : self._spin] = self.models[self._chassis].integrated
            self.x[self._spin - 1] += self._held() * self.x[self._body + 11] ** 2
        for d, state in enumerate(self._spun):
            self.x[self._spin + SPIN * d : self._spin + SPIN * (d + 1)] = state[:SPIN]
        for d, sprocket in enumerate(self._sprockets):
            sprocket.state[mounts.MOMENTUM : mounts.MOMENTUM + 3] = self._momentum(d)

    def begin_at(self, t: float, states: Mapping[str, Floats]) -> None:
        """Begin at t, s, with the flat states of the parts by name.

        The states are of components with the same configs and parameters; raises InvalidParameter if one does not fit.
        """
        for name, model in self.models.items():
            if name not in states or not model.copy_state(states[name]):
                raise InvalidParameter(f"{name}: the state that it is to begin with is not one of such a component")
        self._begin()
        self._y[:] = self.x
        rates(*self._system, t, self._y, np.zeros_like(self.x))  # evaluates the motions of the mounts
        for d, sprocket in enumerate(self._sprockets):
            sprocket.state[mounts.MOMENTUM : mounts.MOMENTUM + 3] = self._momentum(d)
        self.x[:] = self._y
        self._reached = np.nan

    def _of_side(self, d: int, i: int) -> float:
        """Value at side ``d`` of the number ``i`` of the shafts' state."""
        last = self._spin + SPIN * (len(self._spun) - 1) + i
        value: float = side(self._spins, d, self.x[self._spin + i], self.x[last])
        return value

    def _momentum(self, d: int) -> Floats:
        """Angular momentum J Omega a of a sprocket, N m s, world axes, with the mount as evaluated last."""
        sprocket, mount = self._sprockets[d], self._mount(d)
        q = mount[3:7] if np.any(mount[3:7]) else sprocket.rest_motion[3:7]
        axis = quat_rotate(q, (0.0, 1.0, 0.0))
        return sprocket.inertia * self._of_side(d, shaft.RATE) * np.array(axis)

    def _mount(self, d: int) -> Floats:
        start = 13 * self._spins.mount[d]
        return self._ports.motion[start : start + 13]

    # ---------------------------------------------------------------- time

    def advance(self, t: float, h: float) -> None:
        """Integrate from t to t + h, s, and update the models; raises StepFailed."""
        if self._driver:
            self._ask_driver(t, h)
        before = self.x[self._spin :].copy()
        for d in range(len(self._spun)):
            self.x[self._spin + SPIN * d + shaft.IMPULSE] = 0.0
        self._sums[:] = 0.0
        earlier = self.effort
        if self._adaptive:
            self._go_adaptively(t, h)
        else:
            self._go_equally(t, h)
        for name, slot in zip(self._chains, self._slots, strict=True):
            set_state(self.models[name], slot, self.x[slot.start : slot.end], h)
        if self._chassis:
            self._take_chassis()
        self._take_shafts(before, h)
        for d in range(len(self._sprockets)):
            self._take_sprocket(d, before, h)
        steps, evaluations, rejected = np.subtract(self.effort, earlier)[:3].astype(int).tolist()
        for name, model in self.models.items():
            if name != self._driver:
                model.counters[:2] += (steps, evaluations)
                model.counters[3:] += rejected
        for name, original in self._mirrored.items():
            if self._kinds[name] in CHAINS:
                mirror_chain(self.models[original], self.models[name])
            else:
                mirror_drive(self.models[original], self.models[name], self.models[self._chassis])

    def _go_equally(self, t: float, h: float) -> None:
        """Integrate by the classical Runge-Kutta method; raises StepFailed."""
        for interval in intervals(ramps(self._shafts), t, h, self.step):
            failure, done, where = march(*self._system, interval, self.x, self._y, self._k)
            if failure != DONE:
                raise self._failed(failure, where, interval.begin + done * interval.length / interval.steps)
            count = self.effort.steps + interval.steps
            self.effort = self.effort._replace(steps=count, evaluations=len(RK4.b) * count)

    def _go_adaptively(self, t: float, h: float) -> None:
        """Integrate by Adams' methods, restarted where a ramp or a driver's demand begins; raises StepFailed."""
        fresh = not abs(t - self._reached) < 1e-9 * h or bool(self._driver)
        known = ramps(self._shafts)
        for interval in intervals(known, t, h, self.step):
            fresh |= any(abs(end - interval.begin) < 1e-9 * h for ramp in known for end in ramp)
            failure, done, where = march_adaptively(*self._system, self._adams, self._sums, interval, fresh)
            if failure != DONE:
                raise self._failed(failure, where, interval.begin + done)
            fresh = False
        self._reached = t + h
        counts = self._adams.counts.tolist()
        steps, evaluations, rejected, restarts = (counts[i] for i in (STEPS, EVALUATIONS, REJECTED, RESTARTS))
        self.effort = Effort(steps, evaluations, rejected, restarts, counts[ORDERS] / steps)

    def _failed(self, failure: int, where: int, time: float) -> StepFailed:
        """Error of a part of a step that failed at ``time``, s."""
        if failure == CHASSIS_FAILED:
            chassis = self.models[self._chassis]
            return StepFailed(chassis.fault_sentence(time, where, self.x[self._body : self._spin]))
        if failure == STEP_TOO_SHORT:
            return StepFailed(f"at t = {time:.6g} s Adams' methods find no step that keeps their tolerances")
        if failure == CHAIN_FAILED:
            return StepFailed(f"at t = {time:.6g} s the equations of the chain have no solution, link {where + 1}")
        return StepFailed(f"the explicit integration of the whole blew up before t = {time:.6g} s")

    def _take_chassis(self) -> None:
        """Update the chassis; its ports' work leaves out the sprockets' part of its inertia. (5)"""
        model, x = self.models[self._chassis], self.x[self._body : self._spin]
        model.integrated[:] = x
        model.integrated[-1] -= self._held() * x[11] ** 2

    def _held(self) -> float:
        """Half of the sprockets' part of the chassis' inertia about its lateral axis, kg m2."""
        assert self._tree is not None
        return 0.5 * float(self._tree.inertia[1, 1] - self.models[self._chassis].tree.inertia[1, 1])

    def _ask_driver(self, t: float, h: float) -> None:
        """Step the driver, and let the speeds of the shafts follow its demands over the step."""
        driver, chassis = self.models[self._driver], self.models[self._chassis]
        names = [port.name for port in chassis.ports if port.causality == "output"]
        y = np.zeros(len(names))
        chassis.outputs(y[: len(names) - len(chassis.counters)])
        inputs = [port.name for port in driver.ports if port.causality == "input"]
        driver.step(t, h, np.array([y[names.index(self._sources.output(self._driver, name))] for name in inputs]))
        outputs = [port.name for port in driver.ports if port.causality == "output"]
        demands = np.zeros(len(outputs) - len(driver.counters))
        driver.outputs(demands)
        speeds = [
            demands[outputs.index(self._sources.output(s.name, f"{s.prefix}speed.demand"))] for s in self._sprockets
        ]
        if self._joined:
            speeds = [0.5 * (speeds[0] + speeds[1]), speeds[1] - speeds[0]]
        for drive, state, demand in zip(self._shafts, self._spun, speeds, strict=True):
            shaft.follow_demand(drive, state, t, h, demand, 0.0)

    def _take_shafts(self, before: Floats, h: float) -> None:
        """Update the state of each shaft, and the mean torque and power of its motor."""
        for d, state in enumerate(self._spun):
            z = self.x[self._spin + SPIN * d : self._spin + SPIN * (d + 1)]
            state[:SPIN] = z
            state[shaft.TORQUE_NOW] = z[shaft.IMPULSE] / h
            state[shaft.POWER_NOW] = (z[shaft.WORK] - before[SPIN * d + shaft.WORK]) / h

    def _take_sprocket(self, d: int, before: Floats, h: float) -> None:
        """Update a sprocket, the mean wrench on its mount and, with a differential, its half shaft. (6)"""
        state, mount = self._sprockets[d].state, self._mount(d)
        if self._joined:
            start = len(self._spun) * SPIN + HALF * d
            impulse, work, port = self.x[self._spin + start : self._spin + start + HALF]
            state[shaft.ANGLE], state[shaft.RATE] = self._of_side(d, shaft.ANGLE), self._of_side(d, shaft.RATE)
            state[shaft.WORK], state[shaft.PORT_WORK] = work, port
            state[shaft.TORQUE_NOW] = (impulse - before[start]) / h
            state[shaft.POWER_NOW] = (work - before[start + 1]) / h
        before_momentum = state[mounts.MOMENTUM : mounts.MOMENTUM + 3].copy()
        mounts.put_sprocket_motion(state, vector(mount, 0), mount[3:7], vector(mount, 7), vector(mount, 10))
        after = self._momentum(d)
        state[mounts.MOUNT : mounts.MOUNT + 3] = self._spins.force[d] / h
        state[mounts.MOUNT + 3 : mounts.MOUNT + 6] = (self._spins.reaction[d] - (after - before_momentum)) / h
        state[mounts.MOMENTUM : mounts.MOMENTUM + 3] = after
        state[mounts.BASE] = h
