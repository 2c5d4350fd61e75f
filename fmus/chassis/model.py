"""Chassis component: ports, start, steps of the tree's equations of motion, outputs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.chassis.dynamics import ENERGY_SUMS, LEAF, Parts
from fmus.chassis.fittings import Fittings
from fmus.chassis.leaf import ROOT
from fmus.chassis.observe import write_outputs
from fmus.chassis.steps import NUMBERS, begin, step, step_failure
from fmus.chassis.tree import WHOLE, LinearSprings, VehicleTree, fastest_rate, tree
from fmus.interface import numbers, wrenches
from fmus.interface.defaults import parameter_values
from fmus.interface.model import TOO_MANY_STEPS, ComponentModel, FreeParameters, InvalidParameter
from fmus.interface.ports import POSITIVE, WRENCH, Port, motion_ports, start_pose_ports, wrench_ports
from fmus.interface.sentences import GAPS, Sentence, format_sentence
from fmus.physics.arrays import Floats
from fmus.physics.integrate.runge_kutta import RK4
from fmus.start import FRAME, KEYS, roll_pitch_quaternion, stance
from fmus.vehicles.sides import SIDES, of_side, smooth_wheels

RESOLVED = 0.5  # largest product of the default internal step and a rate
SPRING = ("stiffness", "damping", "preload")
UP = "up is positive of a trailing arm"
LEAST_STEP, MOST_STEP, MOST_STEP_ON_GROUND = 1e-5, 1e-3, 1e-4  # s: bounds of that default


def default_step(tree: VehicleTree, vehicle: Mapping[str, Any], ground: Mapping[str, Any] | None) -> float:
    """Internal step, s, that resolves springs and dampers, and friction of bare wheels on the ground."""
    rate, most = fastest_rate(tree), MOST_STEP_ON_GROUND if ground else MOST_STEP
    if ground and ground["bare"]:
        wheel, law = vehicle["road_wheel"], vehicle["contact"]["ground"]
        load = tree.masses[WHOLE] * tree.gravity[0] / (2 * len(wheel["x"]))
        force = law["friction"] * load
        slowing = float(np.max(force * np.square(wheel["radius"]) / wheel["spin_inertia"]))  # of a sliding wheel, m/s2
        rate = max(rate, slowing / law["friction_velocity"])
    return max(LEAST_STEP, min(most, RESOLVED / max(rate, 1.0)))


def stations(vehicle: Mapping[str, Any]) -> list[str]:
    """Names of the places of a side on which a track acts: its smooth wheels, then the sprocket."""
    return [*(wheel["name"] for wheel in smooth_wheels(vehicle)), "sprocket"]


def spring_ports(tree: VehicleTree, vehicle: Mapping[str, Any], side: str, first: int) -> list[Port]:
    """Outputs of the arms and springs of a side, whose leaves begin with ``first``."""
    ports, springs = [], tree.suspension
    has_elements = not isinstance(springs, LinearSprings)
    if has_elements:
        from fmus.chassis.suspension.elements import output_ports
    for k, wheel in enumerate(smooth_wheels(of_side(vehicle, side)), first):
        if wheel["tensioner"]:
            name = wheel["name"]
            push = f"push of the {side} tensioner on its {name}, away from the sprocket"
            ports.append(Port(f"{side}.{name}.tensioner.force".replace(".idler.", "."), "output", "N", push))
            ports += output_ports(springs, f"{side}.{name}") if wheel["tensioner"].get("recoil") else []
        if not tree.is_arm[k]:
            continue
        arm, spring = f"{side}.road_arm[{k - first + 1}]", f"{side}.suspension[{k - first + 1}]"
        ports.append(Port(f"{arm}.angle", "output", "rad", f"rotation of {arm} from the drawn position, {UP}"))
        if tree.drawn_length[k]:
            ports += [
                Port(f"{spring}.force", "output", "N", f"push of spring and damper of {spring}"),
                Port(f"{spring}.length", "output", "m", f"length of {spring}"),
            ]
        ports += output_ports(springs, arm) if has_elements else []
    return ports


def spring_names(vehicle: Mapping[str, Any]) -> list[tuple[str | None, ...]]:
    """Names of stiffness, damping and preload of each leaf; None for a number that it does not have."""
    found: list[tuple[str | None, ...]] = []
    for side in SIDES:
        own = (vehicle.get("right") or {}).get("suspension") if side == "right" else None
        table = of_side(vehicle, side)["suspension"] or {}
        for k in range(1, len(vehicle["road_wheel"]["x"]) + 1):
            names: list[str | None] = []
            for key in SPRING:
                above = "right." if own and own.get(key) is not None else ""
                index = f"[{k}]" if isinstance(table.get(key), list | tuple) else ""
                names.append(None if table.get(key) is None else f"{above}suspension.{key}{index}")
            found.append(tuple(names))
        for wheel in smooth_wheels(of_side(vehicle, side))[len(vehicle["road_wheel"]["x"]) :]:
            own = (((vehicle.get("right") or {}).get("wheel") or {}).get(wheel["name"]) or {}).get("tensioner")
            above = "" if wheel["kind"] == "idler" else f"wheel.{wheel['name']}."
            above = f"right.{above}" if own and side == "right" else above
            found.append(tuple(f"{above}tensioner.{key}" if wheel["tensioner"] else None for key in SPRING))
    return found


def chassis_ports() -> list[Port]:
    """Pose and progress of the chassis."""
    *motion, yaw_rate = motion_ports("chassis", "output")
    return [
        *motion,
        yaw_rate._replace(text=f"{yaw_rate.text}: its yaw rate"),
        Port("pitch", "output", "rad", "pitch of the chassis about y, nose down is positive"),
        Port("roll", "output", "rad", "roll of the chassis about x, right side down is positive"),
        Port("yaw", "output", "rad", "yaw of the chassis about z, from the world's x axis"),
        Port("speed", "output", "m/s", "velocity of the chassis' centre of mass along the chassis' x axis"),
        Port("distance", "output", "m", "way of the chassis' centre of mass along the start heading"),
        Port("settlement", "output", "m", "how far the chassis' centre of mass is below its drawn place"),
        *(
            Port(f"body_rate.{axis}", "output", "rad/s", f"{text} rate of the chassis about its own {axis} axis")
            for axis, text in zip("xyz", ("roll", "pitch", "yaw"), strict=True)
        ),
    ]


def touch_ports() -> list[Port]:
    """Outputs of a chassis that touches the ground."""
    force = "of the ground on hull and bare wheels, world"
    return [
        Port("energy.contact", "output", "J", "energy stored in contact springs"),
        *(Port(f"ground.force.{axis}", "output", "N", f"{axis} force {force}") for axis in "xyz"),
    ]


def failure_sentences(parts: tuple[str, ...]) -> tuple[Sentence, ...]:
    """Sentences of failures; ``parts``: name of the part of the vehicle by entry of the state."""
    beyond = "at t = {0:.6g} s the {1:name} is beyond its reach, {2:.3g} %s from its drawn position"
    return (
        Sentence(""),
        Sentence("at t = {0:.6g} s the motion of the {1:name} is not finite", parts),
        Sentence("at t = {0:.6g} s the chassis turns too fast for the internal step: its quaternion lost its length"),
        Sentence(beyond % "rad", parts),
        Sentence(beyond % "m", parts),
        TOO_MANY_STEPS,
    )


class Model(ComponentModel):
    """Chassis, road arms, springs, wheels, idlers, rollers, sprocket masses, on the sides that have ports.

    ``config``: {"vehicle": vehicle table in SI, "chassis": {"sides": ["left", "right"] or ["left"], "ground"}}. With
    the left side alone the right side is computed too, with the left side's wrenches mirrored. ``ground``, where hull
    or bare wheels touch it: see ``contacts.contacts``. ``start``: a ``fmus.rest.equilibrium.VehicleEquilibrium`` as a
    mapping, by default the drawn position. ``push``, N: the part of tensioner.preload that balances a track; the
    tensioner of a side without a track lacks it. The parameter tensioner.preload is that of the left side; the right
    one differs from it as in the vehicle table. ``hitch``: true for a chassis that tows at the ``hitch`` of the vehicle
    table; ``seats``: names of its seats whose motion is an output.
    """

    start_kernel, step_kernel, output_kernel = staticmethod(begin), staticmethod(step), staticmethod(write_outputs)
    warning_sentences: tuple[Sentence, ...] = (
        Sentence(
            "the vehicle does not start in equilibrium: in the first step the hull rises or falls with {0:.2g} m/s2 and"
            " an idler's push and its track differ by {1:.2g} %, because {2:name}",
            (
                "a number is another than that with which rest.* was found, or other tracks act on it",
                *(f"rest.* does not count the {load}" for load in ("pull at its hitch", "torque of its drives")),
                "rest.* does not count the pull at its hitch and the torque of its drives",
            ),
        ),
    )  # then that of wrenches that swing

    @classmethod
    def reads(cls, config: Mapping[str, Any]) -> list[str]:
        """See ``ComponentModel``."""
        chassis = config["chassis"]
        ground = chassis.get("ground") or {}
        hull = bool(ground.get("hull"))
        body, wheel = ("mass", "inertia", "centre"), ("mass", "spin_inertia", "transverse_inertia", "x", "z")
        further = [f"wheel.{name}." for name in config["vehicle"].get("wheel") or ()]
        width = ["width"] if ground else []
        return [
            "gravity",
            *(f"chassis.{key}" for key in (*body, *(["hull"] if hull else []))),
            "sprocket.mass",
            "sprocket.transverse_inertia",
            *(f"{above}{key}" for above in ("idler.", *further) for key in (*wheel, "radius", *width)),
            *(f"road_wheel.{key}" for key in (*wheel, *(["radius", *width] if ground else []))),
            *(f"return_roller.{key}" for key in wheel if config["vehicle"].get("return_roller")),
            "road_arm",
            "suspension",
            *(f"{above}tensioner.{key}" for above in ("", *further) for key in (*SPRING, "angle", "recoil")),
            "track.lateral",
            "right",
            *(["contact.ground", "track.face", "track.grouser"] if ground else []),
            *(["hitch"] if chassis.get("hitch") else []),
            *(f"seat.{name}" for name in chassis.get("seats", ())),
        ]

    def __init__(self, config: Mapping[str, Any]) -> None:
        vehicle, sides = config["vehicle"], list(config["chassis"]["sides"])
        if sides not in (["left", "right"], ["left"]):
            raise InvalidParameter(f"chassis.sides = {sides} must be ['left', 'right'] or ['left']")
        self.sides = sides
        self.tree = tree(vehicle, len(sides))
        self._vehicle, self._ground = vehicle, config["chassis"].get("ground")
        self._set_numbers(config)
        self._contacts: Any = None
        x, y, z = map(float, vehicle["chassis"]["centre"])
        self._centre = x, y, z
        places = [f"{side}.{name}" for side in sides for name in stations(vehicle)]
        self._fittings = Fittings(vehicle, config["chassis"], WRENCH * len(places), ROOT + LEAF * len(self.tree.is_arm))
        self.ports: tuple[Port, ...] = (
            *(port for place in places for port in wrench_ports(place, "input")),
            *self._fittings.inputs,
            *(port for place in places for port in motion_ports(place, "output")),
            *chassis_ports(),
            *(
                port
                for k, side in enumerate(sides)
                for port in spring_ports(self.tree, vehicle, side, k * (len(self._springs) // 2))
            ),
            Port("energy.kinetic", "output", "J", "kinetic energy"),
            Port("energy.gravity", "output", "J", "gravity energy since the start"),
            Port("energy.spring", "output", "J", "energy of suspension and tensioner springs"),
            Port("energy.dissipated", "output", "J", "work done on the dampers of suspension and tensioners" + (
                ", and lost by friction and damping where it touches the ground" if self._ground else "")),
            Port("port.work", "output", "J", "work of the input wrenches since the start"),
            *(touch_ports() if self._ground else ()),
            *self._fittings.outputs,
            Port("solver.steps", "output", "1", "internal steps since the start", 0),
            Port("solver.evaluations", "output", "1", "evaluations of the accelerations since the start", 0),
            *start_pose_ports(),
            Port("step", "parameter", "s", "largest internal step", default_step(self.tree, vehicle, self._ground),
                 allowed=POSITIVE),
            *(
                Port(name, "parameter", "N", "push of each suspension spring when drawn", self._numbers[name])
                for name in self._numbers
                if name == "suspension.preload"
            ),
            Port("tensioner.preload", "parameter", "N", "push of each tensioner on its idler when drawn, less what"
                 " would balance a track on a side that has none",
                 float(vehicle["tensioner"]["preload"])),
            wrenches.extrapolate_port(),
            *self._fittings.parameters,
        )  # fmt: skip
        size, received = self._fittings.end + ENERGY_SUMS, wrenches.received(WRENCH * len(places))
        self.state: Floats = np.zeros(size + received)
        self.integrated, self._received = self.state[:size], self.state[size:]
        self.counters, self._stages = np.zeros(2, dtype=np.int64), np.zeros((len(RK4.b) + 1, size))
        self.warning_sentences = (*self.warning_sentences, wrenches.swing_sentence(tuple(places)))
        self._start = np.zeros(FRAME + 4)
        self._set_start(config["chassis"])
        self.inputs = WRENCH * len(places) + len(self._fittings.inputs)
        parts = tuple(map(self._part, range(size)))
        self.failures = failure_sentences(parts)

    def _set_numbers(self, config: Mapping[str, Any]) -> None:
        """Set the numbers that can be parameters of the start, and where those of each leaf's spring are."""
        known, springs = numbers.values(config), spring_names(config["vehicle"])
        names = list(dict.fromkeys(name for each in springs for name in each if name is not None))
        self.start_parameters = (*KEYS, *NUMBERS, *names)
        self._numbers: dict[str, Any] = {name: known[name] for name in (*NUMBERS, *names)}
        where = {name: k for k, name in enumerate(self.start_parameters)}
        self._springs = np.array([[where.get(name or "", -1) for name in each] for each in springs])

    def start_state(self, start: Mapping[str, Any] | None = None) -> Floats:
        """State with the start pose 0; ``start``, a mapping as the config's, replaces that."""
        if start is not None:
            x, y, z = self._centre
            y += start.get("lateral", 0.0)
            self._hull = stance((x, y, z + start["height"], *roll_pitch_quaternion(start["roll"], start["pitch"])))
            self._leaves.reshape(2, -1)[:, : len(start["left"])] = start["left"], start["right"]
        state = np.zeros_like(self.integrated)
        state[:7], state[ROOT : ROOT + self._leaves.size] = self._hull, self._leaves
        return state

    def _set_start(self, config: Mapping[str, Any]) -> None:
        """Set hull, leaves and tensioners of the start."""
        self._hull, self._leaves = stance(self._centre), np.zeros(len(self.tree.is_arm))
        self.start_state(config.get("start"))
        bare = (self._ground or {}).get("bare", ())
        left, right = (float(config.get("push", 0.0)) if side in bare else 0.0 for side in SIDES)
        own = [of_side(self._vehicle, side)["tensioner"]["preload"] for side in SIDES]
        self._missing_preload = left, right + (own[0] - own[1])
        self._rests = int(config.get("start") is not None)

    def initialise(self, parameters: Mapping[str, float | int | str]) -> None:
        """Start at rest at the start pose; raises InvalidParameter."""
        values = self._numbers | parameter_values(self.ports, parameters)
        wheels = [wheel for side in SIDES for wheel in smooth_wheels(of_side(self._vehicle, side))]
        for wheel, (_, _, key) in zip(wheels, spring_names(self._vehicle), strict=True):
            recoil = (wheel["tensioner"] or {}).get("recoil")
            if recoil and key and recoil["preload"] < (push := values[key]):
                raise InvalidParameter(
                    f"{key.removesuffix('preload')}recoil.preload = {recoil['preload']:.6g} N must be {push:.6g} N at"
                    f" least, the push that the {wheel['name']} needs at the start: the recoil spring gives beyond its"
                    " preload only"
                )
        if self._ground:
            from fmus.chassis.contacts import contacts

            self._contacts = contacts(self._vehicle, self._ground, values)
        self.counters[:] = 0
        parts = Parts(
            self.tree, self._contacts, values["step"], self._springs, self._start, self._centre, self._hull,
            self._leaves, self._missing_preload, self._rests, len(self.sides), self.integrated, self.counters,
            self._stages, wrenches.CHOICES.index(values["extrapolate"]), self._received, np.zeros(self.inputs),
            self._fittings.hitch(values), self._fittings.seats(),
        )  # fmt: skip
        self.begin(values, parts)

    def free_parameters(self, p: Mapping[str, Any]) -> FreeParameters:
        """All parameters but points of a load; with contacts of the ground all but the height, on terrain the pose."""
        ground = self._ground or {}
        fixed = KEYS if ground.get("terrain") else ("start.height",) if ground else ()
        start_only = tuple(name for name in self.start_parameters if name not in fixed)
        return FreeParameters({"longest": "{step}", "extrapolate": "{extrapolate}", **self._fittings.free}, start_only)

    def fault_sentence(self, t: float, code: int, state: Floats) -> str:
        """Sentence of a fault ``code`` of ``state`` at ``t``."""
        numbers = np.zeros(GAPS)
        numbers[0] = t
        return format_sentence(self.failures[step_failure(self.tree, code, state, numbers)], numbers)

    def _part(self, index: int) -> str:
        """Name of the part of the vehicle to which the state's entry ``index`` belongs."""
        leaves = len(self.tree.is_arm)
        if not ROOT <= index < ROOT + LEAF * leaves:
            return "chassis"
        side, k = divmod((index - ROOT) % leaves, leaves // 2)
        return f"{('left', 'right')[side]} {stations(self._vehicle)[k].replace('road_wheel', 'road_arm')}"
