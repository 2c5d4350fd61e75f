"""Driver component: ports, parameters, start."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.driver.path import NONE, Path, path_of_arcs, path_through_points
from fmus.driver.plan import empty_plan
from fmus.driver.pursuit import PIECE, WIDTH, ControlLaw, Parts, begin, step, write_outputs
from fmus.driver.skid import skid_vehicle
from fmus.drives.parameters import INTERPOLATIONS
from fmus.interface.defaults import configured_ports, parameter_values
from fmus.interface.model import NO_ROTATION, ComponentModel, FreeParameters, InvalidParameter
from fmus.interface.ports import NOT_NEGATIVE, POSITIVE, STATE, Port, Range, field_of, motion_ports, start_pose_ports
from fmus.interface.profile import Profile, parse_profile
from fmus.interface.sentences import Sentence
from fmus.physics.arrays import Floats
from fmus.start import KEYS, start_pose
from fmus.vehicles.sides import way_a_turn, wheel_places

SHARE = Range(0.05, 0.9, "between 0.05 and 0.9")
LAW = (  # numbers of the ``ControlLaw`` that are free parameters
    "width", "heading.gain", "reach", "preview", "yaw.gain", "yaw.integral", "curvature.largest",
    "acceleration.lateral", "deceleration", "speed.start", "speed.end", "ramp.start", "ramp.end", "friction", "grip",
    "drive.lag", "yaw.lag", "path.tolerance",
)  # fmt: skip
WIDTH_FACTOR = 1.4  # width that turns alike without slip, over the tracks' distance: 0.449 / 0.3142 rad/s in `turn`


def parameter_ports(vehicle: Mapping[str, Any]) -> list[Port]:
    """Parameters of a driver of this vehicle."""
    width = 2.0 * WIDTH_FACTOR * float(vehicle["track"]["lateral"])
    friction = float(vehicle["contact"]["ground"]["friction"])
    frame = "from where the middle of the road wheels stands at the start, in the frame of the start"
    return [
        *start_pose_ports(),
        Port("path.arcs", "parameter", "1", f"'length curvature; ...', m and 1/m, left is positive: arcs {frame}", ""),
        Port("path.points", "parameter", "1", f"'x y; x y; ...', m: points of a smooth path, {frame}", ""),
        Port("heading", "parameter", "rad", "heading to hold against that of the start, where there is no path"),
        Port("speed.start", "parameter", "m/s", "speed before the ramp", allowed=NOT_NEGATIVE),
        Port("speed.end", "parameter", "m/s", "speed after the ramp", allowed=NOT_NEGATIVE),
        Port("ramp.start", "parameter", "s", "time at which the half-cosine ramp begins", 0.0, allowed=NOT_NEGATIVE),
        Port("ramp.end", "parameter", "s", "time at which the half-cosine ramp ends", 1.0, allowed=NOT_NEGATIVE),
        Port("speed.points", "parameter", "1", "'time value; ...', s and m/s: instead of a ramp", ""),
        Port("interpolation", "parameter", "1", "how speed.points go on: along straight lines, or each holds until the "
             "next one, after 0 before the first", "linear", INTERPOLATIONS),
        Port("deceleration", "parameter", "m/s2", "with which the vehicle slows down to curves and to the end", 1.0,
             allowed=POSITIVE),
        Port("reach", "parameter", "m", "least distance ahead of the point that is pursued", 2.0, allowed=POSITIVE),
        Port("preview", "parameter", "s", "the same in time: the larger of both counts", 1.0, allowed=NOT_NEGATIVE),
        Port("friction", "parameter", "1", "of tracks on the ground; 0: not known, tracks slip as width says", friction,
             allowed=NOT_NEGATIVE),
        Port("grip", "parameter", "1", "share of the friction that speeds and curves are planned with", 0.8,
             allowed=SHARE),
        Port("drive.lag", "parameter", "s", "time constant with which the drives follow", 0.1, allowed=NOT_NEGATIVE),
        Port("yaw.lag", "parameter", "s", "by which the vehicle turns later than drives: chains, guides give way", 0.1,
             allowed=NOT_NEGATIVE),
        Port("path.tolerance", "parameter", "m", "how far to pass beside the path where its curvature jumps", 0.1,
             allowed=POSITIVE),
        Port("curvature.largest", "parameter", "1/m", "sharpest turn that is demanded", 0.5, allowed=POSITIVE),
        Port("acceleration.lateral", "parameter", "m/s2", "what speed times yaw rate may be: slower in curves", 10.0,
             allowed=POSITIVE),
        Port("heading.gain", "parameter", "1/s", "yaw rate per error of the held heading", 1.0, allowed=NOT_NEGATIVE),
        Port("yaw.gain", "parameter", "1", "yaw rate per error of the yaw rate", 1.0, allowed=NOT_NEGATIVE),
        Port("yaw.integral", "parameter", "1/s", "yaw rate per second and error of the yaw rate", 0.3,
             allowed=NOT_NEGATIVE),
        Port("width", "parameter", "m", "distance of two tracks that turn the vehicle alike without slip", width,
             allowed=POSITIVE),
    ]  # fmt: skip


class Model(ComponentModel):
    """Driver that reads the motion of the hull and demands a speed of each sprocket.

    ``config``: {"vehicle": a vehicle's table}; other keys are not read. A hull whose inputs still have their start
    values stands still at the start pose.
    """

    start_kernel, step_kernel, output_kernel = staticmethod(begin), staticmethod(step), staticmethod(write_outputs)
    start_parameters, refusals = KEYS, (Sentence(""), Sentence("ramp.end = {0:.6g} s must not be before ramp.start"))
    failures = (
        Sentence(""),
        Sentence(NO_ROTATION, ("chassis",)),
        Sentence("at t = {0:.6g} s the demands are not finite: the vehicle is lost"),
    )
    warning_sentences = (Sentence("at t = {0:.6g} s the vehicle is {1:.3g} m beside its path"),)
    inputs = STATE

    @classmethod
    def reads(cls, config: Mapping[str, Any]) -> list[str]:
        """See ``ComponentModel``."""
        wheel = ("mass", "transverse_inertia", "x", "z")
        return [
            "gravity",
            *(f"chassis.{key}" for key in ("mass", "inertia", "centre")),
            *(f"sprocket.{key}" for key in ("mass", "transverse_inertia", "teeth", "gaps_per_pin", "radius")),
            "sprocket.pins_per_gap",
            *(f"{table}.{key}" for table in ("idler", "road_wheel") for key in (*wheel, "radius")),
            *(f"return_roller.{key}" for key in wheel if config["vehicle"].get("return_roller")),
            *(f"wheel.{name}.{key}" for name in config["vehicle"].get("wheel") or () for key in wheel),
            *(f"road_arm.{key}" for key in ("mass", "pin_inertia", "pivot")),
            *(f"track.{key}" for key in ("links", "lateral", "pitch", "mass", "face", "width", "tension", "grouser")),
            "right",
            "contact.ground.friction",
            "contact.ground.friction_velocity",
        ]

    def __init__(self, config: Mapping[str, Any]) -> None:
        vehicle = config["vehicle"]
        x, y, z = (float(part) for part in vehicle["chassis"]["centre"])
        self._centre = x, y, z
        self._ahead = float(np.mean(wheel_places(vehicle))) - x
        self._skid_vehicle, _ = skid_vehicle(vehicle)
        self._creep = float(vehicle["contact"]["ground"]["friction_velocity"])
        self._radius = way_a_turn(vehicle) / (2.0 * np.pi)
        parameters = configured_ports(parameter_ports(vehicle), config)
        start_motion = self._start_motion({port.name: port.start for port in parameters})
        self.ports: tuple[Port, ...] = (
            *motion_ports("chassis", "input", start_motion),
            Port("left.speed", "output", "rad/s", "wanted speed of the left sprocket against its mount"),
            Port("right.speed", "output", "rad/s", "wanted speed of the right sprocket against its mount"),
            Port("path.lateral_error", "output", "m", "how far left of its path the middle of the road wheels is"),
            Port("path.heading_error", "output", "rad", "how far left of its path, or of the heading, the hull points"),
            Port("path.progress", "output", "m", "way along the path"),
            Port("speed.demand", "output", "m/s", "wanted speed"),
            Port("yaw_rate.demand", "output", "rad/s", "wanted rate of the heading"),
            Port("curvature.demand", "output", "1/m", "wanted curvature of the way, to the left"),
            Port("solver.steps", "output", "1", "steps since the start", 0),
            *parameters,
        )
        self.unconnected = np.array([port.start for port in self.ports[:STATE]])
        self._rest_motion = self.unconnected.copy()
        self._law: ControlLaw
        self._path: Path = NONE
        self.state: Floats = np.zeros(WIDTH)
        self.counters = np.zeros(1, dtype=np.int64)

    def initialise(self, parameters: Mapping[str, float | int | str]) -> None:
        """Start at the beginning of the path; raises InvalidParameter."""
        values = parameter_values(self.ports, parameters)
        self._law, self._path = self._law_of(values), self._path_of(values)
        self.indices = ((PIECE, max(self._path.first.size - 1, 1)),)
        self.counters[:] = 0
        world_path = self._path._replace(
            x=self._path.x.copy(), y=self._path.y.copy(), heading=self._path.heading.copy()
        )
        self.begin(values, Parts(
            self._law, self._skid_vehicle, self._path, world_path, empty_plan(self._path), self._centre,
            self.unconnected,
            self._rest_motion, np.zeros(self.inputs), self.state, self.counters,
        ))  # fmt: skip

    def free_parameters(self, p: Mapping[str, Any]) -> FreeParameters:
        """All parameters but the path and tables of points."""
        numbers = {f"law.{field_of(name)}": f"{{{name}}}" for name in LAW}
        return FreeParameters({**numbers, "law.heading": "{heading} + {start.heading}"}, self.start_parameters)

    def _start_motion(self, values: Mapping[str, Any]) -> tuple[float, ...]:
        """Motion (13) of the hull when nothing moves it."""
        return start_pose(values).point_at_rest(*self._centre)

    def _path_of(self, values: Mapping[str, Any]) -> Path:
        """Path in the frame of the start; raises InvalidParameter."""
        arcs, points = values["path.arcs"].strip(), values["path.points"].strip()
        if arcs and points:
            raise InvalidParameter("path.arcs and path.points exclude each other")
        if arcs:
            return path_of_arcs("path.arcs", arcs)
        return path_through_points("path.points", points) if points else NONE

    def _law_of(self, values: Mapping[str, Any]) -> ControlLaw:
        """Law from the checked parameters; raises InvalidParameter."""
        speeds = parse_profile("speed.points", str(values["speed.points"]))
        if speeds.value.min(initial=0.0) < 0.0:
            raise InvalidParameter(f"speed.points = '{str(values['speed.points'])[:80]}' must not be negative")
        if values["interpolation"] == "hold":  # a line to each point begins at the number before its time
            time = np.stack([np.nextafter(speeds.time, -np.inf), speeds.time], axis=1).ravel()
            value = np.append(0.0, np.repeat(speeds.value, 2))[:-1]
            speeds = Profile(time, value, np.zeros(len(time)))
        return ControlLaw(
            radius=self._radius,
            ahead=self._ahead,
            heading=float(values["heading"]) + float(values["start.heading"]),
            speeds=speeds,
            creep=self._creep,
            **{field_of(name): float(values[name]) for name in LAW},
        )
