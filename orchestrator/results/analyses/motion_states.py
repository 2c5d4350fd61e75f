"""States of motion of a vehicle over time, from the speed and yaw rate of its hull.

Both are approximated by straight pieces (``results/approximations.py``), which follow a ramp and leave out ringing.
Each piece has a state:

    speed      grows or falls: its size at the end is another than at the begin; else the vehicle rests or moves on
    yaw rate   left, right: the mean is beyond TURNS and the heading changes by more than TURNED; else straight

A growth or fall needs a change of CHANGE of the largest speed, or of LARGE if it is shorter than QUICK or slower than
RATE: less is drift, or pitch oscillation of the hull, which decays within a few half seconds. Below LARGE the line
through all its records must change by DRIFT of that too: its ends may be two points of an oscillation. A piece through
zero is split in two. A part is an interval in which both states are constant; one shorter than SHORTEST joins its
neighbour.

The speeds at the ends of a part are those of its pieces. They decide its state, of joined parts anew, and are what is
printed: no state contradicts them.

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
from orchestrator.results.approximations import LineFitter, breaks
from orchestrator.results.run_data import record_durations

PRECISION = 0.02  # of the largest speed or yaw rate: tolerance of the pieces, RMS
LEAST_SPEED, LEAST_YAW_RATE = 0.05, 0.01  # m/s, rad/s: lower bounds of the tolerance
RATE = 0.1  # m/s2: a piece with a smaller rate of change has no trend
CHANGE, LARGE = 0.1, 0.25  # of the largest speed: least change of an acceleration, and of a quick or slow one
QUICK = 1.0  # s
DRIFT = 0.5  # of a change: one of which the line through all records has less is between two points of a ringing
SWING = 0.5  # ratio of the end values: pieces through zero with a larger one are ringing
STANDS, STAYS = 0.02, 0.1  # m/s, m: rest is slower, or covers less distance
TRACK = 64 * 0.1524  # m, length of a track of the M113
TURNS, TURNED = 0.02, 0.05  # rad/s, rad
SHORTEST = 0.25  # s

Part = tuple[int, int, tuple[str, int]]  # first record, first one after it, and states of speed and turn


Ends = tuple[float, float]  # m/s, speeds at both ends


def parts_of(t: Floats, v: Floats, yaw_rate: Floats, yaw: Floats, length: float) -> list[tuple[Part, Ends]]:
    """Parts in order, without gaps, and their ends.

    States are "rest", "steady", "acceleration", "braking", and 1 left, -1 right, 0. Times t, s, speed, m/s, yaw rate,
    rad/s, and yaw without jumps, rad, (m,) each; ``length``: of the track over TRACK.
    """
    speed = _Speed(t, v, length)
    speeds, turns = {a: speed.state(a, b) for a, b in speed.spans.items()}, _yaw_states(t, yaw_rate)
    edges = sorted({*speeds, *turns, len(t)})
    parts = [(a, b, (_latest(speeds, a), _latest(turns, a))) for a, b in pairwise(edges)]
    parts = speed.judged(_really_turning(t, yaw, speed.judged(_without_slivers(t, speed.judged(parts)))))
    return [(part, speed.ends(*part[:2])) for part in parts]


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

    def at(self, record: int) -> float:
        """Value at the begin of a record of the piece, or at its end."""
        return self.first + (self.last - self.first) * (record - self.start) / (self.end - self.start)


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


class _Speed:
    """Straight pieces of the speed of a vehicle, and the states that follow from their ends."""

    def __init__(self, t: Floats, v: Floats, size: float) -> None:
        durations, self._v, self._size = record_durations(t), v, size
        self._times, self._places = (np.concatenate([[0.0], np.cumsum(each)]) for each in (durations, durations * v))
        self._top, self._least_change = float(np.abs(v).max()), 2.0 * LEAST_SPEED * size**0.5
        self._sizes = LineFitter(t, np.abs(v))
        self._pieces = [*_pieces(t, v, 0.5 * self._least_change, CHANGE * self._top)]
        groups = _grouped([(piece, _trend(piece)) for piece in self._pieces])
        self.spans = {group[0][0].start: group[-1][0].end for group in groups}  # of pieces of one trend

    def ends(self, a: int, b: int) -> Ends:
        """Speeds of the pieces at both ends of records a to b - 1, within the recorded ones, m/s."""
        first = next(piece for piece in reversed(self._pieces) if piece.start <= a).at(a)
        last = next(piece for piece in reversed(self._pieces) if piece.start < b).at(b)
        low, high = float(self._v[a : b + 1].min()), float(self._v[a : b + 1].max())
        return min(max(first, low), high), min(max(last, low), high)

    def state(self, a: int, b: int) -> str:
        """State of records a to b - 1, "" at constant speed; a part of an acceleration or braking needs less change."""
        first, last = self.ends(a, b)
        change, time = abs(last) - abs(first), self._times[b] - self._times[a]
        kind = "acceleration" if change > 0.0 else "braking"
        least = (CHANGE if time >= QUICK and abs(change) >= RATE * time else LARGE) * self._top
        begin, end = max(span for span in self.spans.items() if span[0] <= a)
        is_part = b - a < end - begin and b <= end and self.state(begin, end) == kind
        if abs(change) < max(0.0 if is_part else least, self._least_change):
            return ""
        line = _piece(self._sizes, a, b)
        small = not is_part and abs(change) < LARGE * self._top
        rings = small and (line.last - line.first) * np.sign(change) < DRIFT * least
        return "" if rings else kind

    def judged(self, parts: list[Part]) -> list[Part]:
        """Parts with states of their own ends, merged as long as neighbours are equal.

        At constant speed they are "rest" or "steady": neighbours that move the same way count as one.
        """
        parts = [(a, b, (self.state(a, b), turn)) for a, b, (_, turn) in parts]
        times, places, top = self._times, self._places, self._top

        def direction(part: Part) -> int | str:
            """Direction of motion, 0 of a part that stands, or the state of one at another than constant speed."""
            a, b, (state, _) = part
            time, way = times[b] - times[a], places[b] - places[a]
            slow = abs(way) < STANDS * self._size**0.5 * time
            return state or (0 if slow else int(np.sign(way)))

        judged: list[Part] = []
        groups = [(state, list(group)) for state, group in groupby(parts, key=direction)]
        states = ["", *(state for state, _ in groups), ""]
        for (state, members), before, after in zip(groups, states[:-2], states[2:], strict=True):
            a, b = members[0][0], members[-1][1]
            time, way = times[b] - times[a], abs(places[b] - places[a])
            little = way < STAYS * self._size or (time < QUICK and way < CHANGE * top * time)
            moves = before == "acceleration" or after == "braking"  # it has gained the speed, or has it to lose
            fastest = max(abs(end) for part in members for end in self.ends(*part[:2]))
            rests = fastest < max(LARGE * top, self._least_change) and (not state or (little and not moves))
            kind = state if isinstance(state, str) else "rest" if rests else "steady"
            judged += [(*part[:2], (kind, part[2][1])) for part in members]
        merged = _merged(judged)
        return merged if len(merged) == len(parts) else self.judged(merged)


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
    return [list(group) for _, group in groupby(parts, key=lambda part: part[1])]


def _latest(states: Mapping[int, Any], record: int) -> Any:
    return states[max(start for start in states if start <= record)]


def _without_slivers(t: Floats, parts: list[Part]) -> list[Part]:
    """Join parts shorter than SHORTEST to a neighbour: one of the same speed state, else the longer one."""

    def length(part: Part) -> float:
        return float(t[min(part[1], len(t) - 1)] - t[part[0]])

    parts = _merged(parts)
    while len(parts) > 1 and length(shortest := min(parts, key=length)) < SHORTEST:
        place = parts.index(shortest)
        neighbours = [k for k in (place - 1, place + 1) if 0 <= k < len(parts)]
        into = max(neighbours, key=lambda k: (parts[k][2][0] == shortest[2][0], length(parts[k])))
        parts[place] = (*shortest[:2], parts[into][2])
        parts = _merged(parts)
    return parts


def _really_turning(t: Floats, yaw: Floats, parts: list[Part]) -> list[Part]:
    """Make parts of turns straight whose own mean yaw rate is too small."""
    joined = []
    for a, b, (speed, turn) in parts:
        end = min(b, len(t) - 1)
        joined.append((a, b, (speed, turn if turn * (yaw[end] - yaw[a]) > TURNS * (t[end] - t[a]) else 0)))
    return _merged(joined)


def _merged(parts: list[Part]) -> list[Part]:
    """Merge neighbours of equal states."""
    groups = [(state, list(group)) for state, group in groupby(parts, key=lambda part: part[2])]
    return [(group[0][0], group[-1][1], state) for state, group in groups]
