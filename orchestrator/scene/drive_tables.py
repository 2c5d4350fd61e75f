"""Tables of drives, driver and towed load: ``[drive]``, ``[drive.steering]``, ``[driver]`` and ``[hitch]``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, SerializerFunctionWrapHandler, model_serializer, model_validator

from fmus.interface.ports import TORQUE_LIMIT
from fmus.vehicles.tables import GIVEN, Angle, Distance, Force, In, Place, When, WhenAny, ratio, to_si
from orchestrator.scene.values import OR_FALSE, SIDES, Duration, Parameters, ParameterTable, Sets, Side, Time

MOTOR, FOLLOWED = ("torque", "controller"), ("speed", "controller")  # modes with a motor's torque, and with a profile
PROFILE = When(mode=FOLLOWED, demand=(False,), speed_points=(None,))
WITH_MOTOR = When(mode=MOTOR)
RAMP_START = Sets("ramp.start")
HELD = When(interpolation=("hold",))
Mode = Annotated[Literal["speed", "torque", "controller"], Sets()]
Interpolation = Annotated[Literal["hold", "linear"], Sets()]


def _rise(values: Iterable[float]) -> bool:
    """Whether each value is larger than the one before."""
    return not any(later <= earlier for earlier, later in pairwise(values))


class DriveTable(ParameterTable):
    """Drive of a sprocket, or brake of an idler.

    ``speed`` rises from 0 to its value along half a cosine from ``ramp_start`` on for ``ramp_time`` and is then
    constant; ``torque`` is a constant motor torque; ``controller`` reaches the speed with a limited torque.
    """

    mode: Mode = "speed"
    """prescribed speed; given motor torque and brake; or a torque that controls the speed"""
    speed: Annotated[float, In("rad/s"), PROFILE, Sets("speed.end")] = 0.0
    """speed against the mount after the ramp"""
    ramp_start: Annotated[Time, PROFILE, RAMP_START] = 0.0
    """time at which the ramp of the speed begins"""
    ramp_time: Annotated[Time, PROFILE] = 1.0
    """length of the ramp, half a cosine from 0 to speed"""
    stop: Annotated[Time | None, PROFILE, Sets("stop.start", default=False)] = None
    """time at which the sprocket is locked for good, after the ramp"""
    stop_time: Annotated[Duration, When(stop=GIVEN), Sets("stop.time")] = 1e-3
    """time that the stop takes, along half a cosine"""
    torque: Annotated[
        float, In("N m"), When(mode=("torque",), demand=(False,), torque_points=(None,)), Sets("torque.drive")
    ] = 0.0
    """torque of the motor"""
    torque_limit: Annotated[Annotated[float, In("N m", gt=0)] | None, WITH_MOTOR, Sets("torque.limit")] = None
    """largest torque of the motor, either way, without the brake; torque and torque_points are cut by a given one
    only"""
    brake: Annotated[float, In("N m", ge=0), When(mode=MOTOR, brake_points=(None,)), Sets("brake.torque")] = 0.0
    """largest torque of the brake: below it the brake holds, at it the sprocket slips"""
    speed_points: Annotated[
        tuple[tuple[Time, Annotated[float, In("rad/s")]], ...] | None,
        When(mode=FOLLOWED, demand=(False,)),
        Sets("speed.points"),
    ] = None
    """[time, speed] or a file of them, instead of ramp and stop"""
    torque_points: Annotated[
        tuple[tuple[Time, Annotated[float, In("N m")]], ...] | None,
        When(mode=("torque",), demand=(False,)),
        Sets("torque.points"),
    ] = None
    """[time, torque] or a file of them, instead of torque"""
    brake_points: Annotated[
        tuple[tuple[Time, Annotated[float, In("N m", ge=0)]], ...] | None, WITH_MOTOR, Sets("brake.points")
    ] = None
    """[time, torque] of the brake or a file of them, instead of brake"""
    interpolation: Annotated[
        Interpolation, WhenAny(*(When(**{f"{what}_points": GIVEN}) for what in ("speed", "torque", "brake")))
    ] = "linear"
    """linear between points over time and constant outside, or each holds until the next one, after 0 before the first,
    and is followed with demand_lag; for columns of Twist, TwistStamped and Ackermann messages hold is the default"""
    engine_points: Annotated[
        tuple[tuple[Annotated[float, In("rad/s", ge=0)], Annotated[float, In("N m", ge=0)]], ...] | None,
        WITH_MOTOR,
        Sets("engine.points"),
    ] = None
    """full-load curve of an engine that limits the motor: [speed, torque] of its shaft, or a file of them"""
    gear_ratio: Annotated[Annotated[float, ratio(gt=0)] | None, When(engine_points=GIVEN), Sets("gear.ratio")] = None
    """engine speed over sprocket speed"""
    demand: bool = False
    """its inputs speed.demand and torque.demand say how it turns, which `connections` bring; mode: which one counts"""
    demand_lag: Annotated[
        Annotated[float, In("s", gt=0)] | None, WhenAny(When(demand=(True,)), HELD), Sets("demand.lag")
    ] = None
    """time constant with which speed or torque follow their demand, or held points are followed"""

    @model_validator(mode="after")
    def _check_points(self) -> DriveTable:
        for key in ("speed_points", "torque_points", "brake_points", "engine_points"):
            points = getattr(self, key)
            if points is not None and not (points and _rise(first for first, _ in points)):
                raise ValueError(
                    f"{key}: needs at least one point, and {'speeds' if key == 'engine_points' else 'times'} that rise"
                )
        if self.stop is not None and self.stop < self.ramp_start + self.ramp_time:
            raise ValueError(
                f"stop = {self.stop:g} s must not be before the ramp ends, {self.ramp_start + self.ramp_time:g} s"
            )
        return self

    @property
    def follows(self) -> bool:
        """Whether it follows demands or commands with a lag."""
        return self.demand or self.interpolation == "hold"

    @property
    def top_speed(self) -> float | None:
        """Largest speed of the profile, rad/s; None in mode torque, or where inputs demand it."""
        if self.mode == "torque" or self.demand:
            return None
        return max(abs(speed) for _, speed in self.speed_points or ((0.0, self.speed),))

    def parameters(self) -> Parameters:
        """Parameters of the drive."""
        asked = max(abs(torque) for _, torque in self.torque_points or ((0.0, self.torque),))
        uncut = {"torque.limit": max(asked, TORQUE_LIMIT)} if self.mode == "torque" else {}  # without its own limit
        return {**uncut, "ramp.end": self.ramp_start + self.ramp_time, **super().parameters()}


class SteeringTable(DriveTable):
    """Drive of the speed difference, right less left, of a steering differential."""

    mode: Mode = "speed"
    """prescribed speed difference; constant motor torque and brake; or a torque that controls the difference"""


class VehicleDriveTable(DriveTable):
    """Drive of both sides of a vehicle; tables ``left`` and ``right`` override it.

    With ``steering`` a differential joins both sprockets, and the drive sets the mean of their speeds.
    """

    left: DriveTable | None = None
    """what the left side has instead of the keys of [drive]"""
    right: DriveTable | None = None
    """what the right side has instead of the keys of [drive]"""
    steering: Annotated[SteeringTable | None, OR_FALSE] = None
    """steering differential: drives the right speed less the left one, [drive] their mean; excludes left and right"""

    @classmethod
    def inactive(cls, table: Mapping[str, Any]) -> Iterator[str]:
        """As of any table; a key of [drive] counts that does so on one side."""
        common = {key: value for key, value in table.items() if key in DriveTable.model_fields}
        given = {side: entry if isinstance(entry := table.get(side), Mapping) else {} for side in SIDES}
        inactive = {side: [*DriveTable.inactive({**common, **entry})] for side, entry in given.items()}
        yield from (key for key in common if all(key in keys for keys in inactive.values()))
        yield from (f"{side}.{key}" for side in SIDES for key in inactive[side] if key in given[side])
        if isinstance(steering := table.get("steering"), Mapping):
            yield from (f"steering.{key}" for key in SteeringTable.inactive(steering))

    @model_validator(mode="before")
    @classmethod
    def _merge_sides(cls, value: object) -> object:
        if not isinstance(value, Mapping) or not any(isinstance(value.get(side), Mapping) for side in SIDES):
            return value
        common = {key: entry for key, entry in value.items() if key in DriveTable.model_fields}
        nowhere = {*cls.inactive(value)}

        def with_common(own: Mapping[str, Any]) -> dict[str, Any]:
            """A side's keys and those of [drive], without what counts on the other side alone."""
            elsewhere = {*DriveTable.inactive({**common, **own})} - {*own} - nowhere
            return {key: entry for key, entry in {**common, **own}.items() if key not in elsewhere}

        sides = {side: own for side in SIDES if isinstance(own := value.get(side) or {}, Mapping)}
        others = {key: entry for key, entry in value.items() if key not in common}
        return {**others, **with_common({}), **{side: with_common(own) for side, own in sides.items()}}

    @model_validator(mode="after")
    def _normalise_sides(self) -> VehicleDriveTable:
        """Name both sides if they differ, neither if they are equal (common settings then)."""
        left, right = (getattr(self, side) or self._common_drive() for side in SIDES)
        sides = {} if left == right else {"left": left, "right": right}
        if sides and self.steering is not None:
            raise ValueError("left and right exclude steering: a differential turns both, by their mean and difference")
        if (steering := self.steering) and len({one.demand_lag for one in (left, steering) if one.follows}) > 1:
            raise ValueError("demand_lag and steering.demand_lag must be equal: a differential follows with one lag")
        return self.model_construct(None, **left.model_dump(), **sides, steering=self.steering)

    @model_serializer(mode="wrap")
    def _serialise_sides(self, serialise: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {key: value for key, value in serialise(self).items() if (key in SIDES) == self.steers}

    def _common_drive(self) -> DriveTable:
        return DriveTable.model_construct(**{key: getattr(self, key) for key in DriveTable.model_fields})

    @property
    def steers(self) -> bool:
        """True if the drives of the sides differ."""
        return self.left is not None and self.right is not None

    def motors(self) -> dict[str, DriveTable]:
        """All drives by their keys."""
        drives = {"drive.left": self.left, "drive.right": self.right} if self.steers else {"drive": self}
        return {key: drive for key, drive in {**drives, "drive.steering": self.steering}.items() if drive is not None}

    def of_side(self, side: Side) -> DriveTable:
        """Drive of a side."""
        return getattr(self, side) or self


def _arc(pair: object) -> object:
    """Arc of a path in SI: [length, curvature], or [0, angle] for a turn on the spot."""
    if not isinstance(pair, list | tuple) or len(pair) != 2:
        return pair
    length = to_si("m")(pair[0])
    second = to_si("rad/m" if length else "rad")(pair[1])
    if not length and not second:
        raise ValueError("an arc of length 0 turns on the spot: its second number is the angle, not 0")
    return length, second


Arc = Annotated[tuple[Place, Annotated[float, In("rad/m", ge=-1e3, le=1e3)]], BeforeValidator(_arc)]


class DriverTable(ParameterTable):
    """Driver that follows a path or heads in a direction; the path begins below the middle road wheel.

    Without arcs and points the driver holds the heading of the start, turned by ``heading``. Keys that are not given
    take the driver's defaults.
    """

    arcs: Annotated[tuple[Arc, ...] | None, OR_FALSE, Sets("path.arcs")] = None
    """[length, curvature], left positive, a negative length backwards, [0, angle] on the spot; or a file of them"""
    points: Annotated[tuple[tuple[Place, Place], ...] | None, OR_FALSE, Sets("path.points")] = None
    """[x, y] of a smooth path, or a file of them"""
    heading: Annotated[Angle | None, Sets()] = None
    """heading to hold, from that of the start, where there is no path"""
    speed: Annotated[float, In("m/s", ge=0, le=1e3), When(speed_points=(None,)), Sets("speed.end")] = 0.0
    """speed after the ramp"""
    ramp_start: Annotated[Time, When(speed_points=(None,)), RAMP_START] = 0.0
    """time at which the ramp of the speed begins"""
    ramp_time: Annotated[Time, When(speed_points=(None,))] = 1.0
    """length of the ramp, half a cosine from 0 to speed"""
    speed_points: Annotated[tuple[tuple[Time, Annotated[float, In("m/s", ge=0)]], ...] | None, Sets("speed.points")] = (
        None
    )
    """[time, speed] or a file of them, instead of the ramp"""
    interpolation: Annotated[Interpolation, When(speed_points=GIVEN)] = "linear"
    """as of [drive]; the demand jumps, and the drives follow it"""
    deceleration: Annotated[Annotated[float, In("m/s^2", gt=0)] | None, Sets()] = None
    """deceleration before curves and the end of the path"""
    lateral_acceleration: Annotated[Annotated[float, In("m/s^2", gt=0)] | None, Sets("acceleration.lateral")] = None
    """largest speed times yaw rate: limits speed and curvature"""
    reach: Annotated[Distance | None, Sets()] = None
    """least look-ahead distance"""
    preview: Annotated[Time | None, Sets()] = None
    """look-ahead time; the larger of both counts"""
    width: Annotated[Distance | None, Sets(default=False)] = None
    """distance of two tracks without slip that would turn the vehicle alike; without it 1.4 times that of the tracks"""
    friction: Annotated[Annotated[float, ratio(ge=0)] | None, Sets(default=False)] = None
    """friction assumed for the plan; without it that of the ground"""
    grip: Annotated[Annotated[float, ratio(ge=0.05, le=0.9)] | None, Sets()] = None
    """share of the friction that the plan uses"""

    @model_validator(mode="after")
    def _check_path(self) -> DriverTable:
        paths = [key for key in ("arcs", "points", "heading") if getattr(self, key) is not None]
        if len(paths) > 1:
            raise ValueError(f"{paths[0]} and {paths[1]} exclude each other")
        for key, least in (("arcs", 1), ("points", 2), ("speed_points", 1)):
            if (pairs := getattr(self, key)) is not None and len(pairs) < least:
                raise ValueError(f"{key}: needs at least {least} of them, not {len(pairs)}")
        if not _rise(time for time, _ in self.speed_points or ()):
            raise ValueError("speed_points: needs times that rise")
        for k, (first, second) in enumerate(pairwise(self.points or ())):
            if first == second:
                raise ValueError(f"points: number {k + 1} and {k + 2} are the same place, {list(first)}")
        for key in ("deceleration", "reach", "preview"):
            if getattr(self, key) is not None and self.arcs is None and self.points is None:
                raise ValueError(f"{key} needs a path, arcs or points")
        return self

    @property
    def top_speed(self) -> float:
        """Largest demanded speed, m/s."""
        return max(speed for _, speed in self.speed_points or ((0.0, self.speed),))

    def parameters(self) -> Parameters:
        """Parameters of the driver."""
        return {**super().parameters(), "ramp.end": self.ramp_start + self.ramp_time}


class HitchTable(ParameterTable):
    """Load on the hitch of the vehicle: horizontal, rearward in the direction of the hull.

    It rises from 0 to its value along half a cosine from ``ramp_start`` on for ``ramp_time``.
    """

    force: Annotated[Force, Sets("hitch.load.force")] = 0.0
    """constant force of the load, rearward; negative: it pushes"""
    drag_points: Annotated[tuple[tuple[Annotated[float, In("m/s")], Force], ...] | None, Sets("hitch.load.points")] = (
        None
    )
    """[speed, force] or a file of them, besides the constant force: load over the speed of the hitch along the
    hull, linear between points, constant outside"""
    ramp_start: Annotated[Time, Sets("hitch.load.ramp.start")] = 0.0
    """time at which the ramp of the load begins"""
    ramp_time: Time = 1.0
    """length of the ramp, half a cosine from 0 to the load"""

    @model_validator(mode="after")
    def _check_points(self) -> HitchTable:
        if self.drag_points == () or not _rise(speed for speed, _ in self.drag_points or ()):
            raise ValueError("drag_points: needs at least one point, and speeds that rise")
        return self

    def parameters(self) -> Parameters:
        """Parameters of the chassis."""
        return {**super().parameters(), "hitch.load.ramp.end": self.ramp_start + self.ramp_time}
