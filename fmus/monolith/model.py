"""Monolith of a scene: the components' own models as parts of one state, with their outputs.

The parts start as their FMUs do and have the same outputs; the monolith alone integrates them. A vehicle whose two
sides are alike is computed on its left side and mirrored, as by a chassis with left ports alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.chassis.observe import put_sides
from fmus.drives import mount as mounts
from fmus.drives import shaft
from fmus.drives.motor import SPEED, TORQUE, Drive
from fmus.jit import reachable_hash
from fmus.model import Floats, InvalidParameter, StepFailed
from fmus.monolith import chains as chain_parts
from fmus.monolith.chains import BOOKS, Place
from fmus.monolith.equations import CHAIN_FAILED, CHASSIS_FAILED, DONE, TOO_SHARP, Plan, march, rates
from fmus.monolith.spins import HALF, SPIN, Spins, side
from fmus.physics.integrate.adams import EVALUATIONS, ORDERS, REJECTED, RESTARTS, STEPS, adams
from fmus.physics.integrate.runge_kutta import RK4
from fmus.physics.rotation import quat_rotate
from fmus.physics.vector import vector
from fmus.ports import STATE, TOLERANCE, TOLERANCES, WRENCH
from fmus.track_choices import ADAMS, EXPLICIT

RESOLVED = 32  # internal steps in a ramp of a drive's speed, at least
JUMP = 1e-7  # s, the shortest ramp: a shorter one is as long as this
LONGEST = 1e-3  # s, internal step where nothing else bounds it
INTEGRATORS = EQUAL, ADAPTIVE = EXPLICIT, ADAMS


CHAINS = ("TrackFlexible", "TrackRigid")  # kinds of parts that are chains
JOINED = "SteeringDifferential"
# prefixes of the sprockets of a kind of drive, and where each begins in its state
SPROCKETS = {"SprocketDrive": {"": 0}, JOINED: {"left.": 0, "right.": mounts.WIDTH}}
# where each shaft begins in its state
SHAFTS = {"SprocketDrive": (0,), JOINED: (2 * mounts.WIDTH, 2 * mounts.WIDTH + shaft.SHAFT)}


class Part(NamedTuple):
    """Component of a scene before it is initialised."""

    name: str  # of the instance
    kind: str  # of the FMU
    config: Mapping[str, Any]  # as packed into the FMU
    parameters: Mapping[str, float | int | str]  # set before initialisation


def content() -> str:
    """Hash of all sources that the monolith's physics can reach."""
    return reachable_hash(__name__, Path(__file__))


def _class(kind: str) -> Any:
    if kind == "TrackFlexible":
        from fmus.track_flexible.model import Model
    elif kind == "TrackRigid":
        from fmus.track_rigid.model import Model  # type: ignore[assignment]
    elif kind == "Chassis":
        from fmus.chassis.model import Model  # type: ignore[assignment]
    elif kind == "SprocketDrive":
        from fmus.sprocket_drive.model import Model  # type: ignore[assignment]
    elif kind == JOINED:
        from fmus.steering_differential.model import Model  # type: ignore[assignment]
    elif kind == "Driver":
        from fmus.driver.model import Model  # type: ignore[assignment]
    else:
        raise InvalidParameter(f"a monolith has no part of kind '{kind}'")
    return Model


def started(kind: str, config: Mapping[str, Any], parameters: Mapping[str, float | int | str]) -> Any:
    """Initialised model of a component; raises InvalidParameter or StepFailed."""
    model = _class(kind)(config)
    known = {port.name: port.start for port in model.ports if port.causality == "parameter"}
    unknown = [name for name in parameters if name not in known]
    if unknown:
        raise InvalidParameter(f"there is no parameter '{unknown[0]}'")
    model.initialise({**known, **parameters})
    return model


class Effort(NamedTuple):
    """Counts of an integration so far."""

    steps: int
    evaluations: int  # of the whole right-hand side
    rejected: int  # steps
    restarts: int  # at order 1, without a past
    order: float  # mean of all steps


class Sprocket(NamedTuple):
    """Sprocket of a drive."""

    name: str  # of the drive
    prefix: str  # of its variables there
    inertia: float  # of its spin, kg m2
    state: Floats  # (WIDTH) view of the drive's state
    standing: Floats  # (13) motion of its mount if that is not connected


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
        parts: Sequence[Part],
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
        self.models = {part.name: started(part.kind, part.config, part.parameters) for part in parts}
        self._kinds = {part.name: part.kind for part in parts}
        self._mirrored = _alike(parts) if halved else {}
        own = [part for part in parts if part.name not in self._mirrored]
        self._chains = [p.name for p in own if p.kind in CHAINS]
        self._sprockets, self._shafts, self._spun = [], [], []  # with the state of each shaft
        self._joined = any(part.kind == JOINED for part in own)
        for part in (part for part in own if part.kind in SPROCKETS):
            model = self.models[part.name]
            for (prefix, at), standing in zip(
                SPROCKETS[part.kind].items(), model.standing.reshape(-1, STATE), strict=True
            ):
                state = model.state[at : at + mounts.WIDTH]
                self._sprockets.append(Sprocket(part.name, prefix, model.inertia, state, standing))
            self._shafts += [_without_jumps(drive) for drive in model.shafts]
            self._spun += [model.state[at : at + shaft.SHAFT] for at in SHAFTS[part.kind]]
        self._driver = next((p.name for p in own if p.kind == "Driver"), "")
        self._chassis = next((p.name for p in own if p.kind == "Chassis"), "")
        if not self._chains:
            raise InvalidParameter("a monolith needs a chain")
        if any("ground" in part.config["chassis"] for part in own if part.kind == "Chassis"):
            raise InvalidParameter("a monolith has no contact of hull and bare wheels with the ground")
        self._sources = {
            (c.target, i): (c.source, o) for c in connections for i, o in zip(c.inputs, c.outputs, strict=True)
        }
        self._adaptive = (rtol, atol) if integrator == ADAPTIVE else None
        self._lay_out(own)
        limits = []
        if not self._adaptive:
            limits = [self.models[name].stable for name in self._chains]
            limits += [1.0 / shaft.substeps(drive, 1.0) for drive in self._shafts]
        self.step = min([*limits, LONGEST]) / refine
        self.effort = Effort(0, 0, 0, 0, RK4.order)
        self._reached = np.nan  # s, by Adams' methods, whose past ends there

    # ---------------------------------------------------------------- layout

    def _lay_out(self, own: Sequence[Part]) -> None:
        """Allocate the state and the sums, and resolve the connections to indices."""
        models, chains, sprockets = self.models, self._chains, self._sprockets
        sizes = [chain_parts.size(models[name]) for name in chains]
        body, tree, sides = sum(sizes), None, 0
        stations: list[str] = []
        if self._chassis:
            part = next(p for p in own if p.name == self._chassis)
            config = part.config
            if self._mirrored:
                config = {**config, "chassis": {"sides": ["left"]}}
            chassis = started(part.kind, config, part.parameters)
            sides = len(config["chassis"]["sides"])
            ports = [p.name for p in chassis.ports if p.causality == "output"]
            stations = [n.removesuffix(".position.x") for n in ports if n.endswith(".position.x")][:-1]
            tree = self._with_spins(chassis.tree, 2 // sides)
            inputs = [p.name for p in chassis.ports if p.causality == "input" and p.name.endswith(".force.x")]
        width = chassis.state.size if self._chassis else 0
        self._body, self._spin = body, body + width
        size = body + width + SPIN * len(sprockets) + (2 * HALF if self._joined else 0)
        counts = [(len(models[n].wheel_list) + 1) * WRENCH + int(np.prod(models[n].felt)) + BOOKS for n in chains]
        self._sums = np.zeros(sum(counts) + WRENCH * len(sprockets))
        rest = self._sums

        def summed(*shape: int) -> Floats:
            """Take the next view of ``_sums``."""
            nonlocal rest
            part, rest = np.split(rest, [int(np.prod(shape))])
            return part.reshape(shape)

        if self._adaptive:
            self._adams = adams(size, self._sums.size, *self._adaptive)
            self.x, self._y = self._adams.x[:size], self._adams.y[:size]
        else:
            self.x, self._y, self._k = np.zeros(size), np.zeros(size), np.zeros((len(RK4.b), size))

        motions = {(self._chassis, station): i for i, station in enumerate(stations)}
        count, fixed = len(stations), len(sprockets)
        motions |= {(s.name, f"{s.prefix}sprocket"): count + fixed + d for d, s in enumerate(sprockets)}
        motion = np.zeros(STATE * (count + 2 * fixed))
        mount = np.zeros(fixed, dtype=np.int64)
        for d, sprocket in enumerate(sprockets):
            source = self._source(sprocket.name, f"{sprocket.prefix}mount.position.x")
            mount[d] = count + d if source is None else motions[source]
            motion[13 * (count + d) : 13 * (count + d + 1)] = sprocket.standing

        wrenches: dict[tuple[str, str], int] = {}
        places, start, block = [], 0, 0
        for name, size in zip(chains, sizes, strict=True):
            model = models[name]
            names = [wheel["name"] for wheel in model.wheel_list]
            seen = [motions[self._needed(name, f"{wheel}.position.x")] for wheel in names]
            m = len(names)
            wrenches |= {(name, wheel): block + i for i, wheel in enumerate(names)}
            places.append(
                Place(
                    start,
                    start + size,
                    np.array(seen, dtype=np.int64),
                    block,
                    model.frame,
                    summed(m + 1, WRENCH),
                    summed(*model.felt),
                    summed(BOOKS),
                )
            )
            start, block = start + size, block + m + 1
        chain = [wrenches[self._needed(s.name, f"{s.prefix}sprocket.force.x")] for s in sprockets]
        wrenches |= {(s.name, f"{s.prefix}mount"): block + d for d, s in enumerate(sprockets)}
        acting = []
        if self._chassis:
            acting = [wrenches[self._needed(self._chassis, name)] for name in inputs]
        units = max([len(acting) * WRENCH, *(STATE * len(p.seen) for p in places)])
        self._spins = Spins(
            joined=int(self._joined),
            start=self._spin,
            body=self._body,
            inertia=np.array([sprocket.inertia for sprocket in sprockets]),
            stations=count,
            mount=mount,
            chain=np.array(chain, dtype=np.int64),
            mounts=block,
            spun=np.zeros((fixed, mounts.WIDTH)),
            seen=np.zeros((fixed, 2)),
            growth=np.zeros(fixed),
            pace=np.zeros(fixed),
            reaction=summed(fixed, 3),
            force=summed(fixed, 3),
        )
        self._plan = Plan(
            motion,
            np.zeros(WRENCH * (block + fixed)),
            np.zeros(units),
            count,
            sides,
            np.array(acting, dtype=np.int64),
            self._body,
            self._spin,
            self._spins,
        )
        self._places = places
        self._tree = tree
        self._system = (
            tuple(
                chain_parts.chain(models[name], place, self._y[place.start : place.end])
                for name, place in zip(chains, places, strict=True)
            ),
            tuple(self._shafts) or None,
            tree,
            self._plan,
        )
        self._begin()

    def _source(self, target: str, variable: str) -> tuple[str, str] | None:
        """Part and connector of the source of an input; None if the input is not connected."""
        found = self._sources.get((target, variable))
        return found and (found[0], found[1].rsplit(".", 2)[0])

    def _needed(self, target: str, variable: str) -> tuple[str, str]:
        source = self._source(target, variable)
        if source is None:
            raise InvalidParameter(f"{target}: the input {variable} is not connected")
        return source

    def _with_spins(self, tree: Any, times: int) -> Any:
        """Add the spin inertia of sprockets with prescribed speed against the chassis to the tree. (3)"""
        inertia = tree.inertia.copy()
        seen = self._shafts[:1] if self._joined else self._shafts  # the difference of the sides has no part in it
        inertia[1, 1] += times * sum(drive.inertia for drive in seen if drive.mode == SPEED)
        return tree._replace(inertia=inertia)

    def _begin(self) -> None:
        """Copy the models' states into x."""
        for name, place in zip(self._chains, self._places, strict=True):
            chain_parts.give(self.models[name], self.x[place.start : place.end])
        if self._chassis:
            self.x[self._body : self._spin] = self.models[self._chassis].state
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
            if name not in states or not model.hold(states[name]):
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
        found: float = side(self._spins, d, self.x[self._spin + i], self.x[last])
        return found

    def _momentum(self, d: int) -> Floats:
        """Angular momentum J Omega a of a sprocket, N m s, world axes, with the mount as evaluated last."""
        sprocket, mount = self._sprockets[d], self._mount(d)
        q = mount[3:7] if np.any(mount[3:7]) else sprocket.standing[3:7]
        axis = quat_rotate(q, (0.0, 1.0, 0.0))
        return sprocket.inertia * self._of_side(d, shaft.RATE) * axis

    def _mount(self, d: int) -> Floats:
        at = 13 * self._spins.mount[d]
        return self._plan.motion[at : at + 13]

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
        for name, place in zip(self._chains, self._places, strict=True):
            chain_parts.take(self.models[name], place, self.x[place.start : place.end], h)
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
        for name, of in self._mirrored.items():
            if self._kinds[name] in CHAINS:
                chain_parts.mirror(self.models[of], self.models[name])
            else:
                _mirror_drive(self.models[of], self.models[name], self.models[self._chassis])

    def _go_equally(self, t: float, h: float) -> None:
        """Integrate by the classical Runge-Kutta method; raises StepFailed."""
        for begin, length, steps in self._intervals(t, h):
            failure, done, where = march(*self._system, begin, length, steps, self.x, self._y, self._k)
            if failure != DONE:
                raise self._failed(failure, where, begin + done * length / steps)
            count = self.effort.steps + steps
            self.effort = self.effort._replace(steps=count, evaluations=len(RK4.b) * count)

    def _go_adaptively(self, t: float, h: float) -> None:
        """Integrate by Adams' methods, restarted where a ramp or a driver's demand begins; raises StepFailed."""
        from fmus.monolith.adaptive import march as go

        fresh = not abs(t - self._reached) < 1e-9 * h or bool(self._driver)
        for begin, length, steps in self._intervals(t, h):
            fresh |= any(abs(end - begin) < 1e-9 * h for ramp in self._ramps() for end in ramp)
            failure, done, where = go(*self._system, self._adams, self._sums, begin, length, length / steps, fresh)
            if failure != DONE:
                raise self._failed(failure, where, begin + done)
            fresh = False
        self._reached = t + h
        counts = self._adams.counts.tolist()
        steps, evaluations, rejected, restarts = (counts[i] for i in (STEPS, EVALUATIONS, REJECTED, RESTARTS))
        self.effort = Effort(steps, evaluations, rejected, restarts, counts[ORDERS] / steps)

    def _ramps(self) -> list[tuple[float, float]]:
        """Begin and end, s, of the time intervals in which the right-hand side is smooth."""
        ramps = [ramp for drive in self._shafts if drive.mode != TORQUE for ramp in _ramps(drive)]
        for course in (each for drive in self._shafts for each in (drive.torques, drive.brakes)):
            ramps += pairwise(course.time.tolist())
        return ramps

    def _intervals(self, t: float, h: float) -> Iterator[tuple[float, float, int]]:
        """Begin, length (s) and steps of the parts of a step, split at the ends of speed ramps. (7)"""
        ramps = self._ramps()
        inside = {end for ramp in ramps for end in ramp if t + 1e-9 * h < end < t + (1.0 - 1e-9) * h}
        for begin, end in pairwise([t, *sorted(inside), t + h]):
            within = [(b - a) / RESOLVED for a, b in ramps if a < 0.5 * (begin + end) < b]
            yield begin, end - begin, max(1, int(np.ceil((end - begin) / min([self.step, *within]) - 1e-9)))

    def _failed(self, failure: int, where: int, at: float) -> StepFailed:
        """Error of a part of a step that failed at the time ``at``, s."""
        if failure == CHASSIS_FAILED:
            chassis = self.models[self._chassis]
            return StepFailed(chassis.complaint(at, where, self.x[self._body : self._spin]))
        if failure == TOO_SHARP:
            return StepFailed(f"at t = {at:.6g} s Adams' methods find no step that keeps their tolerances")
        if failure == CHAIN_FAILED:
            return StepFailed(f"at t = {at:.6g} s the equations of the chain have no solution, link {where + 1}")
        return StepFailed(f"the explicit integration of the whole blew up before t = {at:.6g} s")

    def _take_chassis(self) -> None:
        """Update the chassis; its ports' work leaves out the sprockets' part of its inertia. (5)"""
        model, x = self.models[self._chassis], self.x[self._body : self._spin]
        model.state[:] = x
        model.state[-1] -= self._held() * x[11] ** 2

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
        wanted = [port.name for port in driver.ports if port.causality == "input"]
        driver.step(t, h, np.array([y[names.index(self._sources[self._driver, name][1])] for name in wanted]))
        shown = [port.name for port in driver.ports if port.causality == "output"]
        demands = np.zeros(len(shown) - len(driver.counters))
        driver.outputs(demands)
        told = [demands[shown.index(self._sources[s.name, f"{s.prefix}speed.demand"][1])] for s in self._sprockets]
        if self._joined:
            told = [0.5 * (told[0] + told[1]), told[1] - told[0]]
        for drive, state, demand in zip(self._shafts, self._spun, told, strict=True):
            shaft.follow(drive, state, t, h, demand)

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
            at = len(self._spun) * SPIN + HALF * d
            impulse, work, port = self.x[self._spin + at : self._spin + at + HALF]
            state[shaft.ANGLE], state[shaft.RATE] = self._of_side(d, shaft.ANGLE), self._of_side(d, shaft.RATE)
            state[shaft.WORK], state[shaft.PORT_WORK] = work, port
            state[shaft.TORQUE_NOW] = (impulse - before[at]) / h
            state[shaft.POWER_NOW] = (work - before[at + 1]) / h
        held = state[mounts.MOMENTUM : mounts.MOMENTUM + 3].copy()
        mounts.place(state, vector(mount, 0), mount[3:7], vector(mount, 7), vector(mount, 10))
        after = self._momentum(d)
        state[mounts.MOUNT : mounts.MOUNT + 3] = self._spins.force[d] / h
        state[mounts.MOUNT + 3 : mounts.MOUNT + 6] = (self._spins.reaction[d] - (after - held)) / h
        state[mounts.MOMENTUM : mounts.MOMENTUM + 3] = after
        state[mounts.STEP] = h


def _without_jumps(drive: Drive) -> Drive:
    """The drive with jumps of speed replaced by ramps of JUMP s, because a jump has no slope to integrate."""
    return drive._replace(ramp_end=max(drive.ramp_end, drive.ramp_start + JUMP), stop_time=max(drive.stop_time, JUMP))


def _ramps(drive: Drive) -> list[tuple[float, float]]:
    """Begin and end of the ramps of a drive's speed, s."""
    if drive.speeds.time.size:
        return list(pairwise(drive.speeds.time.tolist()))
    ramps = [(drive.ramp_start, drive.ramp_end)]
    return [*ramps, (drive.stop_start, drive.stop_start + drive.stop_time)] if drive.stop_start >= 0.0 else ramps


def _alike(parts: Sequence[Part]) -> dict[str, str]:
    """Left part of each right part that mirrors it, by name; empty if the sides differ in anything."""
    named = {part.name: part for part in parts}
    pairs = {name: name.replace("right", "left", 1) for name in named if name.startswith("right")}
    chassis = next((part for part in parts if part.kind == "Chassis"), None)
    if chassis is None or list(chassis.config["chassis"]["sides"]) != ["left", "right"]:
        return {}
    for right, left in pairs.items():
        if left not in named or (named[left].kind, named[left].config) != (
            named[right].kind,
            named[right].config,
        ):
            return {}
        mirrored = dict(named[right].parameters)
        mirrored["start.lateral"] = -float(mirrored["start.lateral"])
        if dict(named[left].parameters) != mirrored:
            return {}
    return pairs if len(parts) == 2 * len(pairs) + 1 else {}


def _mirror_drive(of: Any, model: Any, chassis: Any) -> None:
    """Make ``model`` the mirror image of the drive ``of`` the other side; the chassis moves symmetrically."""
    motions = np.zeros(STATE * (len(chassis.tree.turns) + 2))
    put_sides(chassis.tree, chassis.state, 2, motions, 0)
    mount, state = motions[-STATE:], model.state
    axis = quat_rotate(mount[3:7], (0.0, 1.0, 0.0))
    state[:] = of.state
    mounts.place(state, vector(mount, 0), mount[3:7], vector(mount, 7), vector(mount, 10))
    for at, sign in ((mounts.MOUNT, 1.0), (mounts.MOUNT + 3, -1.0), (mounts.MOMENTUM, -1.0)):
        v = of.state[at : at + 3]
        state[at : at + 3] = sign * (v - 2.0 * (v @ axis) * axis)
