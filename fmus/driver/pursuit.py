"""Control law of the driver: feed-forward of the planned motion, and feedback of the errors.

The plan of the path (``plan``) gives the yaw rate of the vehicle; the general theory of skid steering (``skid``) gives
the track speeds for it, with slip and yaw acceleration. Errors of place and direction decay as those of a pure pursuit
(R. C. Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01, 1992) of a point at the
distance L, but with critical damping instead of 1/sqrt(2). The direction of motion is controlled, not the heading,
because a tracked vehicle turns about a point ahead of its middle. Feedback of the yaw rate, with an integral, corrects
errors of the theory.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fmus.course import Course, at, given, ramp
from fmus.driver import path as route
from fmus.driver import plan as planning
from fmus.driver import skid
from fmus.drives.mount import stand
from fmus.jit import allocating, kernel
from fmus.model import no_rotation
from fmus.physics.rotation import quat_normalise, quat_to_matrix
from fmus.physics.vector import add, cross, scale, to_world, vector
from fmus.start import HEADING, place, stay

# indices in the flat state; LEFT to CURVATURE are outputs
LEARNT, LEFT, RIGHT, OFF, ASKEW, PROGRESS, SPEED, YAW_RATE, CURVATURE, LOST = range(10)
PIECE, HEADED, SLIPS = 10, 11, 12  # piece of the path; heading over revolutions; slip left, right, lateral velocity
WIDTH = 15
SLOW = 0.1  # speed below which the vehicle is not steered, m/s
FAR = 1.0  # distance from the path that is a warning, m
TURNED_NOT, ASTRAY = 1, 2  # failures
REST = 0.25  # time constant with which the remaining way to a stop decays, s
STANDS, THERE = 0.02, 0.02  # remaining way, m, and angle, rad, at which a piece and a turn on the spot are done
HARD = 1.5  # largest demanded yaw acceleration over what friction gives beside the resistance to turning
BLUNT = 4.0  # factor of the distance L over which a large error decays: v^2 e / L^3 is a yaw acceleration
PLANNED = 0.6  # share of the yaw acceleration that friction gives, for the plan
FULL = 0.95  # largest share of the friction that is demanded


class ControlLaw(NamedTuple):
    """Parameters of a driver, SI."""

    radius: float  # way of the vehicle for a radian of its sprockets, m
    width: float  # distance of two tracks without slip that would turn the vehicle alike, m: for errors
    ahead: float  # place that follows the path, ahead of the hull's centre of mass, m
    heading: float  # heading to hold where there is no path, rad
    heading_gain: float  # yaw rate for an error of the heading, 1/s
    reach: float  # least distance over which errors decay, m
    preview: float  # the same as a time, s
    gain: float  # gain of the yaw rate's error
    integral: float  # gain of its integral, 1/s
    sharpest: float  # largest curvature, 1/m
    lateral: float  # lateral acceleration that bounds speed on a curve and curvature at a speed, m/s2
    deceleration: float  # towards curves and the end of the path, m/s2
    start_speed: float  # speed before the ramp, m/s
    end_speed: float  # after the ramp
    ramp_start: float  # s
    ramp_end: float  # s
    speeds: Course  # replaces the ramp
    friction: float  # friction of tracks on the ground; 0: unknown, slip follows from ``width``
    creep: float  # regularisation velocity of the friction law, m/s
    grip: float  # share of the friction that the plan uses
    lag: float  # time constant with which the drives follow their demands, s
    yaw_lag: float  # further delay of the vehicle's yaw rate, s
    tolerance: float  # distance of the planned line from the path where that bends, m


class Parts(NamedTuple):
    """Data of a running driver: parameters, state and counters of its kernels."""

    law: ControlLaw
    footing: skid.Footing
    drawn: route.Path  # in the frame of the start
    path: route.Path  # in the world
    plan: planning.PathPlan
    centre: tuple[float, float, float]  # centre of mass of the hull in the vehicle frame, m
    unconnected: np.ndarray  # (13) start values of the inputs: a hull that has them is moved by nothing
    standing: np.ndarray  # (13) motion at rest of a hull that nothing moves
    seen: np.ndarray  # (13) inputs as the step uses them
    state: np.ndarray
    counters: np.ndarray  # (1) int


@allocating
def begin(c, messages, p):
    """See ``fmus.model.ComponentModel``; p: the start pose."""
    messages[0, 0], heading = c.law.ramp_end, p[HEADING]
    if c.law.ramp_end < c.law.ramp_start:
        return 1
    x, y, _ = place(p, c.centre[0] + c.law.ahead, c.centre[1], 0.0)
    cos, sin, drawn, path = math.cos(heading), math.sin(heading), c.drawn, c.path
    for k in range(path.x.size):
        path.x[k] = x + cos * drawn.x[k] - sin * drawn.y[k]
        path.y[k] = y + sin * drawn.x[k] + cos * drawn.y[k]
        path.heading[k] = drawn.heading[k] + heading
    planning.make(c.plan, path, bounds(c.law, c.footing))
    stay(p, c.centre[0], c.centre[1], c.centre[2], c.standing, 0)
    c.state[:] = 0.0
    c.state[HEADED] = heading
    advance(c, 0.0, 0.0, c.standing)
    return 0


@kernel
def bounds(p, footing):
    """Bounds of the plan."""
    top = max(p.start_speed, p.end_speed)
    for i in range(p.speeds.value.size):
        top = max(top, p.speeds.value[i])
    grip = p.grip * limit(p, footing)
    return planning.Bounds(
        top, p.lateral, grip, p.deceleration, PLANNED * turning(p, footing), p.tolerance, resists(footing)
    )


@kernel
def limit(p, footing):
    """Acceleration that friction gives, m/s2; inf where it is unknown."""
    return p.friction * footing.gravity if p.friction > 0.0 else np.inf


@kernel
def turning(p, footing):
    """Yaw acceleration that friction gives beside the resistance to turning, rad/s2; at least a tenth."""
    return limit(p, footing) * footing.mass * (1.0 - resists(footing)) * footing.half / footing.inertia


@kernel
def resists(footing):
    """Share of the friction that resists turning on the spot; at most nine tenths."""
    return min(footing.arm / footing.half, 0.9)


@allocating
def step(c, messages, t, h, u):
    """See ``fmus.model.ComponentModel``; u: motion (13) of the hull at t."""
    x, seen, lost = c.state, c.seen, c.state[LOST] != 0.0
    for i in range(u.size):
        seen[i] = u[i]
    stand(seen, 0, c.unconnected, c.standing, 0)
    if no_rotation(messages[0], t, 0, seen, 3):
        return TURNED_NOT
    advance(c, t, h, seen)
    for i in range(x.size):
        if not np.isfinite(x[i]):
            messages[0, 0] = t
            return ASTRAY
    c.counters[0] += 1
    far = abs(x[OFF])
    if far > FAR and not lost:
        messages[1, 0], messages[1, 1], messages[1, 2] = 1.0, t, far
    x[LOST] = 1.0 if far > FAR or (lost and far > 0.5 * FAR) else 0.0
    return 0


@kernel
def show(c, y):
    """See ``fmus.model.ComponentModel``."""
    for i in range(LOST - LEFT):
        y[i] = c.state[LEFT + i]


class SteeredPoint(NamedTuple):
    """Motion of the place that follows the path, world."""

    x: float  # m
    y: float  # m
    heading: float  # rad
    ahead: float  # m/s, along the hull
    left: float  # m/s, across the hull, positive to the left
    rate: float  # rad/s


class MotionTarget(NamedTuple):
    """Wanted motion of the vehicle."""

    speed: float  # m/s, negative backwards
    rate: float  # of the heading, rad/s
    turning: float  # derivative of the rate, rad/s2


@allocating
def advance(c, t, h, u):
    """Set the demands of a step, computed for its middle; u: motion (13) of the hull at t."""
    p, x, half = c.law, c.state, 0.5 * h
    A, v, w = quat_to_matrix(quat_normalise(u[3:7])), vector(u, 7), vector(u, 10)
    arm = to_world(A, (p.ahead, 0.0, 0.0))
    v = add(v, cross(w, arm))
    px, py, _ = add(add(vector(u, 0), arm), scale(half, v))
    heading = np.arctan2(A[1, 0], A[0, 0]) + half * w[2]
    x[HEADED] += turned(heading - x[HEADED])
    cos, sin = np.cos(heading), np.sin(heading)
    seen = SteeredPoint(px, py, x[HEADED], cos * v[0] + sin * v[1], cos * v[1] - sin * v[0], w[2])
    speed = at(p.speeds, t + half)[0] if given(p.speeds) else ramp(p, t + half)[0]
    before = x[SPEED]
    wish = follow(c, seen, speed, h) if c.path.s.size > 0 else hold(c, seen, speed, h)
    x[SPEED], x[YAW_RATE] = wish.speed, wish.rate
    command(c, seen, wish, (wish.speed - before) / h if h > 0.0 else 0.0, h)


@kernel
def hold(c, seen, speed, h):
    """Wish that holds the heading."""
    p, x = c.law, c.state
    x[ASKEW] = turned(seen.heading - p.heading)
    most = bound(p, c.footing, seen.ahead)
    x[CURVATURE] = min(max(-p.heading_gain * x[ASKEW] / max(seen.ahead, SLOW), -most), most)
    rate = x[CURVATURE] * max(seen.ahead, 0.0)
    return MotionTarget(paced(c, seen, speed, 0.0, h), rate, -p.heading_gain * rate)


@kernel
def follow(c, seen, speed, h):
    """Wish on the present piece of the path."""
    x, path, piece = c.state, c.path, int(c.state[PIECE])
    x[PROGRESS], x[OFF] = route.nearest(path, piece, seen.x, seen.y, x[PROGRESS])
    if done(path, piece, x[PROGRESS], seen) and piece + 2 < path.first.size:
        x[PROGRESS], x[PIECE] = route.ends(path, piece)[1], piece + 1.0
        piece += 1
    if on_the_spot(path, piece):
        return spin(c, piece, seen, speed, h)
    return drive(c, piece, seen, speed, h)


@kernel
def done(path, piece, s, seen):
    """Whether the vehicle has come to the end of a piece and stands."""
    if on_the_spot(path, piece):
        return abs(remaining(path, piece, seen)) < THERE and abs(seen.rate) < THERE
    return route.ends(path, piece)[1] - s < STANDS and abs(seen.ahead) < SLOW


@kernel
def on_the_spot(path, piece):
    """Whether a piece is a turn on the spot."""
    return path.s.size > 0 and path.direction[path.first[piece]] == 0.0


@kernel
def remaining(path, piece, seen):
    """Remaining angle of a turn on the spot, to the left, rad."""
    arc = path.first[piece]
    return path.heading[arc] + path.curvature[arc] - seen.heading


@kernel
def spin(c, piece, seen, speed, h):
    """Wish on a turn on the spot; half of the friction could stop it, and no track exceeds ``speed``."""
    p, x, left = c.law, c.state, remaining(c.path, piece, seen)
    x[ASKEW], x[CURVATURE], most = -left, 0.0, min(0.5 * turning(p, c.footing), 1.0)
    wanted = min(min(np.sqrt(2.0 * most * abs(left)), abs(left) / REST), 2.0 * speed / p.width)
    rate = min(max(wanted if left > 0.0 else -wanted, x[YAW_RATE] - most * h), x[YAW_RATE] + most * h)
    return MotionTarget(0.0, rate, (rate - x[YAW_RATE]) / h if h > 0.0 else 0.0)


@kernel
def drive(c, piece, seen, speed, h):
    """Wish along a piece: the plan, and the correction of errors. (4)"""
    p, x, s, direction = c.law, c.state, c.state[PROGRESS], c.path.direction[c.path.first[piece]]
    most, k, slope, off, askew = planning.at(c.plan, c.path, piece, s)
    most = min(most, max(route.ends(c.path, piece)[1] - s, 0.0) / REST)
    v = max(direction * seen.ahead, 0.0)
    wanted = paced(c, seen, direction * min(speed, most), v * v * slope, h)
    way = direction * np.arctan2(seen.left, max(v, SLOW))
    x[ASKEW] = turned(seen.heading - route.at(c.path, piece, s)[2])
    off, askew = x[OFF] - off, turned(x[ASKEW] + way - askew)
    far = max(p.reach, p.preview * v)
    if p.friction > 0.0:
        far = max(far, (BLUNT * v * v * abs(off) / turning(p, c.footing)) ** (1.0 / 3.0))
    back = -2.0 * direction * askew / far - np.arctan(off / (2.0 * far)) * 2.0 / far
    largest = bound(p, c.footing, v)
    x[CURVATURE] = min(max(k + back, -largest), largest)
    u, back = direction * v, x[CURVATURE] - k
    fades = -2.0 * v * back / far - u * askew / (far * far)
    pace = (wanted - x[SPEED]) / h if h > 0.0 else 0.0
    leans = direction * 2.0 * c.footing.leans / limit(p, c.footing) * abs(k) * u * (u * v * slope + pace * k)
    return MotionTarget(wanted, u * x[CURVATURE] + leans, u * (v * slope + fades) + pace * k)


@kernel
def paced(c, seen, speed, bend, h):
    """Speed, m/s, limited to the change that friction allows beside turning; ``bend``: yaw acceleration."""
    if h == 0.0 or c.law.friction == 0.0:
        return speed
    grip = c.law.grip * limit(c.law, c.footing)
    bend /= PLANNED * turning(c.law, c.footing)
    most = h * planning.left(grip, resists(c.footing), seen.rate, seen.ahead * seen.rate, bend)
    return min(max(speed, c.state[SPEED] - most), c.state[SPEED] + most)


@kernel
def bound(p, footing, speed):
    """Largest curvature at a speed, 1/m; corrections may use half of the friction that the plan leaves."""
    across = min(1.1 * p.lateral, 0.5 * (1.0 + p.grip) * limit(p, footing))
    return min(p.sharpest, across / max(speed * speed, SLOW * SLOW))


@kernel
def command(c, seen, wish, pace, h):
    """Set the demanded speeds of both sprockets. (5), (6)"""
    p, x, f = c.law, c.state, c.footing
    lacks = wish.rate - seen.rate
    if abs(seen.ahead) > SLOW:
        most = bound(p, f, seen.ahead) * abs(seen.ahead)
        x[LEARNT] = min(max(x[LEARNT] + h * p.integral * lacks, -most), most)
    moves = 1.0 if on_the_spot(c.path, int(x[PIECE])) else abs(wish.speed) / np.hypot(wish.speed, SLOW)
    more = 0.5 * p.width * (p.gain * lacks + x[LEARNT]) * moves
    if p.friction == 0.0:
        more += 0.5 * p.width * wish.rate * moves
        left, right = -more, more
    else:
        hard = HARD * turning(p, f)
        bend = min(max(wish.turning, -hard), hard)
        rate, most = wish.rate + (p.lag + p.yaw_lag) * bend, FULL * limit(p, f)
        across = min(max(seen.ahead * rate, -most), most)
        most = np.sqrt(most * most - across * across)
        along = min(max(pace - rate * x[SLIPS + 2], -most), most)
        z = x[SLIPS], x[SLIPS + 1], x[SLIPS + 2]
        z, _ = skid.slips(f, (p.friction, p.creep), rate, along, across, bend, z)
        x[SLIPS], x[SLIPS + 1], x[SLIPS + 2] = z
        left, right = z[0] - f.half * rate - more, z[1] + f.half * rate + more
    speed = wish.speed + p.lag * pace
    x[LEFT], x[RIGHT] = (speed + left) / p.radius, (speed + right) / p.radius


@kernel
def turned(angle):
    """Equivalent angle between -pi and pi."""
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))
