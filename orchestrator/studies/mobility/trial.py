"""Trials of a vehicle: short runs on grounds of the study, with the vehicle, links and steps of a scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

from fmus.vehicle import BadInput, VehicleTable
from orchestrator.log.reader import Log
from orchestrator.results.run_data import RunData
from orchestrator.scene.scene import Scene, VehicleScene, from_table, load
from orchestrator.studies.mobility.theory import ends
from orchestrator.studies.runs import logged

FITTINGS = ("hitch", "seat")  # tables of a vehicle that trials need
KEPT = ("step", "coupling")  # of the scene's table run
FIRM = 0.8  # friction of tracks on firm soil


class Vehicle(NamedTuple):
    """Vehicle of a study, and its scales."""

    scene: VehicleScene
    table: VehicleTable
    length: float  # m, between the outer road wheels: its contact length
    weight: float  # N

    @property
    def mirrored(self) -> bool:
        """True if both sides are alike."""
        return self.table.right is None

    @property
    def front(self) -> float:
        """Foremost place of the tracks, m ahead of the sprocket axle."""
        x, _, radius = ends(self.table)[1]
        return x + radius + 2.0 * self.table.track.face

    @property
    def time(self) -> float:
        """Time scale sqrt(length / gravity), s; 0.52 s for the m113."""
        return math.sqrt(self.length / self.table.gravity)

    @property
    def pace(self) -> float:
        """Walking pace, m/s: 0.4 sqrt(gravity length), to one digit; 2 m/s for the m113."""
        return float(f"{0.4 * self.length / self.time:.1g}")

    @property
    def seat(self) -> str:
        """First seat."""
        return next(iter(self.table.seat))

    def sprocket(self, speed: float) -> float:
        """Speed of a sprocket, rad/s, whose chain runs at ``speed``, m/s: a pitch a tooth."""
        return 2.0 * math.pi * speed / (self.table.sprocket.teeth * self.table.track.pitch)


def vehicle_of(scene: str) -> Vehicle:
    """Vehicle of a scene; raises BadInput for a scene without one, and for a vehicle without FITTINGS."""
    loaded = load(scene)
    if not isinstance(loaded, VehicleScene):
        raise BadInput(f"study mobility: {loaded.where}: assembly = '{loaded.assembly}': must be 'vehicle'")
    loaded.require_own_parts("study mobility runs")
    table = loaded.vehicle
    for name in FITTINGS:
        if not getattr(table, name):
            raise BadInput(f"study mobility: {loaded.where}: vehicle.{name}: {table.name} has none, and trials need it")
    length = max(table.road_wheel.x) - min(table.road_wheel.x)
    return Vehicle(loaded, table, length, table.gravity * table.total_mass())


def trial(
    vehicle: Vehicle, title: str, stop: float, *, whole: bool = False, friction: float | None = None, **tables: Any
) -> Scene:
    """Scene of a trial until ``stop``, s, rounded up to whole steps; ``whole``: both sides run although they are alike.

    ``friction``: another coefficient of the hard ground; ``tables``: ground, drive, hitch, seats, more of track and
    run. Raises BadInput.
    """
    resolved = vehicle.scene.resolved()
    if friction is not None:
        resolved["vehicle"]["contact"]["ground"]["friction"] = friction
    track: Mapping[str, Any] = resolved["track"]
    step = resolved["run"]["step"]
    table = {
        "name": vehicle.scene.name,
        "title": title,
        "assembly": "vehicle",
        "vehicle": resolved["vehicle"],
        "track": {**track, "link_outputs": False} | tables.pop("track", {}),
        "run": {**{key: resolved["run"][key] for key in KEPT}, "stop": step * math.ceil(stop / step)}
        | tables.pop("run", {}),
        "symmetric": vehicle.mirrored and not whole,
        "expect": {},
    }
    return from_table({**table, **tables}, f"study mobility: {title}")


class Trial(RunData):
    """Run of a trial; ``doubts`` names its warnings of validity, empty if there are none."""

    def __init__(self, log: Log, summary: Mapping[str, Any]) -> None:
        super().__init__(log)
        left = dict.fromkeys(entry["what"] for entry in summary["validity"])
        self.doubts = f"warnings: {', '.join(left)}" if left else ""


@contextmanager
def recorded(scene: Scene) -> Iterator[Trial]:
    """Run of a trial; its log is deleted with the context. Raises RuntimeError if it fails."""
    with logged(scene, scene.title) as (path, summary), Log(path) as log:
        yield Trial(log, summary)


def failure_of(scene: Scene, judged: Callable[[Trial], str]) -> str:
    """Reason why a vehicle does not pass a trial, of the run itself or as ``judged``; empty if it passes."""
    try:
        with recorded(scene) as run:
            return judged(run)
    except RuntimeError as failure:
        return str(failure)


def run_up(vehicle: Vehicle, speed: float) -> float:
    """Time of a half-cosine ramp to ``speed``, m/s, with a fifth of gravity at most, s."""
    return max(2.0 * vehicle.time, 0.5 * math.pi * speed / (0.2 * vehicle.table.gravity))
