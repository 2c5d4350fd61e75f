"""A tracked vehicle in the plane, by the general theory of skid steering: a plant for drivers.

The forces are those of ``skid_steering`` in any motion, steady or not: Coulomb friction under the road wheels, with the
loads shifted by the accelerations along and across the hull. Sprockets follow their demands with a first-order lag.
Classical Runge-Kutta; the frame is x forward, y left, from the centre of mass.
"""

import numba
import numpy as np
from named_ports import output_names
from skid_steering import G, Vehicle

X, Y, HEADING, AHEAD, LEFT, RATE, SPEEDS = 0, 1, 2, 3, 4, 5, slice(6, 8)  # indices; speeds of both sprockets
MAX_STEP = 1e-3  # s: longest internal step


class Planar:
    """The vehicle; its inputs are the demanded speeds of its sprockets (left, right), rad/s."""

    def __init__(self, vehicle=None, inertia=38.5e3, lag=0.1, place=(0.0, 0.0, 0.0), speed=0.0):
        v = vehicle or Vehicle()
        self.vehicle, self.inertia, self.lag = v, inertia, lag
        self.x = np.array([*place, speed, 0.0, 0.0, speed / v.radius, speed / v.radius])
        self.specific_force = np.zeros(2)  # acceleration forward and left in the last step, m/s2
        self._arrays = np.array(v.wheels), np.array(v.shares)

    def step(self, h, demand):
        """Advance by ``h``, s, with demanded sprocket speeds (2,), rad/s."""
        v, n = self.vehicle, int(np.ceil(h / MAX_STEP - 1e-9))
        numbers = (v.mass, self.inertia, v.height, v.half_width, v.width, v.radius, v.friction, v.creep, self.lag)
        _march(self.x, self.specific_force, n, h / n, np.asarray(demand, float), *self._arrays, numbers)


@numba.njit
def _rates(x, specific_force, demand, wheels, shares, p, out):
    """Write the derivatives of the state to ``out``; return the specific forces forward and left, m/s2."""
    mass, inertia, height, half, width, radius, friction, creep, lag = p
    u, v, r = x[3], x[4], x[5]
    middle = (shares * wheels).sum()
    tilt = (-specific_force[0] * height / G - middle) / (shares * (wheels - middle) ** 2).sum()
    fx, fy, moment = 0.0, 0.0, 0.0
    for side in range(2):
        sign = 1.0 - 2.0 * side
        load = 0.5 * mass * G - sign * mass * specific_force[1] * height / (2.0 * half)
        for k in range(wheels.size):
            normal = 0.5 * load * shares[k] * (1.0 + tilt * (wheels[k] - middle))
            for part in (-0.25, 0.25):
                y = sign * half + part * width
                a, b = u - r * y - radius * x[6 + side], v + r * wheels[k]
                f = -friction * max(normal, 0.0) / np.sqrt(a * a + b * b + creep * creep)
                fx, fy, moment = fx + f * a, fy + f * b, moment + f * (wheels[k] * b - y * a)
    out[0], out[1] = u * np.cos(x[2]) - v * np.sin(x[2]), u * np.sin(x[2]) + v * np.cos(x[2])
    out[2], out[3], out[4], out[5] = r, fx / mass + r * v, fy / mass - r * u, moment / inertia
    out[6], out[7] = (demand[0] - x[6]) / lag, (demand[1] - x[7]) / lag
    return fx / mass, fy / mass


@numba.njit
def _march(x, specific_force, n, h, demand, wheels, shares, p):
    k = np.zeros((5, 8))
    for _ in range(n):
        for i, part in enumerate((0.0, 0.5, 0.5, 1.0)):
            force = _rates(x + part * h * k[i], specific_force, demand, wheels, shares, p, k[i + 1])
            if i == 0:
                force_at_start = force
        x += h / 6.0 * (k[1] + 2.0 * k[2] + 2.0 * k[3] + k[4])
        specific_force[0], specific_force[1] = force_at_start


class Ride:
    """Ride of a driver's model on the planar vehicle: outputs by name, motion (n, 8) at each step."""

    def __init__(self, model, plant, hull, stop, h=2e-3):
        """Run for ``stop`` s; ``hull``: distance of the hull's centre of mass ahead of the vehicle's, m."""
        self.names = output_names(model)
        outputs, motions, y = [], [], np.zeros(len(self.names))
        for k in range(round(stop / h)):
            model.outputs(y)
            plant.step(h, y[:2])
            model.step(k * h, h, motion(plant.x, hull))
            outputs.append(y.copy())
            motions.append(plant.x.copy())
        self.outputs, self.motions = np.array(outputs), np.array(motions)

    def __getitem__(self, name):
        return self.outputs[:, self.names.index(name)]


def motion(x, hull):
    """The 13 inputs of a driver."""
    c, s, half = np.cos(x[HEADING]), np.sin(x[HEADING]), 0.5 * x[HEADING]
    u, v = x[AHEAD], x[LEFT] + hull * x[RATE]
    place = x[X] + hull * c, x[Y] + hull * s, 0.4
    return np.array([*place, np.cos(half), 0, 0, np.sin(half), c * u - s * v, s * u + c * v, 0, 0, 0, x[RATE]])
