"""Trials of a vehicle: their table, short runs with the vehicle, links and steps of a scene, limits found by them."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from fmus.vehicles.sides import ground_wheels, lopsided, thickness, way_a_turn
from fmus.vehicles.tables import BadInput
from fmus.vehicles.vehicle import VehicleTable
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results import output_files
from orchestrator.results.run_data import RunData
from orchestrator.results.table import Column
from orchestrator.scene.kinds import Scene, VehicleScene
from orchestrator.scene.scene import from_table, load
from orchestrator.studies import Case, Row
from orchestrator.studies.mobility.theory import ends

FITTINGS = ("hitch", "seat")  # tables of a vehicle that trials need
KEPT = ("step", "coupling")  # of the scene's table run
FIRM = 0.8  # friction of tracks on firm soil


class Trial(NamedTuple):
    """Kind of trial: its runs, and what is shown of their rows."""

    name: str  # item of the rows, part of names of files
    title: str
    columns: tuple[Column, ...]
    notes: tuple[str, ...]
    runs: Callable[[bool], Sequence[tuple[str, Callable[..., list[Row]], tuple[Any, ...], float]]]
    """Label, function of a scene's name and its arguments, seconds; with True those of a quick study."""
    draw: Callable[[Sequence[Row]], output_files.Picture]
    find: Callable[[Sequence[Row]], list[Finding]]  # what rows with figures say of the vehicle, for the summary

    def cases(self, scene: str, quick: bool) -> list[Case]:
        """Cases of the trial with the vehicle of a scene."""
        return [
            Case(self.name, label, function, (scene, *arguments), seconds)
            for label, function, arguments, seconds in self.runs(quick)
        ]


class Finding(NamedTuple):
    """Line of the summary."""

    measure: str
    value: float
    unit: str = ""
    low: float = math.nan  # least value by theory
    high: float = math.nan
    note: str = ""


class Limit(NamedTuple):
    """Limit between the largest value that is passed and the least one that is not."""

    passed: float  # NaN if none is
    failed: float  # NaN if none does
    runs: int
    reason: str  # why the least value that failed did
    doubts: str = ""  # warnings of the run that was passed


class Vehicle(NamedTuple):
    """Vehicle of a study, and its scales."""

    scene: VehicleScene
    table: VehicleTable
    length: float  # m, between the outer road wheels: its contact length
    weight: float  # N

    @property
    def mirrored(self) -> bool:
        """True if both sides are alike."""
        return not lopsided(self.table.model_dump())

    @property
    def front(self) -> float:
        """Foremost place of the tracks, m ahead of the sprocket axle."""
        x, _, radius = ends(self.table)[1]
        return x + radius + thickness(self.table.track.model_dump())

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
        """Speed of a sprocket, rad/s, whose chain runs at ``speed``, m/s: a pitch a pin."""
        return 2.0 * math.pi * speed / way_a_turn(self.table.model_dump())

    def drive(self, speed: float, ramp: float) -> dict[str, Any]:
        """Table of a drive whose chains reach ``speed``, m/s, in a ``ramp``, s."""
        return {"mode": "speed", "speed": self.sprocket(speed), "ramp_time": ramp}


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
    wheels = ground_wheels(table.model_dump())
    return Vehicle(loaded, table, wheels[0]["x"] - wheels[-1]["x"], table.gravity * table.total_mass())


def trial_scene(
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


class TrialRun(RunData):
    """Run of a trial; ``doubts`` names its warnings of validity, empty if there are none."""

    def __init__(self, log: Log, summary: Mapping[str, Any]) -> None:
        super().__init__(log)
        left = dict.fromkeys(entry["what"] for entry in summary["validity"])
        self.doubts = f"warnings: {', '.join(left)}" if left else ""


@contextmanager
def recorded(scene: Scene) -> Iterator[TrialRun]:
    """Run of a trial; its log is deleted with the context. Raises RuntimeError if it fails."""
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        path = Path(folder) / "run.mcap"
        summary = simulate(scene, path, raise_faults=True)
        if summary["status"] != "ok":
            raise RuntimeError(f"{scene.title}: {summary['message']}")
        with Log(path) as log:
            yield TrialRun(log, summary)


def run_up(vehicle: Vehicle, speed: float) -> float:
    """Time of a half-cosine ramp to ``speed``, m/s, with a fifth of gravity at most, s."""
    return max(2.0 * vehicle.time, 0.5 * math.pi * speed / (0.2 * vehicle.table.gravity))


def bisect(passes: Callable[[float], str], low: float, high: float, count: int) -> Limit:
    """Limit between ``low`` and ``high`` by ``count`` halvings; ``passes`` gives the reason of a failure, else ""."""
    for end, fails in ((low, True), (high, False)):
        reason = passes(end)
        if bool(reason) == fails:
            return Limit(float("nan"), low, 1, reason) if fails else Limit(high, float("nan"), 2, "")
    least = reason
    for _ in range(count):
        middle = 0.5 * (low + high)
        if reason := passes(middle):
            high, least = middle, reason
        else:
            low = middle
    return Limit(low, high, count + 2, least)


def search(
    attempt: Callable[[float], tuple[Scene, Callable[[TrialRun], str]]], low: float, high: float, halvings: int
) -> Limit:
    """Limit of a value by ``bisect``; ``attempt`` gives the scene of a value and why its run is no success, if so."""
    doubts: dict[float, str] = {}

    def passes(value: float) -> str:
        scene, judged = attempt(value)
        try:
            with recorded(scene) as run:
                doubts[value] = run.doubts
                return judged(run)
        except RuntimeError as failure:
            return str(failure)

    limit = bisect(passes, low, high, halvings)
    return limit._replace(doubts=doubts.get(limit.passed, ""))


def first_crossing(x: Sequence[float], y: Sequence[float], level: float) -> float:
    """Least x at which straight lines between points reach ``level``; infinite if they stay below."""
    if y[0] >= level:
        return x[0]
    for k in range(1, len(x)):
        if y[k] >= level:
            return x[k - 1] + (level - y[k - 1]) / (y[k] - y[k - 1]) * (x[k] - x[k - 1])
    return math.inf


def limit_speed(measure: str, speeds: Sequence[float], figures: Sequence[float], limit: float) -> Finding:
    """Finding of a limit speed, m/s, from figures at rising speeds."""
    found = first_crossing(speeds, figures, limit)
    if math.isinf(found):
        return Finding(measure, math.nan, "m/s", note=f"not up to {speeds[-1]:g} m/s")
    return Finding(measure, found, "m/s", note="already at the least speed" if found == speeds[0] else "")
