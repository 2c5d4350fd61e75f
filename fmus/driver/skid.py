"""Slip of the tracks for a wanted motion: the general theory of skid steering on firm ground.

W. Steeds, Tracked vehicles, Automobile Engineer 40 (1950); J. Y. Wong and C. F. Chiang, A general theory for skid
steering of tracked vehicles on firm ground, Proc. IMechE D 215 (2001) 343-355, doi 10.1243/0954407011525683. Tracks
press on the ground under their road wheels, where Coulomb friction opposes the slip velocity:

    w = (u - r y - V, v + r x),  f = -mu N w / sqrt(|w|^2 + creep^2)                                  (4)
    sum f_x = M a_x,  sum f_y = M u r,  sum (x f_y - y f_x) = I r'                                    (5)

The theory gives the motion for given track speeds V. The driver has a wanted motion, and solves the same three
equations for the slip V - (u - r y) of both tracks and the lateral velocity v, by Newton's method. The yaw acceleration
r' in the balance is an addition: with it the vehicle turns without delay. The ground carries the wheels' loads less
what the strands to sprocket and idler lift; loads are those of equal springs, shifted by the accelerations.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from fmus.kernels.jit import kernel, plain
from fmus.physics.arrays import Floats, Vector
from fmus.physics.elementary import asin, atan2, hypot, sin
from fmus.vehicles.sides import lowest_wheel, of_side, road_arms, smooth_wheels, thickness, way_a_turn, wheel_places

ITERATIONS = 20  # of Newton's method
TOLERANCE = 1e-8  # residual over the weight at which the iteration ends
HALVINGS = 8  # of a Newton correction
MAX_REDUCTIONS = 4  # halvings of accelerations that friction cannot give
LARGEST_SLIP = 0.5  # largest slip beside that of the vehicle's turn, m/s

Rows = tuple[Vector, Vector, Vector]  # a matrix (3, 3)


class SkidVehicle(NamedTuple):
    """Mass, geometry and loads of a vehicle, SI; x ahead and y left of its centre of mass."""

    mass: float  # kg
    inertia: float  # about the vertical through the centre of mass, kg m2
    gravity: float  # m/s2
    height: float  # of the centre of mass over the ground, m
    half_gauge: float  # distance of a track's middle from that of the vehicle, m
    edge: float  # distance of the two contact points from the track's middle, a quarter of its width, m
    wheels: Floats  # (n) x of the road wheels, m
    shares: Floats  # (n) shares of the load of a track
    middle: float  # centroid of the shares, m
    variance: float  # of x, weighted by the shares, m2
    arm: float  # mean distance of the loads from the middle, the lever that resists turning on the spot, m
    centre_shift: float  # distance ahead of the point about which it turns, m, over the share of friction used across


def skid_vehicle(vehicle: Mapping[str, Any]) -> tuple[SkidVehicle, float]:
    """Return the vehicle of a table, and x of its centre of mass in the vehicle frame, m."""
    masses, x, y, z, own_inertia = np.array(list(_bodies(vehicle))).T
    mass = masses.sum()
    ahead, up = (masses * x).sum() / mass, (masses * z).sum() / mass
    inertia = own_inertia.sum() + (masses * ((x - ahead) ** 2 + y**2)).sum()
    track, wheel, gravity = vehicle["track"], lowest_wheel(vehicle), float(vehicle["gravity"])
    bear = _bearing(vehicle)
    wheels = np.array([x for x, _ in bear]) - ahead
    shares = _shares(vehicle, bear, wheels, 0.5 * mass * gravity)
    middle = float((shares * wheels).sum())
    edge = 0.25 * track["width"]
    unshifted = SkidVehicle(
        mass=float(mass),
        inertia=float(inertia),
        gravity=gravity,
        height=float(up - wheel["z"] + wheel["radius"] + thickness(track)),
        half_gauge=float(track["lateral"]),
        edge=float(edge),
        wheels=wheels,
        shares=shares,
        middle=middle,
        variance=max(float((shares * (wheels - middle) ** 2).sum()), 1e-6),
        arm=sum(share * hypot(x - middle, edge) for share, x in zip(shares.tolist(), wheels.tolist(), strict=True)),
        centre_shift=0.0,
    )
    (_, _, v), _ = plain(slips)(unshifted, (1.0, 1e-3), 1.0, 0.0, 0.5 * gravity, 0.0, (0.0, 0.0, 0.0))
    return unshifted._replace(centre_shift=-v / 0.5), float(ahead)


def _bodies(v: Mapping[str, Any]) -> Any:
    """Yield mass, position (3) and inertia about its own vertical of each body; a track counts as a rod."""
    yield v["chassis"]["mass"], *v["chassis"]["centre"], v["chassis"]["inertia"][2]
    for side, sign in (("right", -1.0), ("left", 1.0)):
        table = of_side(v, side)
        sprocket, idler, track = (table[name] for name in ("sprocket", "idler", "track"))
        y, loop, low = sign * track["lateral"], track["links"] * track["mass"], lowest_wheel(table)
        yield sprocket["mass"], 0.0, y, 0.0, sprocket["transverse_inertia"]
        wheels, road, arms = smooth_wheels(table), len(table["road_wheel"]["x"]), iter(road_arms(table))
        for wheel in (*wheels[road:], *wheels[:road]):
            yield wheel["mass"], wheel["x"], y, wheel["z"], wheel["transverse_inertia"]
            if wheel["kind"] == "road_wheel" and (arm := next(arms, None)):
                ahead, up = arm["pivot"]
                yield arm["mass"], wheel["x"] + 0.5 * ahead, y, wheel["z"] + 0.5 * up, arm["pin_inertia"]
        yield loop, 0.5 * idler["x"], y, 0.5 * (low["z"] - low["radius"]), loop * idler["x"] * idler["x"] / 12.0


def _bearing(v: Mapping[str, Any]) -> list[tuple[float, Mapping[str, Any]]]:
    """Road wheels that stand on the ground, raised by less than half a link, with the mean of their x on both sides."""
    low, wheels = lowest_wheel(v), zip(wheel_places(v), smooth_wheels(v), strict=False)  # road wheels come first
    most = low["z"] - low["radius"] + v["track"]["face"]
    return [(x, wheel) for x, wheel in wheels if wheel["z"] - wheel["radius"] <= most]


def _shares(v: Mapping[str, Any], bear: list[tuple[float, Mapping[str, Any]]], wheels: Floats, load: float) -> Floats:
    """Shares (n) of a track's ground load under each wheel: equal springs, less what the strands lift."""
    track, idler, places = v["track"], v["idler"], np.array([x for x, _ in bear])
    pins = way_a_turn(v) / (2.0 * np.pi)
    lifts = np.zeros(len(wheels))
    for x, z, radius in ((0.0, 0.0, pins), (idler["x"], idler["z"], idler["radius"] + track["face"])):
        k = int(np.argmin(np.abs(places - x)))
        wheel = bear[k][1]
        dx, dz, under = abs(float(places[k]) - x), z - wheel["z"], wheel["radius"] + track["face"]
        slant = atan2(dz, dx) + asin(float(np.clip((under - radius) / hypot(dx, dz), -1.0, 1.0)))
        lifts[k] += max(track.get("tension") or 0.0, 0.0) * max(sin(slant), 0.0)
    distance = wheels - wheels.mean()
    pressed = (load + lifts.sum()) / len(wheels) + distance * ((lifts * distance).sum() - load * wheels.mean()) / max(
        (distance * distance).sum(), 1e-9
    )
    ground = np.maximum(pressed - lifts, 1e-3 * load)
    return np.asarray(ground / ground.sum())


@kernel
def _loads(p: SkidVehicle, ahead: float, left: float, k: int) -> tuple[float, float]:
    """Load, N, of a contact point under wheel k of the left and of the right track, which have two points each.

    ``ahead``, ``left``: accelerations of the vehicle, m/s2.
    """
    tilt = (-ahead * p.height / p.gravity - p.middle) / p.variance
    share = 0.25 * p.mass * p.shares[k] * max(1.0 + tilt * (p.wheels[k] - p.middle), 0.0)
    shifted = left * p.height / p.half_gauge
    return share * max(p.gravity - shifted, 0.0), share * max(p.gravity + shifted, 0.0)


@kernel
def balance(
    p: SkidVehicle, law: tuple[float, float], rate: float, ahead: float, left: float, yaw_acceleration: float, z: Vector
) -> tuple[Vector, Rows]:
    """Residuals of (5) over the weight, and their Jacobian by rows, at z.

    z: slip left, slip right, lateral velocity, m/s; ``rate``, rad/s; accelerations ``ahead``, ``left``, m/s2, and
    ``yaw_acceleration``, rad/s2; ``law``: friction, creep velocity, m/s.
    """
    mu, creep = law
    fx, fy, m = -p.mass * ahead, -p.mass * left, -p.inertia * yaw_acceleration
    xl, xr, xv, yl, yr, yv, ml, mr, mv = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(p.wheels.size):
        x, loads = p.wheels[k], _loads(p, ahead, left, k)
        for part in range(4):
            right, y = part // 2, (2 * (part % 2) - 1) * p.edge
            a, b = -(z[1] if right else z[0]) - rate * y, z[2] + rate * x
            y += -p.half_gauge if right else p.half_gauge
            n = 1.0 / np.sqrt(a * a + b * b + creep * creep)
            f = mu * (loads[1] if right else loads[0]) * n
            fx, fy, m = fx - f * a, fy - f * b, m - f * (x * b - y * a)
            aa, ab, bb = f * (1.0 - a * a * n * n), -f * a * b * n * n, f * (1.0 - b * b * n * n)
            if right:
                xr, yr, mr = xr + aa, yr + ab, mr + x * ab - y * aa
            else:
                xl, yl, ml = xl + aa, yl + ab, ml + x * ab - y * aa
            xv, yv, mv = xv - ab, yv - bb, mv - x * bb + y * ab
    w = 1.0 / (p.mass * p.gravity)
    return (fx * w, fy * w, m * w), ((xl * w, xr * w, xv * w), (yl * w, yr * w, yv * w), (ml * w, mr * w, mv * w))


@kernel
def _solve_linear(A: Rows, b: Vector) -> Vector:
    """Solution of three linear equations by Cramer's rule; zeros where A is singular."""
    (a, d, g), (e, h, i), (c, f, k) = A
    first, second, third = h * k - i * f, i * c - e * k, e * f - h * c
    det = a * first + d * second + g * third
    if not abs(det) > 1e-30:
        return 0.0, 0.0, 0.0
    x = b[0] * first + b[1] * (g * f - d * k) + b[2] * (d * i - g * h)
    y = b[0] * second + b[1] * (a * k - g * c) + b[2] * (g * e - a * i)
    z = b[0] * third + b[1] * (d * c - a * f) + b[2] * (a * h - d * e)
    return x / det, y / det, z / det


@kernel
def _squared_norm(r: Vector) -> float:
    return r[0] * r[0] + r[1] * r[1] + r[2] * r[2]


@kernel
def slips(
    p: SkidVehicle, law: tuple[float, float], rate: float, ahead: float, left: float, yaw_acceleration: float, z: Vector
) -> tuple[Vector, bool]:
    """Slip left and right and lateral velocity, m/s, from the guess z; and whether (5) is solved.

    Arguments as of ``balance``. Accelerations that friction cannot give are halved, up to ``MAX_REDUCTIONS`` times.
    """
    share = 1.0
    for _ in range(MAX_REDUCTIONS):
        solution, solved = _newton(p, law, rate, share * ahead, left, share * yaw_acceleration, z)
        if not solved:
            cold = -p.arm * rate * 0.6, p.arm * rate * 0.6, -p.arm * rate * 0.6
            solution, solved = _newton(p, law, rate, share * ahead, left, share * yaw_acceleration, cold)
        if solved:
            return solution, True
        share *= 0.5
    return z, False


@kernel
def _newton(
    p: SkidVehicle, law: tuple[float, float], rate: float, ahead: float, left: float, yaw_acceleration: float, z: Vector
) -> tuple[Vector, bool]:
    r, A = balance(p, law, rate, ahead, left, yaw_acceleration, z)
    size, most = _squared_norm(r), LARGEST_SLIP + 3.0 * p.half_gauge * abs(rate)
    for _ in range(ITERATIONS):
        if size < TOLERANCE * TOLERANCE:
            return z, True
        dz, part, before = _solve_linear(A, r), 1.0, size
        for _ in range(HALVINGS):
            trial = z[0] - part * dz[0], z[1] - part * dz[1], z[2] - part * dz[2]
            if max(abs(trial[0]), abs(trial[1]), abs(trial[2])) < most:
                r, A = balance(p, law, rate, ahead, left, yaw_acceleration, trial)
                size = _squared_norm(r)
                if size < before:
                    break
            part *= 0.5
        if not size < before:
            return z, False
        z = trial
    return z, size < TOLERANCE * TOLERANCE
