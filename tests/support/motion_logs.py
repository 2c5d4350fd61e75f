"""Logs of vehicles with a given speed and yaw rate, and their phases."""

import made_logs
import numpy as np

from orchestrator.log.reader import Log
from orchestrator.results.analyses import phases
from orchestrator.results.run_data import EVER, RunData

STEP = 2e-3
CORNERS = (1.034, 3.018, 6.052, 7.146, 8.5)  # s: start, constant speed, braking, rest, end
TOP = 4.0  # m/s
TRACKS = ("left_track", "right_track")


def times(end, even=True):
    """Times with steps of 2 ms, or of 0.5 to 3.5 ms."""
    t = np.arange(0.0, end + 0.5 * STEP, STEP)
    return t if even else t + 0.75 * STEP * np.sin(37.0 * t) * (t > 0.0) * (t < t[-1])


def trapezoid(t, top=TOP, corners=CORNERS):
    """Speed, m/s, of a start, a constant speed and a stop."""
    return np.interp(t, corners[:4], (0.0, top, top, 0.0))


def motion_log(path, t, v, yaw_rate=None, slip=None, tension=None, work=None, tracks=TRACKS, scene=None):
    """Log of a vehicle with this motion; its heading is the integral of the yaw rate."""
    zero = np.zeros(len(t))
    yaw_rate = zero if yaw_rate is None else yaw_rate
    steps = np.diff(t)
    yaw = np.concatenate([[0.0], np.cumsum(0.5 * (yaw_rate[1:] + yaw_rate[:-1]) * steps)])
    hull = np.stack([v, (yaw + np.pi) % (2 * np.pi) - np.pi, yaw_rate, v * np.cos(yaw), v * np.sin(yaw)], axis=1)
    topics = {"/chassis/out": [(name, "1") for name in phases.MOTION], "/drive/out": [("energy.work", "J")]}
    rows = {"/chassis/out": (t, hull), "/drive/out": (t, (zero if work is None else work)[:, None])}
    for side, track in enumerate(tracks):
        topics[f"/{track}/out"] = [("travel", "m"), ("slip", "m/s"), ("tension.max", "N")]
        shown = zero if slip is None else slip * (1.0 + side)
        rows[f"/{track}/out"] = t, np.stack([zero, shown, zero if tension is None else tension - side], axis=1)
    return made_logs.made(path, topics, rows, scene, [topic.split("/")[1] for topic in topics], step=STEP)


def phases_of(path, window=EVER):
    """Phases of a log."""
    with Log(path) as log:
        return phases.of(RunData(log), window).phases
