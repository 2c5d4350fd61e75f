"""Control law of the driver: feed-forward of the planned motion, and feedback of the errors.

The plan of the path (``plan``) gives the yaw rate of the vehicle; the general theory of skid steering (``skid``) gives
the track speeds for it, with slip and yaw acceleration. Errors of place and direction decay as those of a pure pursuit
(R. C. Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01, 1992) of a point at the
distance L, but with critical damping instead of 1/sqrt(2). The direction of motion is controlled, not the heading,
because a tracked vehicle turns about a point ahead of its middle. Feedback of the yaw rate, with an integral, corrects
errors of the theory.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fmus.driver import path as route
from fmus.driver import plan as planning
from fmus.driver import skid
from fmus.drives.mount import rest_if_unconnected
from fmus.interface.model import no_rotation
from fmus.interface.profile import Profile, evaluate, has_points, ramp
from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.elementary import atan, atan2, cos, hypot, root, sin
from fmus.physics.rotation import quat_forward, quat_normalise
from fmus.physics.vector import add, cross, scale, vector
from fmus.start import HEADING, put_point_at_rest, world_position

# indices in the flat state; LEFT to CURVATURE are outputs
RATE_INTEGRAL, LEFT, RIGHT, LATERAL_ERROR, HEADING_ERROR, PROGRESS, SPEED, YAW_RATE, CURVATURE, LOST = range(10)
PIECE, TOTAL_HEADING, SLIPS = 10, 11, 12  # piece; heading over revolutions; slip left, right, lateral velocity
WIDTH = 15
LEAST_SPEED = 0.1  # speed below which the vehicle is not steered, m/s
LOST_DISTANCE = 1.0  # distance from the path that is a warning, m
BAD_QUATERNION, NOT_FINITE = 1, 2  # failures
STOP_TIME = 0.25  # time constant with which the remaining way to a stop decays, s
STOP_DISTANCE, STOP_ANGLE = 0.02, 0.02  # way, m, and angle, rad, that may remain of a piece, a turn on the spot
LARGEST_YAW_SHARE = 1.5  # largest demanded yaw acceleration over what friction gives beside the resistance to turning
ERROR_LENGTH_FACTOR = 4.0  # factor of the distance L over which a large error decays: v^2 e / L^3 is a yaw acceleration
PLANNED_YAW_SHARE = 0.6  # share of the yaw acceleration that friction gives, for the plan
LARGEST_FRICTION_SHARE = 0.95  # largest share of the friction that is demanded


class ControlLaw(NamedTuple):
    """Parameters of a driver, SI; one that the FMU has too bears its name, with "_" for a dot."""

    radius: float  # way of the vehicle for a radian of its sprockets, m
    width: float  # distance of two tracks without slip that would turn the vehicle alike, m: for errors
    ahead: float  # place that follows the path, ahead of the hull's centre of mass, m
    heading: float  # heading to hold where there is no path, rad
    heading_gain: float  # yaw rate for an error of the heading, 1/s
    reach: float  # least distance over which errors decay, m
    preview: float  # the same as a time, s
    yaw_gain: float  # gain of the yaw rate's error
    yaw_integral: float  # gain of its integral, 1/s
    curvature_largest: float  # largest curvature, 1/m
    acceleration_lateral: float  # lateral acceleration that bounds speed on a curve and curvature at a speed, m/s2
    deceleration: float  # towards curves and the end of the path, m/s2
    speed_start: float  # speed before the ramp, m/s
    speed_end: float  # after the ramp
    ramp_start: float  # s
    ramp_end: float  # s
    speeds: Profile  # replaces the ramp
    friction: float  # friction of tracks on the ground; 0: unknown, slip follows from ``width``
    creep: float  # regularisation velocity of the friction law, m/s
    grip: float  # share of the friction that the plan uses
    drive_lag: float  # time constant with which the drives follow their demands, s
    yaw_lag: float  # further delay of the vehicle's yaw rate, s
    path_tolerance: float  # distance of the planned line from the path where that bends, m


class Parts(NamedTuple):
    """Data of a running driver: parameters, state and counters of its kernels."""

    law: ControlLaw
    vehicle: skid.SkidVehicle
    local_path: route.Path  # in the frame of the start
    path: route.Path  # in the world
    plan: planning.PathPlan
    centre: tuple[float, float, float]  # centre of mass of the hull in the vehicle frame, m
    unconnected: np.ndarray  # (13) start values of the inputs: a hull that has them is moved by nothing
    rest_motion: np.ndarray  # (13) motion at rest of a hull that nothing moves
    inputs: np.ndarray  # (13) inputs as the step uses them
    state: np.ndarray
    counters: np.ndarray  # (1) int


@kernel
def begin(c: Parts, messages: Floats, p: Sequence[float]) -> int:
    """See ``interface.model.ComponentModel``; p: the start pose."""
    messages[0, 0], heading = c.law.ramp_end, p[HEADING]
    if c.law.ramp_end < c.law.ramp_start:
        return 1
    x, y, _ = world_position(p, c.centre[0] + c.law.ahead, c.centre[1], 0.0)
    along, across, local_path, path = cos(heading), sin(heading), c.local_path, c.path
    for k in range(path.x.size):
        path.x[k] = x + along * local_path.x[k] - across * local_path.y[k]
        path.y[k] = y + across * local_path.x[k] + along * local_path.y[k]
        path.heading[k] = local_path.heading[k] + heading
    planning.compute(c.plan, path, bounds(c.law, c.vehicle))
    put_point_at_rest(p, c.centre[0], c.centre[1], c.centre[2], c.rest_motion, 0)
    c.state[:] = 0.0
    c.state[TOTAL_HEADING] = heading
    advance(c, 0.0, 0.0, c.rest_motion)
    return 0


@kernel
def bounds(p: ControlLaw, vehicle: skid.SkidVehicle) -> planning.Bounds:
    """Bounds of the plan."""
    speed = max(p.speed_start, p.speed_end)
    for i in range(p.speeds.value.size):
        speed = max(speed, p.speeds.value[i])
    grip = p.grip * friction_limit(p, vehicle)
    return planning.Bounds(
        speed,
        p.acceleration_lateral,
        grip,
        p.deceleration,
        PLANNED_YAW_SHARE * largest_yaw_acceleration(p, vehicle),
        p.path_tolerance,
        turn_resistance(vehicle),
    )


@kernel
def friction_limit(p: ControlLaw, vehicle: skid.SkidVehicle) -> float:
    """Acceleration that friction gives, m/s2; inf where it is unknown."""
    return p.friction * vehicle.gravity if p.friction > 0.0 else np.inf


@kernel
def largest_yaw_acceleration(p: ControlLaw, vehicle: skid.SkidVehicle) -> float:
    """Yaw acceleration that friction gives beside the resistance to turning, rad/s2; at least a tenth."""
    return (
        friction_limit(p, vehicle)
        * vehicle.mass
        * (1.0 - turn_resistance(vehicle))
        * vehicle.half_gauge
        / vehicle.inertia
    )


@kernel
def turn_resistance(vehicle: skid.SkidVehicle) -> float:
    """Share of the friction that resists turning on the spot; at most nine tenths."""
    return min(vehicle.arm / vehicle.half_gauge, 0.9)


@kernel
def step(c: Parts, messages: Floats, t: float, h: float, u: Floats) -> int:
    """See ``interface.model.ComponentModel``; u: motion (13) of the hull at t."""
    x, inputs, was_lost = c.state, c.inputs, c.state[LOST] != 0.0
    for i in range(u.size):
        inputs[i] = u[i]
    rest_if_unconnected(inputs, 0, c.unconnected, c.rest_motion, 0, c.counters[0])
    if no_rotation(messages[0], t, 0, inputs, 3):
        return BAD_QUATERNION
    advance(c, t, h, inputs)
    for i in range(x.size):
        if not np.isfinite(x[i]):
            messages[0, 0] = t
            return NOT_FINITE
    c.counters[0] += 1
    distance = abs(x[LATERAL_ERROR])
    if distance > LOST_DISTANCE and not was_lost:
        messages[1, 0], messages[1, 1], messages[1, 2] = 1.0, t, distance
    x[LOST] = 1.0 if distance > LOST_DISTANCE or (was_lost and distance > 0.5 * LOST_DISTANCE) else 0.0
    return 0


@kernel
def write_outputs(c: Parts, y: Floats) -> None:
    """See ``interface.model.ComponentModel``."""
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
    """Target motion of the vehicle."""

    speed: float  # m/s, negative backwards
    rate: float  # of the heading, rad/s
    yaw_acceleration: float  # derivative of the rate, rad/s2


@kernel
def advance(c: Parts, t: float, h: float, u: Floats) -> None:
    """Set the demands of a step, computed for its middle; u: motion (13) of the hull at t."""
    p, x, half = c.law, c.state, 0.5 * h
    q, v, w = quat_normalise(u[3:7]), vector(u, 7), vector(u, 10)
    forward = quat_forward(q)
    arm = scale(p.ahead, forward)
    v = add(v, cross(w, arm))
    px, py, _ = add(add(vector(u, 0), arm), scale(half, v))
    heading = atan2(forward[1], forward[0]) + half * w[2]
    x[TOTAL_HEADING] += wrapped_angle(heading - x[TOTAL_HEADING])
    along, across = cos(heading), sin(heading)
    point = SteeredPoint(px, py, x[TOTAL_HEADING], along * v[0] + across * v[1], along * v[1] - across * v[0], w[2])
    speed = evaluate(p.speeds, t + half)[0] if has_points(p.speeds) else ramp(p, t + half)[0]
    before = x[SPEED]
    target = follow_path(c, point, speed, h) if c.path.s.size > 0 else hold_heading(c, point, speed, h)
    x[SPEED], x[YAW_RATE] = target.speed, target.rate
    set_demands(c, point, target, (target.speed - before) / h if h > 0.0 else 0.0, h)


@kernel
def hold_heading(c: Parts, point: SteeredPoint, speed: float, h: float) -> MotionTarget:
    """Target that holds the heading."""
    p, x = c.law, c.state
    x[HEADING_ERROR] = wrapped_angle(point.heading - p.heading)
    most = largest_curvature(p, c.vehicle, point.ahead)
    x[CURVATURE] = min(max(-p.heading_gain * x[HEADING_ERROR] / max(point.ahead, LEAST_SPEED), -most), most)
    rate = x[CURVATURE] * max(point.ahead, 0.0)
    return MotionTarget(limit_speed_change(c, point, speed, 0.0, h), rate, -p.heading_gain * rate)


@kernel
def follow_path(c: Parts, point: SteeredPoint, speed: float, h: float) -> MotionTarget:
    """Target on the present piece of the path."""
    x, path, piece = c.state, c.path, int(c.state[PIECE])
    x[PROGRESS], x[LATERAL_ERROR] = route.nearest(path, piece, point.x, point.y, x[PROGRESS])
    if piece_done(path, piece, x[PROGRESS], point) and piece + 2 < path.first.size:
        x[PROGRESS], x[PIECE] = route.piece_range(path, piece)[1], piece + 1.0
        piece += 1
    if is_turn_on_the_spot(path, piece):
        return turn_on_the_spot(c, piece, point, speed, h)
    return follow_piece(c, piece, point, speed, h)


@kernel
def piece_done(path: route.Path, piece: int, s: float, point: SteeredPoint) -> bool:
    """Whether the vehicle is at rest at the end of a piece."""
    if is_turn_on_the_spot(path, piece):
        return abs(remaining_angle(path, piece, point)) < STOP_ANGLE and abs(point.rate) < STOP_ANGLE
    return route.piece_range(path, piece)[1] - s < STOP_DISTANCE and abs(point.ahead) < LEAST_SPEED


@kernel
def is_turn_on_the_spot(path: route.Path, piece: int) -> bool:
    """Whether a piece is a turn on the spot."""
    return path.s.size > 0 and path.direction[path.first[piece]] == 0.0


@kernel
def remaining_angle(path: route.Path, piece: int, point: SteeredPoint) -> float:
    """Remaining angle of a turn on the spot, to the left, rad."""
    arc = path.first[piece]
    return path.heading[arc] + path.curvature[arc] - point.heading


@kernel
def turn_on_the_spot(c: Parts, piece: int, point: SteeredPoint, speed: float, h: float) -> MotionTarget:
    """Target on a turn on the spot; half of the friction could stop it, and no track exceeds ``speed``."""
    p, x, angle = c.law, c.state, remaining_angle(c.path, piece, point)
    x[HEADING_ERROR], x[CURVATURE], yaw_limit = -angle, 0.0, min(0.5 * largest_yaw_acceleration(p, c.vehicle), 1.0)
    rate_bound = min(min(np.sqrt(2.0 * yaw_limit * abs(angle)), abs(angle) / STOP_TIME), 2.0 * speed / p.width)
    rate = min(
        max(rate_bound if angle > 0.0 else -rate_bound, x[YAW_RATE] - yaw_limit * h), x[YAW_RATE] + yaw_limit * h
    )
    return MotionTarget(0.0, rate, (rate - x[YAW_RATE]) / h if h > 0.0 else 0.0)


@kernel
def follow_piece(c: Parts, piece: int, point: SteeredPoint, speed: float, h: float) -> MotionTarget:
    """Target along a piece: the plan, and the correction of errors. (4)"""
    p, x, s, direction = c.law, c.state, c.state[PROGRESS], c.path.direction[c.path.first[piece]]
    speed_limit, k, slope, offset, angle = planning.evaluate(c.plan, c.path, piece, s)
    speed_limit = min(speed_limit, max(route.piece_range(c.path, piece)[1] - s, 0.0) / STOP_TIME)
    v = max(direction * point.ahead, 0.0)
    speed_target = limit_speed_change(c, point, direction * min(speed, speed_limit), v * v * slope, h)
    way = direction * atan2(point.left, max(v, LEAST_SPEED))
    x[HEADING_ERROR] = wrapped_angle(point.heading - route.point(c.path, piece, s)[2])
    offset, angle = x[LATERAL_ERROR] - offset, wrapped_angle(x[HEADING_ERROR] + way - angle)
    length = max(p.reach, p.preview * v)
    if p.friction > 0.0:
        length = max(
            length, root(ERROR_LENGTH_FACTOR * v * v * abs(offset) / largest_yaw_acceleration(p, c.vehicle), 3)
        )
    correction = -2.0 * direction * angle / length - atan(offset / (2.0 * length)) * 2.0 / length
    largest = largest_curvature(p, c.vehicle, v)
    x[CURVATURE] = min(max(k + correction, -largest), largest)
    u, correction = direction * v, x[CURVATURE] - k
    correction_rate = -2.0 * v * correction / length - u * angle / (length * length)
    pace = (speed_target - x[SPEED]) / h if h > 0.0 else 0.0
    shift_rate = (
        direction
        * 2.0
        * c.vehicle.centre_shift
        / friction_limit(p, c.vehicle)
        * abs(k)
        * u
        * (u * v * slope + pace * k)
    )
    return MotionTarget(speed_target, u * x[CURVATURE] + shift_rate, u * (v * slope + correction_rate) + pace * k)


@kernel
def limit_speed_change(c: Parts, point: SteeredPoint, speed: float, yaw_acceleration: float, h: float) -> float:
    """Speed, m/s, limited to the change that friction allows beside the ``yaw_acceleration``, rad/s2."""
    if h == 0.0 or c.law.friction == 0.0:
        return speed
    grip = c.law.grip * friction_limit(c.law, c.vehicle)
    yaw_acceleration /= PLANNED_YAW_SHARE * largest_yaw_acceleration(c.law, c.vehicle)
    most = h * planning.available_acceleration(
        grip, turn_resistance(c.vehicle), point.rate, point.ahead * point.rate, yaw_acceleration
    )
    return min(max(speed, c.state[SPEED] - most), c.state[SPEED] + most)


@kernel
def largest_curvature(p: ControlLaw, vehicle: skid.SkidVehicle, speed: float) -> float:
    """Largest curvature at a speed, 1/m; corrections may use half of the friction that the plan leaves."""
    across = min(1.1 * p.acceleration_lateral, 0.5 * (1.0 + p.grip) * friction_limit(p, vehicle))
    return min(p.curvature_largest, across / max(speed * speed, LEAST_SPEED * LEAST_SPEED))


@kernel
def set_demands(c: Parts, point: SteeredPoint, target: MotionTarget, pace: float, h: float) -> None:
    """Set the demanded speeds of both sprockets. (5), (6)"""
    p, x, f = c.law, c.state, c.vehicle
    rate_error = target.rate - point.rate
    if abs(point.ahead) > LEAST_SPEED:
        most = largest_curvature(p, f, point.ahead) * abs(point.ahead)
        x[RATE_INTEGRAL] = min(max(x[RATE_INTEGRAL] + h * p.yaw_integral * rate_error, -most), most)
    share = 1.0 if is_turn_on_the_spot(c.path, int(x[PIECE])) else abs(target.speed) / hypot(target.speed, LEAST_SPEED)
    correction = 0.5 * p.width * (p.yaw_gain * rate_error + x[RATE_INTEGRAL]) * share
    if p.friction == 0.0:
        correction += 0.5 * p.width * target.rate * share
        left, right = -correction, correction
    else:
        largest = LARGEST_YAW_SHARE * largest_yaw_acceleration(p, f)
        yaw_acceleration = min(max(target.yaw_acceleration, -largest), largest)
        rate = target.rate + (p.drive_lag + p.yaw_lag) * yaw_acceleration
        most = LARGEST_FRICTION_SHARE * friction_limit(p, f)
        across = min(max(point.ahead * rate, -most), most)
        most = np.sqrt(most * most - across * across)
        along = min(max(pace - rate * x[SLIPS + 2], -most), most)
        z = x[SLIPS], x[SLIPS + 1], x[SLIPS + 2]
        # always solved: the demands are within the friction (a test)
        z, _ = skid.slips(f, (p.friction, p.creep), rate, along, across, yaw_acceleration, z)
        x[SLIPS], x[SLIPS + 1], x[SLIPS + 2] = z
        left, right = z[0] - f.half_gauge * rate - correction, z[1] + f.half_gauge * rate + correction
    speed = target.speed + p.drive_lag * pace
    x[LEFT], x[RIGHT] = (speed + left) / p.radius, (speed + right) / p.radius


@kernel
def wrapped_angle(angle: float) -> float:
    """Equivalent angle between -pi and pi."""
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))
