"""Phases of a run: rest, acceleration, steady motion, turn and braking, with figures for each.

Speed and yaw rate of the hull are approximated by straight pieces (``results/approximations.py``), which follow a ramp
and leave out ringing. Each piece has a state:

    speed      grows or falls: its size changes by more than RATE; else the vehicle rests or moves on
    yaw rate   left, right: the mean is beyond TURNS and the heading changes by more than TURNED; else straight

A growth or fall needs a change of CHANGE of the largest speed, or of LARGE if it is shorter than QUICK: less is pitch
oscillation of the hull, which decays within a few half seconds. A piece through zero is split in two. A phase is an
interval in which both states are constant: ``steady`` at constant speed; ``turn`` at constant speed with a yaw rate;
``acceleration`` and ``braking`` give their turn in ``turning``. An interval shorter than SHORTEST joins its
neighbour.

Parts of constant speed that follow each other and move the same way rest or move on as one, before and after they
are joined. Thresholds of length and speed are those of a vehicle with tracks of TRACK; others scale with the length
of the track and, at equal Froude numbers, with its root.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import groupby, pairwise
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, slip
from orchestrator.results.approximations import LineFitter, breaks
from orchestrator.results.energy import without_energies
from orchestrator.results.ground_surface import on_terrain
from orchestrator.results.ground_under_vehicle import pose_signals, split
from orchestrator.results.run_data import EVER, Missing, RunData, Window, record_durations
from orchestrator.results.table import Table, without_rounding
from orchestrator.results.units import figure

PRECISION = 0.02  # of the largest speed or yaw rate: tolerance of the pieces, RMS
LEAST_SPEED, LEAST_YAW_RATE = 0.05, 0.01  # m/s, rad/s: lower bounds of the tolerance
RATE = 0.1  # m/s2: a smaller rate of change counts as constant speed
CHANGE, LARGE = 0.1, 0.25  # of the largest speed: least change of an acceleration, and of a quick one
QUICK = 1.0  # s
SWING = 0.5  # ratio of the end values: pieces through zero with a larger one are ringing
STANDS, STAYS = 0.02, 0.1  # m/s, m: rest is slower, or covers less distance
TRACK = 64 * 0.1524  # m, length of a track of the M113
TURNS, TURNED = 0.02, 0.05  # rad/s, rad
SHORTEST = 0.25  # s
ALIKE = 1e-3  # m/s: one figure for slips of both sides that differ by less
SAME = 1e-6  # of a tension: sides that differ by less count as equal
HELD = 0.5  # s: averaging time of the largest yaw rate
SIDES = {1: "left", -1: "right", 0: ""}
MOTION = ("speed", "yaw", "chassis.angular_velocity.z", "chassis.velocity.x", "chassis.velocity.y")


class Phase(NamedTuple):
    """Phase of a run; NaN for figures that the log lacks."""

    kind: str  # "rest", "acceleration", "steady", "turn", "braking"
    turning: str  # "left", "right" or ""
    start: float  # s
    end: float  # s
    way: float  # m, of the hull's centre of mass, along the ground
    speed: float  # m/s, forward, mean
    speed_start: float  # m/s
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


def sentence(phase: Mapping[str, Any]) -> str:
    """Sentence for a phase, given as ``Phase`` or as a JSON object."""
    figures: dict[str, Any] = {name: float("nan") if value is None else value for name, value in phase.items()}
    known = Phase(**figures)
    return "; ".join(filter(None, (_motion_clause(known), _turn_clause(known), _load_clause(known))))


def _motion_clause(phase: Phase) -> str:
    when = f"{phase.start:.4g} to {phase.end:.4g} s: {phase_name(phase)}"
    if phase.kind == "rest":
        return when
    changes = f"{', ' if phase.turning else ' '}from {rounded(phase.speed_start)} to {rounded(phase.speed_end)} m/s"
    speed = changes if phase.kind in ("acceleration", "braking") else f" at {figure(phase.speed)} m/s"
    return f"{when}{speed} over {figure(phase.way)} m"


def rounded(speed: float) -> str:
    """Speed to a hundredth, without a sign if that is 0."""
    return f"{round(speed, 2) + 0.0:.2f}"


def _turn_clause(phase: Phase) -> str:
    if not phase.turning:
        return ""
    rate, most, radius = (figure(value, 3) for value in (phase.yaw_rate, phase.yaw_rate_most, phase.radius))
    return f"yaw rate {rate} rad/s, {most} at most, radius {radius} m"


def _load_clause(p: Phase) -> str:
    slips = [each for each in (p.slip_left, p.slip_right) if each == each]
    alike = len(slips) < 2 or abs(slips[0] - slips[1]) < ALIKE
    shown = [f"{each:.3f}" for each in (slips[:1] if alike else slips)]
    parts = [
        f"power {figure(without_rounding(p.power / 1e3, 'kW'), 3)} kW" if p.power == p.power else "",
        f"slip {' and '.join(shown)} m/s{'' if alike else ' left and right'}" if slips else "",
        f"largest tension {figure(p.tension / 1e3)} kN in {p.tension_track.replace('_', ' ')} at {p.tension_t:.4g} s"
        if p.tension_track
        else "",
    ]
    return "" if p.kind == "rest" else ", ".join(filter(None, parts))


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
    t, v, yaw_rate = motion.t, motion.columns["chassis.speed"], motion.columns["chassis.chassis.angular_velocity.z"]
    size = _size(run)
    speeds, turns = _speed_states(t, v, size), _yaw_states(t, yaw_rate)
    edges = sorted({*speeds, *turns, len(t)})
    parts = [(a, b, (_latest(speeds, a), _latest(turns, a))) for a, b in pairwise(edges)]
    parts = _judged(t, v, _without_slivers(t, _judged(t, v, parts, size)), size)
    parts = _really_turning(t, np.unwrap(motion.columns["chassis.yaw"]), parts)
    return Phases(tuple(_figures(run, motion, a, min(b, len(t) - 1), *state) for a, b, state in parts))


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


# --- states ----------------------------------------------------------------------------------------


_Part = tuple[int, int, tuple[str, int]]  # first and last record, and both states


class _Piece(NamedTuple):
    """Straight piece with its values at both ends."""

    start: int
    end: int  # first record after it
    time: float
    first: float
    last: float

    @property
    def middle(self) -> float:
        return 0.5 * (self.first + self.last)


def _pieces(t: Floats, y: Floats, least: float, crossing: float) -> Iterator[_Piece]:
    """Straight pieces of a signal; pieces with ends beyond ``crossing`` on both sides of zero are split."""
    edges, lines = breaks(t, y, max(least, PRECISION * float(np.abs(y).max())))
    for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        piece = _piece(lines, a, b)
        if min(abs(piece.first), abs(piece.last)) > crossing and piece.first * piece.last < 0.0:
            middle = a + round((b - a) * piece.first / (piece.first - piece.last))
            if a < middle < b:
                share = piece.time * piece.first / (piece.first - piece.last)
                yield _Piece(a, middle, share, piece.first, 0.0)
                yield _Piece(middle, b, piece.time - share, 0.0, piece.last)
                continue
        yield piece


def _piece(lines: LineFitter, a: int, b: int) -> _Piece:
    line = lines.fit(a, b)
    time, half = float(line.time), 0.5 * float(line.slope * line.time)
    return _Piece(a, b, time, float(line.middle) - half, float(line.middle) + half)


def _speed_states(t: Floats, v: Floats, size: float) -> dict[int, str]:
    """States by their first record: "acceleration", "braking" or, at constant speed, ""."""
    top, least = float(np.abs(v).max()), LEAST_SPEED * size**0.5
    parts = [(p, _trend(p)) for p in _pieces(t, v, least, CHANGE * top)]
    states: dict[int, str] = {}
    for group in _grouped(parts):
        first, last, trend = group[0][0], group[-1][0], group[0][1]
        time, change = sum(p.time for p, _ in group), abs(abs(last.last) - abs(first.first))
        if trend and change >= max((LARGE if time < QUICK else CHANGE) * top, 2.0 * least):
            states[first.start] = "acceleration" if trend > 0 else "braking"
        else:
            states[first.start] = ""
    return states


def _judged(t: Floats, v: Floats, parts: list[_Part], size: float) -> list[_Part]:
    """Parts at constant speed as "rest" or "steady": neighbours that move the same way count as one."""
    durations, top = record_durations(t), float(np.abs(v).max())
    times, places = (np.concatenate([[0.0], np.cumsum(each)]) for each in (durations, durations * v))

    def direction(part: _Part) -> int | str:
        """Direction of motion, 0 of a part that stands, or the state of one at another than constant speed."""
        a, b, (state, _) = part
        time, way = times[b] - times[a], places[b] - places[a]
        slow = abs(way) < STANDS * size**0.5 * time
        return state if state in ("acceleration", "braking") else 0 if slow else int(np.sign(way))

    judged: list[_Part] = []
    groups = [(state, list(group)) for state, group in groupby(parts, key=direction)]
    states = ["", *(state for state, _ in groups), ""]
    for (state, members), before, after in zip(groups, states[:-2], states[2:], strict=True):
        a, b = members[0][0], members[-1][1]
        time, way = times[b] - times[a], abs(places[b] - places[a])
        little = way < STAYS * size or (time < QUICK and way < CHANGE * top * time)
        moves = before == "acceleration" or after == "braking"  # it has gained the speed, or has it to lose
        kind = state if isinstance(state, str) else "rest" if not state or (little and not moves) else "steady"
        judged += [(*part[:2], (kind, part[2][1])) for part in members]
    return _merged(judged)


def _trend(piece: _Piece) -> int:
    """Trend of the size of a piece: 1 grows, -1 falls, 0 constant or ringing about zero."""
    sizes = abs(piece.first), abs(piece.last)
    swings = piece.first * piece.last < 0.0 and min(sizes) > SWING * max(sizes)
    change = sizes[1] - sizes[0]
    return 0 if swings or abs(change) < RATE * piece.time else int(np.sign(change))


def _yaw_states(t: Floats, yaw_rate: Floats) -> dict[int, int]:
    """States by their first record: 1 left, -1 right, 0 straight."""
    parts = [
        (p, int(np.sign(p.middle)) if abs(p.middle) > TURNS else 0) for p in _pieces(t, yaw_rate, LEAST_YAW_RATE, TURNS)
    ]
    return {
        group[0][0].start: group[0][1] if abs(sum(p.time * p.middle for p, _ in group)) > TURNED else 0
        for group in _grouped(parts)
    }


def _grouped(parts: list[tuple[_Piece, int]]) -> list[list[tuple[_Piece, int]]]:
    """Groups of neighbours with the same label."""
    groups: list[list[tuple[_Piece, int]]] = []
    for part in parts:
        if groups and groups[-1][-1][1] == part[1]:
            groups[-1].append(part)
        else:
            groups.append([part])
    return groups


def _latest(states: Mapping[int, Any], record: int) -> Any:
    return states[max(start for start in states if start <= record)]


def _without_slivers(t: Floats, parts: list[_Part]) -> list[_Part]:
    """Join parts shorter than SHORTEST to a neighbour: one of the same speed state, else the longer one."""

    def length(part: _Part) -> float:
        return float(t[min(part[1], len(t) - 1)] - t[part[0]])

    parts = _merged(parts)
    while len(parts) > 1 and length(shortest := min(parts, key=length)) < SHORTEST:
        place = parts.index(shortest)
        neighbours = [k for k in (place - 1, place + 1) if 0 <= k < len(parts)]
        into = max(neighbours, key=lambda k: (parts[k][2][0] == shortest[2][0], length(parts[k])))
        parts[place] = (*shortest[:2], parts[into][2])
        parts = _merged(parts)
    return parts


def _really_turning(t: Floats, yaw: Floats, parts: list[_Part]) -> list[_Part]:
    """Make parts of turns straight whose own mean yaw rate is too small."""
    joined = []
    for a, b, (speed, turn) in parts:
        end = min(b, len(t) - 1)
        joined.append((a, b, (speed, turn if turn * (yaw[end] - yaw[a]) > TURNS * (t[end] - t[a]) else 0)))
    return _merged(joined)


def _merged(parts: list[_Part]) -> list[_Part]:
    """Merge neighbours of equal states."""
    joined: list[_Part] = []
    for a, b, state in parts:
        if joined and joined[-1][2] == state:
            joined[-1] = (joined[-1][0], b, state)
        else:
            joined.append((a, b, state))
    return joined


# --- figures ---------------------------------------------------------------------------------------


def _figures(run: RunData, motion: _Motion, a: int, b: int, speed: str, turn: int) -> Phase:
    """Figures of the phase from record a to record b."""
    t, columns = motion.t[a : b + 1], {name: values[a : b + 1] for name, values in motion.columns.items()}
    time, yaw, v = float(t[-1] - t[0]), np.unwrap(columns["chassis.yaw"]), columns["chassis.speed"]
    velocity = np.stack([columns.get(f"chassis.chassis.velocity.{axis}", np.zeros(len(t))) for axis in "xyz"], axis=1)
    pose = np.stack([columns[name] for name in pose_signals(run)], axis=1)
    way = float(np.trapezoid(split(run, velocity, pose)[0], t))
    turned = float(yaw[-1] - yaw[0])
    slip_left, slip_right = (_slip(columns.get(f"{side}_track.slip"), t) for side in ("left", "right"))
    tension, tension_t, tension_track = _largest_tension(run, motion, a + (a > 0), b + 1)
    return Phase(
        kind="turn" if turn and speed in ("rest", "steady") else speed,
        turning=SIDES[turn],
        start=float(t[0]),
        end=float(t[-1]),
        way=way,
        speed=float(np.trapezoid(v, t)) / time,
        speed_start=float(v[0]),
        speed_end=float(v[-1]),
        yaw_rate=turned / time,
        yaw_rate_most=_largest_rate(t, yaw),
        radius=way / abs(turned) if turn else float("nan"),
        power=float(columns["work"][-1] - columns["work"][0]) / time,
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
