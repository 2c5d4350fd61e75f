"""The tables of a scene file that are no vehicle: run, start, ground, track, drive, checks, and what is assembled."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from math import pi, remainder
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BeforeValidator, Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from fmus.link_outputs import GROUPS, STANDARD
from fmus.ports import TOLERANCES
from fmus.track_choices import DEFAULTS, conflict_of_bodies, conflict_of_links
from fmus.vehicle import Distance, Force, In, Table, to_si
from orchestrator.log.message_records import MOST_STEPS
from orchestrator.results import measures
from orchestrator.results.validity.limits import ALLOWED
from orchestrator.scene.gallery import hint

Duration = Annotated[float, In("s", gt=0)]
Time = Annotated[float, In("s", ge=0)]
Place = Annotated[float, In("m", ge=-1e6, le=1e6)]  # beyond, a double has no room for contacts
Every = Annotated[int, Field(ge=1, le=MOST_STEPS)]
Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")
OPTIONS = {
    "hold": ("jacobi", "gauss_seidel"),
    "tolerance": ("iterative",),
    "iterations": ("iterative",),
}


class Coupling(Table):
    """How components are coupled; what is not given is the coupling's own default."""

    scheme: Literal["tracks_first", "jacobi", "gauss_seidel", "iterative", "energy_corrected"] = "tracks_first"
    hold: Literal["linear", "constant"] | None = None  # of inputs: extrapolated to the middle of the step, or not
    tolerance: Annotated[float, Field(gt=0, lt=1)] | None = None  # change of inputs that ends the iteration
    iterations: Annotated[int, Field(ge=1)] | None = None  # allowed in a step

    @model_validator(mode="after")
    def _options_fit(self) -> Coupling:
        for option in self.options():
            if self.scheme not in OPTIONS[option]:
                wanted = " or ".join(OPTIONS[option])
                raise ValueError(f"{option} is an option of {wanted}, not of {self.scheme}")
        return self

    def options(self) -> dict[str, Any]:
        """What is given besides the scheme."""
        return self.model_dump(exclude={"scheme"}, exclude_none=True)

    def __str__(self) -> str:
        given = ", ".join(f"{key} = {value}" for key, value in self.options().items())
        return f"{self.scheme} ({given})" if given else self.scheme


class Variable(Table):
    """A communication step that follows an error estimate; ``run.step`` is the first."""

    # of a step: its error over what its connection has carried, or its power residual over what a bond has carried
    tolerance: Annotated[float, Field(gt=0, lt=1)]
    estimate: Literal["doubling", "power"] = "doubling"
    energy: Annotated[float, In("J", gt=0)] | None = None  # the least that a power residual is relative to
    shortest: Duration = 1e-5
    longest: Duration = 0.1

    @model_validator(mode="after")
    def _in_order(self) -> Variable:
        if self.shortest > self.longest:
            raise ValueError(f"shortest = {self.shortest:g} s is longer than longest = {self.longest:g} s")
        if self.energy is not None and self.estimate != "power":
            raise ValueError(f"energy is an option of estimate = 'power', not of '{self.estimate}'")
        return self

    def __str__(self) -> str:
        lengths = f"{self.shortest * 1e3:g} to {self.longest * 1e3:g} ms"
        return f"{self.estimate}, tolerance {self.tolerance:g}, {lengths}"


def short_coupling(value: object) -> object:
    """A coupling's name may stand for its table."""
    return {"scheme": value} if isinstance(value, str) else value


def off(value: object) -> object:
    """What a scene has can be left out: TOML has no none."""
    return None if value is False else value


def _kinds(allowed: object) -> object:
    """Kinds of failures of the validity ledger; one may stand alone."""
    names = [allowed] if isinstance(allowed, str) else allowed
    if isinstance(names, list | tuple) and all(isinstance(name, str) and name in ALLOWED for name in names):
        return tuple(name for name in ALLOWED if name in names)
    raise ValueError(f"must be a list of {', '.join(ALLOWED)}: failures that become warnings")


class Run(Table):
    """How long, in which steps, and how often results are recorded."""

    stop: Duration
    step: Duration  # communication step H
    coupling: Annotated[Coupling, BeforeValidator(short_coupling)] = Coupling()
    variable: Annotated[Variable | None, BeforeValidator(off)] = None  # without it, or false: all of length H
    outputs: Every = 1  # outputs are recorded every n communication steps
    links: Every | None = None  # per-link outputs are recorded every n communication steps; default: ``recording``
    between: bool = False  # mean, least and most of per-link outputs between two of these records, too
    # the log gets what the run needs to go on from there so often; false: never
    checkpoints: Annotated[Duration | None, BeforeValidator(off)] = 0.5
    allow: Annotated[tuple[str, ...], BeforeValidator(_kinds)] = ()  # what of ``results/validity`` does not fail a run

    @model_validator(mode="after")
    def _whole_steps(self) -> Run:
        if self.stop / self.step > MOST_STEPS:
            raise ValueError(f"stop = {self.stop:g} s is more than {MOST_STEPS} steps of {self.step:g} s")
        if abs(self.stop / self.step - round(self.stop / self.step)) > 1e-6 or self.stop < self.step:
            raise ValueError(f"stop = {self.stop:g} s must be a multiple of step = {self.step:g} s")
        return self

    @property
    def steps(self) -> int:
        """Number of communication steps."""
        return round(self.stop / self.step)


class Start(Table):
    """Where the vehicle stands at the start, world frame."""

    position: tuple[Place, Place, Place] = (0.0, 0.0, 0.0)
    heading: Annotated[float, In("rad")] = 0.0


class Equilibrium(Table):
    """Where hull, arms and idlers stand at rest, from the drawn position: see ``fmus.equilibrium``."""

    height: float  # of the hull's centre of mass, m
    roll: float  # rad
    pitch: float
    left: tuple[float, ...]  # angles of the arms from the front, rad, and the slide of the idler, m
    right: tuple[float, ...]


class VehicleStart(Start):
    """A vehicle may also begin above its place on the ground, and pitched or rolled: upside down by half a turn."""

    height: Place = 0.0  # of the sprocket axle over its drawn place on the ground
    pitch: Annotated[float, In("rad")] = 0.0  # about the sprocket axle, nose down positive
    roll: Annotated[float, In("rad")] = 0.0  # about its long axis, before the pitch: half a turn or none
    # equilibrium: at rest on its springs and tracks, the default; drawn: on springs without load, from where it drops,
    # the default of what is raised or turned
    state: Literal["equilibrium", "drawn"] | None = None
    equilibrium: Equilibrium | None = None  # solved

    @model_validator(mode="after")
    def _rests_in_its_place(self) -> VehicleStart:
        if self.state == "equilibrium" and self.moved:
            raise ValueError(
                "state = 'equilibrium' needs height = 0, pitch = 0 and roll = 0: what is raised or turned starts as"
                " 'drawn'"
            )
        return self

    @property
    def moved(self) -> bool:
        """Whether it does not stand on the ground as drawn."""
        return (self.height, self.pitch, self.roll) != (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _upright(self) -> VehicleStart:
        if abs(remainder(self.roll, pi)) > 1e-9:
            raise ValueError(
                f"roll = {self.roll:g} rad must be 0 or half a turn (180 deg): a track is laid out in an upright plane"
            )
        return self

    def turned(self) -> tuple[float, float]:
        """Heading and pitch, rad, with the roll in them: R_z(h) R_y(p) R_x(pi) = R_z(h + pi) R_y(pi - p)."""
        over = abs(remainder(self.roll, 2.0 * pi)) > 1.0
        return (self.heading + pi, pi - self.pitch) if over else (self.heading, self.pitch)


class Bump(Table):
    """A trapezoid across the way, its edges rounded, in the frame of the start."""

    start: Place  # where it begins, ahead of the sprocket axle
    rise: Distance
    slope: Annotated[float, In("rad", gt=0, lt=1.5)]  # of both ramps
    length: Annotated[float, In("m", ge=0)]  # of the flat top
    radius: Distance  # of the four edges


class Ground(Table):
    """What the ground has beside its level, and what can touch it beside the tracks."""

    hull: bool = False  # the points vehicle.chassis.hull
    bump: Bump | None = None


Tolerance = Annotated[float, Field(ge=TOLERANCES.least, le=TOLERANCES.most)]
Elasticity = Literal["small_deformation", "general", "engineering"]


def _groups(asked: object) -> object:
    """Of link outputs: all, those that are standard (true), none (false), or names."""
    if asked == "all":
        return tuple(GROUPS)
    if isinstance(asked, bool):
        return STANDARD if asked else ()
    if isinstance(asked, list | tuple) and all(isinstance(name, str) and name in GROUPS for name in asked):
        return tuple(name for name in GROUPS if name in asked)
    raise ValueError(f"must be true, false, 'all' or a list of {', '.join(GROUPS)}")


LinkOutputs = Annotated[tuple[str, ...], BeforeValidator(_groups)]


class Sets(NamedTuple):
    """What a key of ``[track]`` sets; stands in the annotation of the key."""

    parameter: str = ""  # of the track's FMU; the key's own name where empty
    model: str = ""  # the one that has it; both where empty
    method: bool = False  # how the motion is computed, and not what moves


FLEXIBLE, FLEXIBLE_METHOD, METHOD = Sets(model="flexible"), Sets(model="flexible", method=True), Sets(method=True)
LINKS = {"flexible": "flexible links", "rigid": "rigid links"}
CONFLICTS = {"flexible": conflict_of_links, "rigid": conflict_of_bodies}


class Track(Table):
    """Which track model, and its parameters; what is not given is the model's own default."""

    model: Literal["flexible", "rigid"]
    element: Annotated[Literal["cable", "beam"] | None, FLEXIBLE] = None
    elasticity: Annotated[Elasticity | None, FLEXIBLE] = None  # of cables
    # of cables: fixed ones stay in their plane; as the scene needs
    axes: Annotated[Literal["fixed", "free"] | None, FLEXIBLE] = None
    formulation: Annotated[Literal["augmented", "recursive"] | None, Sets(model="rigid", method=True)] = None
    # of cables: pins without equations, or with multipliers
    joints: Annotated[Literal["eliminated", "constrained"] | None, FLEXIBLE_METHOD] = None
    # that an explicit integrator integrates
    coordinates: Annotated[Literal["nodal", "cholesky"] | None, FLEXIBLE_METHOD] = None
    closure: Annotated[Literal["pin", "spring"] | None, Sets()] = None  # of a loop: how its last link joins its first
    closure_stiffness: Annotated[Annotated[float, In("N/m", gt=0)] | None, Sets("closure.stiffness")] = None
    closure_damping: Annotated[Annotated[float, In("N s/m", ge=0)] | None, Sets("closure.damping")] = None
    integrator: Annotated[Literal["generalized_alpha", "hht", "runge_kutta", "adams"] | None, METHOD] = None
    step: Annotated[Duration | None, METHOD] = None  # largest internal step
    # of an implicit integrator; hht: 0.5 at least
    spectral_radius: Annotated[Annotated[float, Field(ge=0, le=1)] | None, METHOD] = None
    rtol: Annotated[Tolerance | None, Sets("adams.rtol", method=True)] = None  # of integrator = 'adams'
    atol: Annotated[Tolerance | None, Sets("adams.atol", method=True)] = None  # the same, in m, rad, m/s and rad/s
    start: Annotated[Literal["rest", "displaced", "polygon", "straight", "folded"] | None, Sets()] = None
    link_outputs: LinkOutputs = STANDARD  # groups of ``fmus.link_outputs``

    @classmethod
    def sets(cls) -> dict[str, Sets]:
        """The keys that set a parameter of the track's FMU."""
        found = ((key, one) for key, field in cls.model_fields.items() for one in field.metadata)
        return {key: one for key, one in found if isinstance(one, Sets)}

    def parameters(self) -> dict[str, Any]:
        """The parameters that are given, by their names in the track's FMU."""
        given = self.model_dump(exclude_none=True)
        return {one.parameter or key: given[key] for key, one in self.sets().items() if key in given}

    def of_model(self, model: str) -> Track:
        """The same track of another model, without what only one of both has; with that model's own integrator."""
        own = {key: None for key, one in self.sets().items() if one.model or key == "integrator"}
        return self.model_copy(update={**own, "model": model})

    @model_validator(mode="after")
    def _fits(self) -> Track:
        for key, one in self.sets().items():
            value = getattr(self, key)
            if one.model not in ("", self.model) and value is not None:
                raise ValueError(f"{key} = '{value}' needs model = '{one.model}': {LINKS[self.model]} have none")
        for key in ("rtol", "atol"):
            if getattr(self, key) is not None and self.integrator != "adams":
                raise ValueError(f"{key} = {getattr(self, key):g} needs integrator = 'adams': others take equal steps")
        if conflict := CONFLICTS[self.model]({**DEFAULTS[self.model], **self.parameters()}):
            raise ValueError(conflict)
        return self

    @model_validator(mode="after")
    def _springs_close(self) -> Track:
        for key in ("closure_stiffness", "closure_damping"):
            value = getattr(self, key)
            if self.closure != "spring" and value is not None:
                raise ValueError(f"{key} = {value} needs closure = 'spring': a pin has none")
        return self


def short_track(value: object) -> object:
    """A model's name may stand for its table."""
    return {"model": value} if isinstance(value, str) else value


POINTS_OF = {  # and the modes in which they act
    "speed_points": ("speed", "controller"),
    "torque_points": ("torque",),
    "brake_points": ("torque", "controller"),
    "engine_points": ("torque", "controller"),
}


class Drive(Table):
    """What turns a sprocket (or a braked idler).

    ``speed`` rises from 0 to its value along half a cosine from ``ramp_start`` on for ``ramp_time``, and is
    then held; ``torque`` is a constant motor torque; ``controller`` reaches the speed with a limited torque.
    """

    mode: Literal["speed", "torque", "controller"]
    speed: Annotated[float, In("rad/s")] = 0.0
    ramp_start: Time = 0.0
    ramp_time: Time = 1.0
    stop: Time | None = None  # when the sprocket is stopped for good, after the ramp
    stop_time: Duration = 1e-3
    torque: Annotated[float, In("N m")] = 0.0
    torque_limit: Annotated[float, In("N m", gt=0)] | None = None
    brake: Annotated[float, In("N m", ge=0)] = 0.0
    # points [time, value], or a CSV file of them, instead of a constant: straight lines between, held before and after
    speed_points: tuple[tuple[Time, Annotated[float, In("rad/s")]], ...] | None = None  # instead of ramp and stop
    torque_points: tuple[tuple[Time, Annotated[float, In("N m")]], ...] | None = None
    brake_points: tuple[tuple[Time, Annotated[float, In("N m", ge=0)]], ...] | None = None

    # full-load curve of the engine, [speed, torque] of its shaft, or a CSV file: at the sprocket by the gear's ratio
    engine_points: tuple[tuple[Annotated[float, In("rad/s", ge=0)], Annotated[float, In("N m", ge=0)]], ...] | None = (
        None
    )
    gear_ratio: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = (
        None  # turns of the engine to the sprocket's
    )

    @model_validator(mode="after")
    def _points_fit(self) -> Drive:
        for key, modes in POINTS_OF.items():
            points = getattr(self, key)
            if points is None:
                continue
            if self.mode not in modes:
                raise ValueError(f"{key} needs mode = {' or '.join(map(repr, modes))}, not '{self.mode}'")
            times = [time for time, _ in points]
            if not times or any(later <= earlier for earlier, later in pairwise(times)):
                raise ValueError(
                    f"{key}: needs at least one point, and {'speeds' if key == 'engine_points' else 'times'} that rise"
                )
        if self.gear_ratio is not None and self.engine_points is None:
            raise ValueError("gear_ratio needs engine_points: without an engine's curve there is nothing to gear")
        if self.stop is not None and self.stop < self.ramp_start + self.ramp_time:
            raise ValueError(
                f"stop = {self.stop:g} s must not be before the ramp ends, {self.ramp_start + self.ramp_time:g} s"
            )
        if self.speed_points is not None and self.stop is not None:
            raise ValueError("speed_points and stop exclude each other: the points say when it stops")
        return self

    @property
    def top_speed(self) -> float | None:
        """Largest speed that is asked for, rad/s; None where a torque makes it."""
        if self.mode == "torque":
            return None
        return max(abs(speed) for _, speed in self.speed_points or ((0.0, self.speed),))


class Steering(Drive):
    """What turns right less left in a steering differential: ``speed`` is the right sprocket's less the left one's."""

    mode: Literal["speed", "torque", "controller"] = "speed"

    @model_validator(mode="after")
    def _acts(self) -> Steering:
        """Raise ValueError for what the mode, which may not have been said, leaves without effect."""
        acting = {"torque": ("torque",), "torque_limit": ("controller",), "brake": ("torque", "controller")}
        for key, modes in acting.items():
            if getattr(self, key) and self.mode not in modes:
                raise ValueError(f"{key} needs mode = {' or '.join(map(repr, modes))}, not '{self.mode}'")
        return self


class VehicleDrive(Drive):
    """The drive of both sides of a vehicle; what ``left`` or ``right`` says lies over it.

    With ``steering`` both sprockets are joined by a differential, and the drive turns the mean of their speeds.
    """

    left: Drive | None = None
    right: Drive | None = None
    steering: Annotated[Steering | None, BeforeValidator(off)] = None

    @model_validator(mode="before")
    @classmethod
    def _laid_over(cls, value: object) -> object:
        if not isinstance(value, Mapping):
            return value
        both = {key: each for key, each in value.items() if key not in SIDES}
        known = {key: each for key, each in both.items() if key in Drive.model_fields}
        own = {side: value[side] for side in SIDES if value.get(side) is not None}
        whole = {side: {**known, **each} if isinstance(each, Mapping) else each for side, each in own.items()}
        modes = [each["mode"] for each in whole.values() if isinstance(each, Mapping) and "mode" in each]
        if modes and "mode" not in both and (len(own) == len(SIDES) or known != both):
            both["mode"] = modes[0]  # each side has its own, or another key is to be complained of
        return both | whole

    @model_validator(mode="after")
    def _named_by_side(self) -> VehicleDrive:
        """Sides that differ are both named, sides that are alike neither; what else is said is then the left one's."""
        left, right = (getattr(self, side) or self._both() for side in SIDES)
        sides = {} if left == right else {"left": left, "right": right}
        if sides and self.steering is not None:
            raise ValueError("left and right exclude steering: a differential turns both, by their mean and difference")
        return self.model_construct(None, **left.model_dump(), **sides, steering=self.steering)

    @model_serializer(mode="wrap")
    def _without_what_does_nothing(self, whole: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {key: value for key, value in whole(self).items() if (key in SIDES) == self.steers}

    def _both(self) -> Drive:
        return Drive.model_construct(**{key: getattr(self, key) for key in Drive.model_fields})

    @property
    def steers(self) -> bool:
        """Whether the sides' drives differ."""
        return self.left is not None and self.right is not None

    def motors(self) -> dict[str, Drive]:
        """All drives by their keys."""
        own = {"drive.left": self.left, "drive.right": self.right} if self.steers else {"drive": self}
        return {key: each for key, each in {**own, "drive.steering": self.steering}.items() if each is not None}

    def of(self, side: Side) -> Drive:
        """The drive of a side."""
        return getattr(self, side) or self._both()


def _arc(pair: object) -> object:
    """An arc of a path in SI: [length, curvature], or [0, angle] for a turn on the spot."""
    if not isinstance(pair, list | tuple) or len(pair) != 2:
        return pair
    length = to_si("m")(pair[0])
    second = to_si("rad/m" if length else "rad")(pair[1])
    if not length and not second:
        raise ValueError("an arc of length 0 turns on the spot: its second number is the angle, not 0")
    return length, second


Arc = Annotated[tuple[Place, Annotated[float, In("rad/m", ge=-1e3, le=1e3)]], BeforeValidator(_arc)]


class Driver(Table):
    """Who drives a vehicle along a path, or on a heading, at a speed; the path begins under its middle road wheel.

    Without arcs and points the heading of the start, turned by ``heading``, is held. What is not given is the
    driver's own default.
    """

    # [length, curvature], left positive, a negative length backwards, [0, angle] on the spot; or a CSV file of them
    arcs: Annotated[tuple[Arc, ...] | None, BeforeValidator(off)] = None
    # [x, y] of a smooth path, or a CSV file of them
    points: Annotated[tuple[tuple[Place, Place], ...] | None, BeforeValidator(off)] = None
    heading: Annotated[float, In("rad")] | None = None
    speed: Annotated[float, In("m/s", ge=0, le=1e3)] = 0.0
    ramp_start: Time = 0.0
    ramp_time: Time = 1.0
    speed_points: tuple[tuple[Time, Annotated[float, In("m/s", ge=0)]], ...] | None = None  # instead of the ramp
    deceleration: Annotated[float, In("m/s^2", gt=0)] | None = None  # towards curves and the end of the path
    lateral_acceleration: Annotated[float, In("m/s^2", gt=0)] | None = None  # bounds speed and curvature
    reach: Distance | None = None  # least distance of the point that is pursued
    preview: Time | None = None  # and in time
    width: Distance | None = None  # distance of two tracks that would turn the vehicle alike without slip: for errors
    friction: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None  # that is counted on: else the ground's
    grip: Annotated[float, Field(ge=0.05, le=0.9)] | None = None  # share of the friction that the way is planned with

    @model_validator(mode="after")
    def _one_way(self) -> Driver:
        given = [key for key in ("arcs", "points", "heading") if getattr(self, key) is not None]
        if len(given) > 1:
            raise ValueError(f"{given[0]} and {given[1]} exclude each other")
        for key, least in (("arcs", 1), ("points", 2), ("speed_points", 1)):
            if (pairs := getattr(self, key)) is not None and len(pairs) < least:
                raise ValueError(f"{key}: needs at least {least} of them, not {len(pairs)}")
        times = [time for time, _ in self.speed_points or ()]
        if any(later <= earlier for earlier, later in pairwise(times)):
            raise ValueError("speed_points: needs times that rise")
        for k, (one, other) in enumerate(pairwise(self.points or ())):
            if one == other:
                raise ValueError(f"points: number {k + 1} and {k + 2} are the same place, {list(one)}")
        if self.speed_points is not None and self.speed:
            raise ValueError("speed and speed_points exclude each other")
        for key in ("deceleration", "reach", "preview"):
            if getattr(self, key) is not None and self.arcs is None and self.points is None:
                raise ValueError(f"{key} needs a path, arcs or points")
        return self

    @property
    def top_speed(self) -> float:
        """Largest speed that is asked for, m/s."""
        return max(speed for _, speed in self.speed_points or ((0.0, self.speed),))


class Check(Table):
    """An expectation: a signal reduced over a window, or a named measure, against a value."""

    signal: str | None = None  # instance.variable
    reduce: Literal["mean", "min", "max", "last", "drop", "ripple", "rms"] = "mean"
    measure: str | None = None
    of: str = ""  # the side ("left", "right") or component a measure looks at
    start: Time = Field(0.0, alias="from")
    end: Time | None = Field(None, alias="to")  # default: the end of the run
    expected: Annotated[float, Field(allow_inf_nan=False)]
    tolerance: Annotated[float, Field(ge=0, allow_inf_nan=False)]
    relative: bool = False  # tolerance is a fraction of the expected value
    track: Literal["flexible", "rigid"] | None = None  # only for this track model

    @model_validator(mode="after")
    def _one_source(self) -> Check:
        if (self.signal is None) == (self.measure is None):
            raise ValueError("needs either signal or measure")
        if self.measure is not None and self.measure not in measures.NAMES:
            raise ValueError(f"no measure '{self.measure}': {hint(self.measure, sorted(measures.NAMES), 'one of')}")
        return self


class Chain(Table):
    """An open chain between two fixed pins at the height of the origin, or held at the first alone, or a free loop."""

    links: Annotated[int, Field(ge=2, le=4096)]
    ends: Literal["pinned", "held", "loop"] = "pinned"
    span: Annotated[float, Field(gt=0, lt=1)] | None = None  # pinned: distance of the pins over the chain's length
    spin: Annotated[float, In("rad/s")] = 0.0  # of a loop about y, at the start; it has no gravity
    ovalling: Annotated[float, In("rad/s")] = 0.0  # of its links besides, by this times cos(2 angle)

    @model_validator(mode="after")
    def _of_its_ends(self) -> Chain:
        if (self.span is None) == (self.ends == "pinned"):
            raise ValueError(f"ends = '{self.ends}' {'needs' if self.span is None else 'has no'} span")
        for key in ("spin", "ovalling"):
            if getattr(self, key) and self.ends != "loop":
                raise ValueError(f"ends = '{self.ends}' has no {key}")
        if self.ends == "loop" and self.links < 3:
            raise ValueError(f"a loop needs 3 links, not {self.links}")
        return self


class Bench(Table):
    """An open chain over one sprocket, its ends pulled by constant forces."""

    links: Annotated[int, Field(ge=8, le=4096)]
    upper: Force  # pull at the end of the upper (incoming) span, towards -x
    lower: Force  # pull at the end of the lower (outgoing) span, towards -x
    transverse_damping: Annotated[float, In("N s/m", ge=0)] = 0.0


class Rig(Table):
    """A closed chain round a sprocket and a smooth idler with fixed axles."""

    links: Annotated[int, Field(ge=8, le=4096)]
    axle_distance: Distance  # as drawn: the idler is moved until the chain carries the tension
    tension: Force
