"""The general theory of skid steering on firm ground, in steady motion: an independent code.

Steeds, Tracked vehicles, Automobile Engineer, 1950; Wong and Chiang, A general theory for skid steering of tracked
vehicles on firm ground, Proc. IMechE D 215, 2001. Tracks press on the ground under their road wheels, where friction
opposes the slip velocity. x forward, y left, from the centre of mass; turns to the left are positive.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import root

G = 9.81


class Vehicle(NamedTuple):
    """The M113 by the vehicle's table, SI units."""

    mass: float = 15891.58  # of the whole vehicle
    height: float = 0.578  # of the centre of mass above the ground
    half_width: float = 1.0795  # from the vehicle's middle to that of a track
    width: float = 0.378  # of a track
    wheels: tuple[float, ...] = (1.3374, 0.6704, 0.0034, -0.6636, -1.3296)  # forward of the centre of mass
    # of a track's load: wheel loads less the lift of the first and the last wheel by the inclined end strands
    shares: tuple[float, ...] = (0.158, 0.238, 0.221, 0.217, 0.166)
    radius: float = 10.0 * 0.1524 / (2.0 * np.pi)  # track speed over sprocket speed
    friction: float = 0.3
    creep: float = 0.01  # m/s: friction velocity


class Turn(NamedTuple):
    """Steady motion; arrays are (left, right)."""

    rate: float
    ahead: float  # velocity of the centre of mass
    left: float
    slip: np.ndarray  # speed of a track relative to the ground along it
    force: np.ndarray  # force of the ground along the vehicle
    transfer: float  # load moved from the inner to the outer track

    @property
    def radius(self):
        return np.hypot(self.ahead, self.left) / abs(self.rate)

    def moment(self, vehicle):
        return vehicle.half_width * (self.force[1] - self.force[0])


def turn(vehicle, sprockets):
    """Steady motion with the sprockets at (left, right) rad/s, by continuation in the friction."""
    speeds = vehicle.radius * np.array(sprockets)

    def balance(z, creep):
        forces, moment, _ = ground_forces(vehicle._replace(creep=creep), speeds, z)
        u, v, r = z
        fx, fy = forces.sum(axis=0)
        weight = vehicle.mass * G
        return (fx + vehicle.mass * r * v) / weight, (fy - vehicle.mass * r * u) / weight, moment / weight

    z = (speeds.mean(), 0.0, (speeds[1] - speeds[0]) / (2.0 * vehicle.half_width))  # without slip
    for creep in vehicle.creep * np.geomspace(1000.0, 1.0, 25):
        z = root(balance, z, (creep,), tol=1e-12).x
    assert np.abs(balance(z, vehicle.creep)).max() < 1e-9
    u, v, r = z
    forces, _, transfer = ground_forces(vehicle, speeds, z)
    places = np.array([1.0, -1.0]) * vehicle.half_width
    return Turn(r, u, v, speeds - (u - r * places), forces[:, 0], transfer)


def ground_forces(vehicle, speeds, z):
    """Forces of the ground (2, 2) on the tracks, their moment about the vertical, load on the outer track."""
    u, v, r = z
    x, shares = np.array(vehicle.wheels), np.array(vehicle.shares)
    transfer = vehicle.mass * r * u * vehicle.height / (2.0 * vehicle.half_width)
    centre_of_load = r * v * vehicle.height / G  # required centre of the loads
    middle = shares @ x
    tilt = (centre_of_load - middle) / (shares @ (x - middle) ** 2)
    along = shares * (1.0 + tilt * (x - middle))
    forces, moment = np.zeros((2, 2)), 0.0
    for side, sign in enumerate((1.0, -1.0)):
        load = 0.5 * vehicle.mass * G - sign * transfer  # in a left turn the right track is the outer one
        for y in (sign * vehicle.half_width + part * 0.25 * vehicle.width for part in (-1.0, 1.0)):
            w = np.stack([u - r * y - speeds[side] + 0.0 * x, v + r * x])
            f = -vehicle.friction * 0.5 * load * along * w / np.sqrt((w**2).sum(axis=0) + vehicle.creep**2)
            forces[side] += f.sum(axis=1)
            moment += (x * f[1] - y * f[0]).sum()
    return forces, moment, transfer
