"""Phases of a run: rest, acceleration, steady motion, turn, braking and slowing, with figures for each.

A phase is an interval in which the states of speed and yaw rate (``motion_states.py``) are constant: ``steady`` at
constant speed; ``turn`` at constant speed with a yaw rate; ``acceleration`` and ``braking`` give their turn in
``turning``. A ``braking`` through which the drives push on is ``slowing``: a load or a slope takes the speed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, slip
from orchestrator.results.analyses.motion_states import TRACK, Ends, parts_of
from orchestrator.results.energy import without_energies
from orchestrator.results.ground_surface import on_terrain
from orchestrator.results.ground_under_vehicle import pose_signals, split
from orchestrator.results.run_data import EVER, RunData, Window, record_durations
from orchestrator.results.table import Table

ALIKE = 1e-3  # m/s: one figure for slips of both sides that differ by less
SAME = 1e-6  # of a tension: sides that differ by less count as equal
HELD = 0.5  # s: averaging time of the largest yaw rate
CHANGING = "acceleration", "braking", "slowing"
SIDES = {1: "left", -1: "right", 0: ""}
MOTION = ("speed", "yaw", "chassis.angular_velocity.z", "chassis.velocity.x", "chassis.velocity.y")


class Phase(NamedTuple):
    """Phase of a run; NaN for figures that the log lacks."""

    kind: str  # "rest", "acceleration", "steady", "turn", "braking", "slowing"
    turning: str  # "left", "right" or ""
    start: float  # s
    end: float  # s
    way: float  # m, of the hull's centre of mass, along the ground
    speed: float  # m/s, forward, mean
    speed_start: float  # m/s, of the straight piece that follows the speed
    speed_end: float  # m/s
    yaw_rate: float  # rad/s, change of heading over time
    yaw_rate_most: float  # rad/s, largest mean over HELD, with its sign
    radius: float  # m, way over change of heading; NaN if straight
    power: float  # W, work of the drives over time
    slip_left: float  # m/s, of the links on the ground, mean; positive where the track drives, either way
    slip_right: float  # m/s
    tension: float  # N, largest of all links
    tension_t: float  # s
    tension_track: str  # track with this tension


class Phases(NamedTuple):
    """Phases in order of time, without gaps."""

    phases: tuple[Phase, ...]

    def table(self) -> Table:
        """Table with a row for each phase."""
        rows = [
            (
                phase_name(p), p.start, p.end, p.way, p.speed, p.speed_start, p.speed_end, p.yaw_rate, p.yaw_rate_most,
                p.radius, p.power / 1e3, p.slip_left, p.slip_right, p.tension / 1e3, p.tension_t, p.tension_track,
            )
            for p in self.phases
        ]  # fmt: skip
        columns = (
            ("phase", ""), ("from", "s"), ("to", "s"), ("way", "m"), ("speed", "m/s"), ("at first", "m/s"),
            ("at last", "m/s"), ("yaw rate", "rad/s"), ("largest", "rad/s"), ("radius", "m"), ("power", "kW"),
            ("slip left", "m/s"), ("slip right", "m/s"), ("largest tension", "kN"), ("at", "s"), ("in", ""),
        )  # fmt: skip
        note = f"largest yaw rate: of means over {HELD:g} s; a check of the signal takes single records"
        notes = (note,) if any(phase.turning for phase in self.phases) else ()
        return Table.of(f"{len(self.phases)} phases", columns, rows, notes)


def rounded(speed: float) -> str:
    """Speed to a hundredth, without a sign if that is 0."""
    return f"{round(speed, 2) + 0.0:.2f}"


class _Motion(NamedTuple):
    """Outputs at all steps, columns of equal length."""

    t: Floats
    columns: Mapping[str, Floats]


def phase_name(phase: Phase) -> str:
    """Name of a phase in words."""
    if phase.kind == "turn":
        return f"turn {phase.turning}"
    return f"{phase.kind}, turning {phase.turning}" if phase.turning else phase.kind


def of(run: RunData, window: Window = EVER) -> Phases:
    """Phases of a vehicle, computed once; raises Missing without the motion of a hull."""
    return run.compute_once(f"phases in {window}", lambda run: _found(run, window))


def _found(run: RunData, window: Window) -> Phases:
    motion = _read(run, window)
    speed, yaw, yaw_rate = (motion.columns[f"chassis.{name}"] for name in MOTION[:3])
    parts = parts_of(motion.t, speed, yaw_rate, np.unwrap(yaw), _size(run))
    return Phases(tuple(_figures(run, motion, *part, ends) for part, ends in parts))


def _size(run: RunData) -> float:
    """Length of a track over TRACK; 1 for a log without it."""
    try:
        return hull.vehicle_number(run, "track", "pitch") * hull.vehicle_number(run, "track", "links") / TRACK
    except Missing:
        return 1.0


def _read(run: RunData, window: Window) -> _Motion:
    """Read the motion up to the last common step or the first non-finite value; raises Missing."""
    names = [f"chassis.{name}" for name in MOTION]
    if on_terrain(run.scene):
        names += ["chassis.chassis.velocity.z", *pose_signals(run)[1:]]
    moving = len(names)
    if lacking := [name for name in names if not run.has(name)]:
        raise Missing(f"{run.log.path} holds no '{lacking[0]}': there are no phases without the motion of a hull")
    names += [f"{track}.{name}" for track in run.tracks for name in ("speed", "slip", "tension.max")]
    names = [name for name in names if run.has(name)]
    work_copies = {f"{name}.energy.work": run.copies(name) for name in run.instances if run.has(f"{name}.energy.work")}
    run.prefetch([*names, *work_copies], window)  # one pass
    samples = {name: run.signal(name, window) for name in [*names, *work_copies]}
    steps = min(len(t) for t, _ in samples.values())
    t = samples[names[0]][0][:steps]
    values = {name: column[:steps] for name, (_, column) in samples.items()}
    finite = np.isfinite(t) & np.all([np.isfinite(values[name]) for name in names[:moving]], axis=0)
    steps = steps if finite.all() else int(finite.argmin())
    if steps < 3:
        raise Missing(f"{run.log.path} holds too few steps for phases")
    values["work"] = (
        np.sum([n * values[name] for name, n in work_copies.items()], axis=0)
        if work_copies and not {*without_energies(run)} - {"chassis"}  # a hull puts no energy in
        else np.full_like(t, np.nan)
    )
    for pads in (name for name in names if name.endswith(".slip")):
        chain = values.get(pads.replace(".slip", ".speed"), np.ones_like(t))
        values[pads] = values[pads] * slip.towards(chain, values[pads])
    return _Motion(t[:steps], {name: column[:steps] for name, column in values.items()})


def _figures(run: RunData, motion: _Motion, a: int, b: int, state: tuple[str, int], ends: Ends) -> Phase:
    """Figures of the phase from record a to record b, or to the last one."""
    b, (speed, turn) = min(b, len(motion.t) - 1), state
    t, columns = motion.t[a : b + 1], {name: values[a : b + 1] for name, values in motion.columns.items()}
    time, yaw, v = float(t[-1] - t[0]), columns["chassis.yaw"], columns["chassis.speed"]
    velocity = np.stack([columns.get(f"chassis.chassis.velocity.{axis}", np.zeros(len(t))) for axis in "xyz"], axis=1)
    pose = np.stack([columns[name] for name in pose_signals(run)], axis=1)
    way = float(np.trapezoid(split(run, velocity, pose)[0], t))
    turned = float(yaw[-1] - yaw[0])
    work = columns["work"]
    slows = speed == "braking" and work[-1] > work[len(t) // 2]  # also after its middle: a brake may come on later
    slip_left, slip_right = (_slip(columns.get(f"{side}_track.slip"), t) for side in ("left", "right"))
    tension, tension_t, tension_track = _largest_tension(run, motion, a + (a > 0), b + 1)
    return Phase(
        kind="turn" if turn and speed in ("rest", "steady") else "slowing" if slows else speed,
        turning=SIDES[turn],
        start=float(t[0]),
        end=float(t[-1]),
        way=way,
        speed=float(np.trapezoid(v, t)) / time,
        speed_start=ends[0],
        speed_end=ends[1],
        yaw_rate=turned / time,
        yaw_rate_most=_largest_rate(t, yaw),
        radius=way / abs(turned) if turn else float("nan"),
        power=float(work[-1] - work[0]) / time,
        slip_left=slip_left,
        slip_right=slip_right,
        tension=tension,
        tension_t=tension_t,
        tension_track=tension_track,
    )


def _largest_rate(t: Floats, yaw: Floats) -> float:
    """Largest mean over HELD, or over the whole interval if that is shorter."""
    held = min(HELD, float(t[-1] - t[0]))
    begin = t[t <= t[-1] - held + 1e-9]
    rates = (np.interp(begin + held, t, yaw) - yaw[: len(begin)]) / held
    return float(rates[np.abs(rates).argmax()])


def _slip(values: Floats | None, t: Floats) -> float:
    """Mean over the steps that end in the interval."""
    return float("nan") if values is None else float(np.average(values[1:], weights=record_durations(t)[1:]))


def _largest_tension(run: RunData, motion: _Motion, a: int, b: int) -> tuple[float, float, str]:
    """Largest tension of all links, its time and track, in records a to b - 1."""
    names = [track for track in run.tracks if f"{track}.tension.max" in motion.columns]
    if not names:
        return float("nan"), float("nan"), ""
    tensions = {track: motion.columns[f"{track}.tension.max"][a:b] for track in names}
    most = max(float(values.max()) for values in tensions.values())
    track = next(name for name in names if tensions[name].max() >= most - SAME * abs(most))
    k = int(tensions[track].argmax())
    return float(tensions[track][k]), float(motion.t[a + k]), track
