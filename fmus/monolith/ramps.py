"""Times at which the right-hand side of a monolith is not smooth: ramps and points of its drives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from fmus.drives.motor import TORQUE, DriveParameters

RESOLVED = 32  # internal steps in a ramp of a drive's speed, at least
JUMP = 1e-7  # s, the shortest ramp: a shorter one is as long as this

Ramp = tuple[float, float]  # begin and end, s


def without_jumps(drive: DriveParameters) -> DriveParameters:
    """The drive with jumps of speed replaced by ramps of JUMP s, because a jump has no slope to integrate."""
    return drive._replace(ramp_end=max(drive.ramp_end, drive.ramp_start + JUMP), stop_time=max(drive.stop_time, JUMP))


def ramps(shafts: Sequence[DriveParameters]) -> list[Ramp]:
    """Time intervals in which the right-hand side is smooth: ramps of speeds, lines of torques and brakes."""
    found = [ramp for drive in shafts if drive.mode != TORQUE for ramp in _of_speed(drive)]
    for course in (points for drive in shafts for points in (drive.torques, drive.brakes)):
        found += pairwise(course.time.tolist())
    return found


def _of_speed(drive: DriveParameters) -> list[Ramp]:
    """Ramps of a drive's speed."""
    if drive.speeds.time.size:
        return list(pairwise(drive.speeds.time.tolist()))
    ramp = (drive.ramp_start, drive.ramp_end)
    return [ramp, (drive.stop_start, drive.stop_start + drive.stop_time)] if drive.stop_start >= 0.0 else [ramp]


class Interval(NamedTuple):
    """Time interval without the ends of a ramp inside."""

    begin: float  # s
    length: float  # s
    steps: int  # least number of internal steps


def intervals(ramps: Sequence[Ramp], t: float, h: float, longest: float) -> Iterator[Interval]:
    """Parts of a step from t to t + h. (7)

    A part ends where a ramp begins or ends; internal steps take ``longest`` s at most.
    """
    inside = {end for ramp in ramps for end in ramp if t + 1e-9 * h < end < t + (1.0 - 1e-9) * h}
    for begin, end in pairwise([t, *sorted(inside), t + h]):
        within = [(b - a) / RESOLVED for a, b in ramps if a < 0.5 * (begin + end) < b]
        yield Interval(begin, end - begin, max(1, int(np.ceil((end - begin) / min([longest, *within]) - 1e-9))))
