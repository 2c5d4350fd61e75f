"""The driver's law: pure pursuit of a path, or a held heading; the slip of the tracks is learnt by an integral.

Pure pursuit: R. C. Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01 (1992). What is
steered is where the vehicle goes, not where it points: a tracked vehicle turns about a point ahead of its middle.
Tracks slip, so that the speeds of two sprockets turn the vehicle by about 0.7 of what their difference would without:
J. L. Martinez, A. Mandow, J. Morales, S. Pedraza, A. Garcia-Cerezo, Approximating kinematics for tracked mobile robots,
Int. J. Robotics Research 24 (2005), doi 10.1177/0278364905058239, give the tracks a larger distance, ``width`` here.
What it misses an integral of the yaw rate's error adds, which is ours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fmus.course import Course, at, given, interval, ramp
from fmus.driver import path as route
from fmus.drives.mount import stand
from fmus.jit import allocating, kernel
from fmus.model import no_rotation
from fmus.physics.rotation import quat_normalise, quat_to_matrix
from fmus.physics.vector import add, cross, scale, to_world, vector
from fmus.start import HEADING, place, stay

# where things stand in the flat state; from LEFT to CURVATURE they are shown
SLIP, LEFT, RIGHT, OFF, ASKEW, PROGRESS, SPEED, YAW_RATE, CURVATURE, LOST = range(10)
WIDTH = 10
SLOW = 0.1  # m/s: a slower vehicle is not steered
FAR = 1.0  # m beside the path: worth a warning
TURNED_NOT, ASTRAY = 1, 2  # failures
STEEP, FARTHEST = 2.0, 10.0  # the point that is pursued is so many times as far away as the path, up to so many m


class Law(NamedTuple):
    """Parameters of a driver, SI."""

    radius: float  # way of the vehicle a radian of its sprockets, m
    width: float  # distance of two tracks without slip that would turn the vehicle alike, m
    ahead: float  # place that follows the path, ahead of the hull's centre of mass, m
    heading: float  # to be held where there is no path, rad
    heading_gain: float  # yaw rate per error of it, 1/s
    reach: float  # least distance of the point that is pursued, m
    preview: float  # and in time, s
    gain: float  # of the yaw rate's error
    integral: float  # the same summed up, 1/s
    sharpest: float  # curvature, 1/m
    lateral: float  # acceleration, m/s2, that bounds speed on a curve and curvature at a speed
    deceleration: float  # towards curves and the end of the path, m/s2
    start_speed: float  # of the ramp, m/s
    end_speed: float
    ramp_start: float  # s
    ramp_end: float
    speeds: Course  # instead of the ramp


class Parts(NamedTuple):
    """A driver that drives."""

    law: Law
    drawn: route.Path  # from where the vehicle stands at the start, in its frame
    path: route.Path  # in the world
    centre: tuple[float, float, float]  # of mass of the hull, in the vehicle frame, m
    unconnected: np.ndarray  # (13) start values of the inputs: they say that nothing moves the hull
    standing: np.ndarray  # (13) it then stands still here
    seen: np.ndarray  # (13) what is taken of the inputs
    state: np.ndarray
    counters: np.ndarray  # (1) int


@allocating
def begin(c, told, p):
    """See ``fmus.model.Component``; p: the start pose."""
    told[0, 0], heading = c.law.ramp_end, p[HEADING]
    if c.law.ramp_end < c.law.ramp_start:
        return 1
    x, y, _ = place(p, c.centre[0] + c.law.ahead, c.centre[1], 0.0)
    cos, sin, drawn, path = math.cos(heading), math.sin(heading), c.drawn, c.path
    for k in range(path.x.size):
        path.x[k] = x + cos * drawn.x[k] - sin * drawn.y[k]
        path.y[k] = y + sin * drawn.x[k] + cos * drawn.y[k]
        path.heading[k] = drawn.heading[k] + heading
    stay(p, c.centre[0], c.centre[1], c.centre[2], c.standing, 0)
    c.state[:] = 0.0
    advance(c.law, path, c.state, 0.0, 0.0, c.standing)
    return 0


@allocating
def step(c, told, t, h, u):
    """See ``fmus.model.Component``; u: motion of the hull at t (13)."""
    x, seen, lost = c.state, c.seen, c.state[LOST] != 0.0
    for i in range(u.size):
        seen[i] = u[i]
    stand(seen, 0, c.unconnected, c.standing, 0)
    if no_rotation(told[0], t, 0, seen, 3):
        return TURNED_NOT
    advance(c.law, c.path, x, t, h, seen)
    for i in range(x.size):
        if not np.isfinite(x[i]):
            told[0, 0] = t
            return ASTRAY
    c.counters[0] += 1
    far = abs(x[OFF])
    if far > FAR and not lost:
        told[1, 0], told[1, 1], told[1, 2] = 1.0, t, far
    x[LOST] = 1.0 if far > FAR or (lost and far > 0.5 * FAR) else 0.0
    return 0


@kernel
def show(c, y):
    """See ``fmus.model.Component``."""
    for i in range(LOST - LEFT):
        y[i] = c.state[LEFT + i]


@allocating
def advance(p, path, x, t, h, u):
    """The demands of the step from t on, those of its middle, into x (WIDTH); u: motion of the hull at t (13)."""
    half = 0.5 * h
    A, v, w = quat_to_matrix(quat_normalise(u[3:7])), vector(u, 7), vector(u, 10)
    arm = to_world(A, (p.ahead, 0.0, 0.0))
    v = add(v, cross(w, arm))
    px, py, _ = add(add(vector(u, 0), arm), scale(half, v))
    heading = np.arctan2(A[1, 0], A[0, 0]) + half * w[2]
    c, s = np.cos(heading), np.sin(heading)
    forward, sideways = c * v[0] + s * v[1], c * v[1] - s * v[0]
    way = heading + np.arctan2(sideways, max(abs(forward), SLOW))
    x[SPEED] = at(p.speeds, t + half)[0] if given(p.speeds) else ramp(p, t + half)[0]
    if path.s.size > 0:
        follow(p, path, x, px, py, heading, way, abs(forward))
    else:
        x[ASKEW] = turned(heading - p.heading)
        x[CURVATURE] = bounded(p, -p.heading_gain * x[ASKEW] / max(forward, SLOW), forward)
    x[YAW_RATE] = x[CURVATURE] * max(forward, 0.0)
    if forward > SLOW:
        most = bounded(p, np.inf, forward) * forward
        x[SLIP] = min(max(x[SLIP] + h * p.integral * (x[YAW_RATE] - w[2]), -most), most)
    fades = x[SPEED] / np.sqrt(x[SPEED] ** 2 + SLOW**2)
    more = 0.5 * p.width * (x[YAW_RATE] + p.gain * (x[YAW_RATE] - w[2]) + x[SLIP]) * fades
    x[LEFT], x[RIGHT] = (x[SPEED] - more) / p.radius, (x[SPEED] + more) / p.radius


@kernel
def follow(p, path, x, px, py, heading, way, forward):
    """Progress along the path, errors, curvature towards the point ahead; slower where the path ends."""
    x[PROGRESS], x[OFF] = route.nearest(path, px, py, x[PROGRESS])
    x[ASKEW] = turned(heading - route.at(path, x[PROGRESS])[2])
    x[SPEED] = safe(p, path, x[PROGRESS], x[SPEED])
    gx, gy, _, _ = route.at(path, x[PROGRESS] + max(p.reach, p.preview * forward, min(STEEP * abs(x[OFF]), FARTHEST)))
    dx, dy = gx - px, gy - py
    ahead, left = np.cos(way) * dx + np.sin(way) * dy, np.cos(way) * dy - np.sin(way) * dx
    curvature = 2.0 * left / (dx * dx + dy * dy)
    if ahead < 0.0:  # behind: as sharply as may be
        curvature = np.inf if left >= 0.0 else -np.inf
    x[CURVATURE] = bounded(p, curvature, forward)


@kernel
def safe(p, path, s, speed):
    """A speed from which the vehicle can slow down to each curve ahead of ``s``, and to the end."""
    k, speed = interval(path.s, s), min(speed, np.sqrt(2.0 * p.deceleration * max(path.length - s, 0.0)))
    while k < path.s.size:
        free = 2.0 * p.deceleration * max(path.s[k] - s, 0.0)
        if free >= speed * speed:
            break
        if path.curvature[k] != 0.0:
            speed = min(speed, np.sqrt(p.lateral / abs(path.curvature[k]) + free))
        k += 1
    return speed


@kernel
def bounded(p, curvature, speed):
    """The curvature as far as the sharpest turn and the acceleration at this speed allow it."""
    most = min(p.sharpest, p.lateral / max(speed * speed, SLOW * SLOW))
    return min(max(curvature, -most), most)


@kernel
def turned(angle):
    """The angle between -pi and pi."""
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))
