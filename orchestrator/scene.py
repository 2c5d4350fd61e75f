"""A scene: what exists, how it starts, how long it runs and what is expected of it; frozen, complete, SI.

A scene file names a vehicle (or carries ``[vehicle]`` with ``base`` and what differs from it); the resolved
scene holds the whole vehicle table under ``vehicle``, so that a dotted key reaches every number of a run.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import Annotated, Any, ClassVar, Literal, get_args

from pydantic import BaseModel, BeforeValidator, Field, ValidationError, field_validator, model_validator

from fmus.vehicle import BadInput, Distance, Force, In, Length, Part, Vehicle, read_table, sentence
from orchestrator import gallery, measures

Duration = Annotated[float, In("s", gt=0)]
Time = Annotated[float, In("s", ge=0)]
Every = Annotated[int, Field(ge=1)]


class Run(Part):
    """How long, in which steps, and how often results are recorded."""

    stop: Duration
    step: Duration  # communication step H
    outputs: Every = 1  # outputs are recorded every n communication steps
    links: Every = 10  # per-link outputs are recorded every n communication steps

    @model_validator(mode="after")
    def _whole_steps(self) -> Run:
        if abs(self.stop / self.step - round(self.stop / self.step)) > 1e-6 or self.stop < self.step:
            raise ValueError(f"stop = {self.stop:g} s must be a multiple of step = {self.step:g} s")
        return self

    @property
    def steps(self) -> int:
        """Number of communication steps."""
        return round(self.stop / self.step)


class Start(Part):
    """Where the vehicle stands at the start, world frame."""

    position: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)
    heading: Annotated[float, In("rad")] = 0.0


class Track(Part):
    """Which track model, and what it is told; what is not given is the model's own default."""

    model: Literal["flexible", "rigid"]
    element: Literal["cable", "beam"] | None = None  # of flexible links
    elasticity: Literal["small_deformation", "general", "engineering"] | None = None  # of cables
    integrator: str | None = None
    step: Duration | None = None  # largest internal step
    start: Literal["rest", "displaced", "polygon"] = "rest"
    link_outputs: bool = True

    @model_validator(mode="after")
    def _rigid_links_have_none(self) -> Track:
        for key in ("element", "elasticity"):
            value = getattr(self, key)
            if self.model == "rigid" and value is not None:
                raise ValueError(f"{key} = '{value}' needs model = 'flexible': rigid links have none")
        if self.element == "beam" and self.elasticity not in (None, "small_deformation"):
            raise ValueError(f"elasticity = '{self.elasticity}' needs element = 'cable': a beam has but one")
        return self


class Drive(Part):
    """What turns a sprocket (or a braked idler).

    ``speed`` rises from 0 to its value along half a cosine from ``ramp_start`` on for ``ramp_time``, and is
    then held; ``torque`` is a constant motor torque; ``controller`` reaches the speed with a limited torque.
    """

    mode: Literal["speed", "torque", "controller"]
    speed: Annotated[float, In("rad/s")] = 0.0
    ramp_start: Time = 0.0
    ramp_time: Time = 1.0
    torque: Annotated[float, In("N m")] = 0.0
    torque_limit: Annotated[float, In("N m", gt=0)] | None = None
    brake: Annotated[float, In("N m", ge=0)] = 0.0


class Check(Part):
    """An expectation: a signal reduced over a window, or a named measure, against a value."""

    signal: str | None = None  # instance.variable
    reduce: Literal["mean", "min", "max", "last", "drop", "ripple", "rms"] = "mean"
    measure: str | None = None
    of: str = ""  # the side ("left", "right") or component a measure looks at
    start: Time = Field(0.0, alias="from")
    end: Time | None = Field(None, alias="to")  # default: the end of the run
    expected: float
    tolerance: Annotated[float, Field(ge=0)]
    relative: bool = False  # tolerance is a fraction of the expected value
    track: Literal["flexible", "rigid"] | None = None  # only for this track model

    @model_validator(mode="after")
    def _one_source(self) -> Check:
        if (self.signal is None) == (self.measure is None):
            raise ValueError("needs either signal or measure")
        if self.measure is not None and self.measure not in measures.NAMES:
            raise ValueError(f"no measure '{self.measure}': one of {', '.join(sorted(measures.NAMES))}")
        return self


def _short_track(value: object) -> object:
    return {"model": value} if isinstance(value, str) else value


class Scene(Part):
    """What every scene has; its kinds add what they assemble."""

    name: str
    title: str
    assembly: str
    vehicle: Vehicle
    track: Annotated[Track, BeforeValidator(_short_track)]
    run: Run
    start: Start = Start()
    expect: dict[str, Check] = Field(default_factory=dict)
    placed: bool = False  # whether the idler stands already where the chain carries its static tension

    drives: ClassVar[tuple[str, ...]] = ()  # the fields that describe drives

    @field_validator("expect")
    @classmethod
    def _checks_have_names(cls, value: dict[str, Check]) -> dict[str, Check]:
        for name in value:
            if not name.isidentifier():
                raise ValueError(f"'{name}' is no name for a check")
        return value

    def resolved(self) -> dict[str, Any]:
        """The scene as plain SI numbers; ``from_table`` makes the same scene of it."""
        return self.model_dump(mode="json", by_alias=True, exclude_none=True)


class Chain(Part):
    """An open chain between two fixed pins at the height of the origin."""

    links: Annotated[int, Field(ge=2, le=4096)]
    span: Annotated[float, Field(gt=0, lt=1)]  # distance of the pins over the length of the chain


class Bench(Part):
    """An open chain over one sprocket, its ends pulled by constant forces."""

    links: Annotated[int, Field(ge=8, le=4096)]
    upper: Force  # pull at the end of the upper (incoming) span, towards -x
    lower: Force  # pull at the end of the lower (outgoing) span, towards -x
    transverse_damping: Annotated[float, In("N s/m", ge=0)] = 0.0


class Rig(Part):
    """A closed chain round a sprocket and a smooth idler with fixed axles."""

    links: Annotated[int, Field(ge=8, le=4096)]
    axle_distance: Distance  # as drawn: the idler is moved until the chain carries the tension
    tension: Force


class ChainScene(Scene):
    """A chain and nothing else."""

    assembly: Literal["chain"]
    chain: Chain


class BenchScene(Scene):
    """A chain and a driven sprocket."""

    assembly: Literal["bench"]
    bench: Bench
    drive: Drive
    drives = ("drive",)


class RigScene(Scene):
    """A closed chain, a driven sprocket and a braked idler."""

    assembly: Literal["rig"]
    rig: Rig
    drive: Drive
    idler_drive: Drive
    drives = ("drive", "idler_drive")


class VehicleScene(Scene):
    """A vehicle on flat ground."""

    assembly: Literal["vehicle"]
    drive: Drive  # of both sides
    symmetric: bool = False  # only the left half runs, the right one mirrors it in the vehicle's own plane
    drives = ("drive",)


KINDS: dict[str, type[Scene]] = {
    "chain": ChainScene,
    "bench": BenchScene,
    "rig": RigScene,
    "vehicle": VehicleScene,
}


def load(scene: str, track: str | None = None, settings: Sequence[str] = ()) -> Scene:
    """Read a scene of the gallery or a file, with track model and ``KEY=VALUE`` settings; raises BadInput."""
    name, table = gallery.read(scene)
    changes = [_setting(text) for text in settings]
    if track is not None:
        changes.insert(0, ("track.model", track))
    table["track"] = _short_track(table.get("track", {}))
    for key, value in changes:
        if key == "vehicle":
            table["vehicle"] = value
    table["vehicle"] = _whole_vehicle(table.get("vehicle"), f"{name}.toml")
    for key, value in changes:
        if key == "track":
            key = "track.model"
        if key != "vehicle":
            _put(table, key, value)
    return from_table({"name": name, **table}, f"{name}.toml")


def from_table(table: Mapping[str, Any], where: str) -> Scene:
    """Validate a scene whose vehicle is a whole table; raises BadInput with one sentence."""
    assembly = table.get("assembly")
    if assembly not in KINDS:
        raise BadInput(f"{where}: assembly = {assembly!r}: must be one of {', '.join(KINDS)}")
    try:
        return KINDS[assembly].model_validate(dict(table))
    except ValidationError as error:
        raise BadInput(_complaint(error, where, KINDS[assembly])) from None


def _whole_vehicle(vehicle: object, where: str) -> dict[str, Any]:
    """The raw vehicle table: read by name, or a table laid over its ``base``."""
    if isinstance(vehicle, str):
        return read_table(vehicle)[0]
    if not isinstance(vehicle, dict):
        raise BadInput(f"{where}: vehicle must be a name, a .toml file or a table with 'base'")
    if "base" not in vehicle:
        return dict(vehicle)
    over = dict(vehicle)
    return _merged(read_table(str(over.pop("base")))[0], over)


def _merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """``above`` laid over ``below``, table by table."""
    result = dict(below)
    for key, value in above.items():
        both = isinstance(value, Mapping) and isinstance(result.get(key), Mapping)
        result[key] = _merged(result[key], value) if both else value
    return result


def _setting(text: str) -> tuple[str, Any]:
    """``key=value`` as a dotted key and a TOML value, or a string where it is no TOML value (``2 ms``)."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise BadInput(f"--set {text}: must be KEY=VALUE")
    try:
        return key.strip(), tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return key.strip(), value.strip()


def _put(table: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key; numbers step into arrays."""
    *path, last = key.split(".")
    place: Any = table
    for part in path:
        place = place[_index(place, part, key)] if isinstance(place, list) else place.setdefault(part, {})
        if not isinstance(place, dict | list):
            raise BadInput(f"unknown key '{key}': '{part}' is a value, not a table")
    place[_index(place, last, key) if isinstance(place, list) else last] = value


def _index(place: list[Any], part: str, key: str) -> int:
    if not part.isdigit() or int(part) >= len(place):
        raise BadInput(f"unknown key '{key}': '{part}' must be an index below {len(place)}")
    return int(part)


def keys(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """All dotted keys of a model."""
    for name, field in model.model_fields.items():
        key = prefix + (field.alias or name)
        yield key
        for part in (field.annotation, *get_args(field.annotation)):
            if isinstance(part, type) and issubclass(part, BaseModel):
                yield from keys(part, f"{key}.")


def _complaint(error: ValidationError, where: str, model: type[Scene]) -> str:
    """One sentence, with the nearest key where an unknown one was given."""
    text = sentence(error, where)
    first = error.errors()[0]
    if first["type"] != "extra_forbidden":
        return text
    near = get_close_matches(".".join(map(str, first["loc"])), keys(model), n=1)
    return f"{text}: did you mean '{near[0]}'?" if near else text
