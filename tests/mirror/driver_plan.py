"""Demands of a driver that knows the friction: plan by least squares, slip by root finding.

The numbers of the vehicle are those of ``skid_vehicle``, which ``fmus/test_driver_plan`` checks. Paths go forward.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from planar_vehicle import RATE, _rates
from scipy.optimize import root
from skid_steering import G

from fmus.driver.skid import skid_vehicle
from mirror.driver_view import PLACE, REST, SLOW, DriverView
from mirror.record import Floats, Part

TURNS = 0.6  # share of the yaw acceleration by friction that the plan may use
FAINT = 0.03  # rad/s


class PlanningDriverView(DriverView):
    """Driver's view as in ``DriverView``, with friction."""

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        self.vehicle, _ = skid_vehicle(part.config["vehicle"])
        self.creep = part.config["vehicle"]["contact"]["ground"]["friction_velocity"]
        self.limit = self.p["friction"] * G
        self.grip = self.p["grip"] * self.limit
        self.yaw_resistance = self.vehicle.arm / self.vehicle.half_gauge
        self.yaw_limit = (
            self.limit * self.vehicle.mass * (self.vehicle.half_gauge - self.vehicle.arm) / self.vehicle.inertia
        )
        self.v = np.maximum(self.forward, 0.0)

    def available_acceleration(self, rate: Floats, across: Floats, turning: Floats) -> Floats:
        """Longitudinal acceleration that friction leaves, m/s2; ``turning``: yaw acceleration, rad/s2."""
        part = np.minimum(1.0 - self.yaw_resistance / (1.0 + (FAINT / np.maximum(abs(rate), 1e-12)) ** 2), 0.8)
        circle = np.sqrt(np.maximum(1.0 - (across / self.grip) ** 2, 0.0))
        return self.grip * part * np.maximum(circle - abs(turning) / (TURNS * self.yaw_limit), 0.3)

    @cached_property
    def plan(self) -> tuple[Floats, ...]:
        """Plan: arc lengths, squares of the speed, curvatures, and distances of the chosen way from the path."""
        count = int(np.ceil(self.length / PLACE))
        s, ds = np.linspace(0.0, self.length, count + 1), self.length / count
        ends = np.clip(s[:, None] + 0.5 * ds * np.array([-1.0, 1.0]), 0.0, self.length)
        drawn = np.diff(np.interp(ends, self.s, self.headings), axis=1)[:, 0] / np.diff(ends, axis=1)[:, 0]
        near = np.pad(abs(drawn), 1, mode="edge")
        bend = np.maximum(np.maximum(near[:-2], near[1:-1]), near[2:])
        top = min(self.p["acceleration.lateral"], self.grip) / np.maximum(bend, 1e-9)
        top = np.minimum(top, max(self.p["speed.start"], self.p["speed.end"]) ** 2)
        D, k = np.diff(np.eye(count + 1), 3, axis=0) / ds**3, drawn
        for _ in range(9):
            square, reached = self._speeds(k, top, ds)
            v2 = 0.5 * (reached[1:-2] + reached[2:-1]) / (TURNS * self.yaw_limit)
            rows = np.vstack([np.eye(count + 1) / self.p["path.tolerance"], v2[:, None] * D])
            targets = np.concatenate([np.zeros(count + 1), -v2 * np.diff(drawn)[1:-1] / ds])
            offsets = np.linalg.lstsq(rows, targets)[0]
            bends = np.diff(offsets, 2) / ds**2
            k = drawn + np.pad(bends, 1, mode="edge")
            demand = reached[1:-1] * abs(k[2:] - k[:-2]) / (2.0 * ds) / (TURNS * self.yaw_limit)
            if not (demand > 1.01).any():
                break
            top[1:-1] = np.where(demand > 1.01, reached[1:-1] / demand, top[1:-1])
        return s, square, k, offsets

    def _speeds(self, k: Floats, top: Floats, ds: float) -> tuple[Floats, Floats]:
        """Squares of the speed: the limit by braking to the end, and the value reached from rest."""
        slope = (np.append(k[1:], k[-1]) - np.concatenate([k[:1], k[:-1]])) / (2.0 * ds)

        def room(v2: float, i: int) -> float:
            return float(self.available_acceleration(np.sqrt(v2) * k[i], v2 * k[i], v2 * slope[i]))

        square, reached = top.copy(), top.copy()
        square[-1] = reached[0] = 0.0
        for i in range(len(k) - 2, -1, -1):
            deceleration = min(self.p["deceleration"], room(square[i + 1], i + 1))
            square[i] = min(top[i], square[i + 1] + 2.0 * deceleration * ds)
        for i in range(1, len(k)):
            reached[i] = min(square[i], reached[i - 1] + 2.0 * room(reached[i - 1], i) * ds)
        return square, reached

    def _at_progress(self, values: Floats) -> Floats:
        return np.interp(self.progress(), self.plan[0], values)

    def path_curvature(self) -> Floats:
        return self._at_progress(self.plan[2])

    @cached_property
    def slope(self) -> Floats:
        s, _, k, _ = self.plan
        index = np.clip((self.progress() / (s[1] - s[0])).astype(int), 0, len(s) - 2)
        return np.diff(k)[index] / (s[1] - s[0])

    @cached_property
    def demanded_speed(self) -> Floats:
        """Demanded speed; it changes as fast as friction allows, m/s."""
        ends = np.maximum(self.length - self.progress(), 0.0) / REST
        demands = np.minimum(self.ramp(), np.minimum(np.sqrt(np.maximum(self._at_progress(self.plan[1]), 0.0)), ends))
        room = self.h * self.available_acceleration(self.rate, self.forward * self.rate, self.v**2 * self.slope)
        speed, speeds = 0.0, []
        for demand, change in zip(demands, room, strict=True):
            speed = min(max(demand, speed - change), speed + change)
            speeds.append(speed)
        return np.array(speeds)

    def speed(self) -> Floats:
        return self.demanded_speed

    def pace(self) -> Floats:
        return np.diff(self.demanded_speed, prepend=0.0) / self.h

    @cached_property
    def errors(self) -> tuple[Floats, Floats, Floats]:
        """Distance over which errors decay; distance and direction from the chosen way."""
        s, _, _, off = self.plan
        off_now = self.lateral_error() - self._at_progress(off)
        way = self.heading_error() + np.arctan2(self.lateral_speed, np.maximum(self.v, SLOW))
        way = way - self._at_progress(np.gradient(off, s))
        reach = np.maximum(self.p["reach"], self.p["preview"] * self.v)
        return np.maximum(reach, np.cbrt(4.0 * self.v**2 * abs(off_now) / self.yaw_limit)), off_now, way

    def bound(self) -> Floats:
        across = min(1.1 * self.p["acceleration.lateral"], 0.5 * (1.0 + self.p["grip"]) * self.limit)
        return np.minimum(self.p["curvature.largest"], across / np.maximum(self.forward, SLOW) ** 2)

    def curvature(self) -> Floats:
        far, off, way = self.errors
        asked = self.path_curvature() - 2.0 / far * (way + np.arctan(0.5 * off / far))
        return np.clip(asked, -self.bound(), self.bound())

    @cached_property
    def pole_distance(self) -> float:
        """Distance of the pole of turning ahead of the centre of mass, at half of the lateral friction."""
        z = self._slip(0.0, 1.0, (0.0, 0.5 * G, 0.0), np.array([-0.4, 0.4, -0.4]), 1.0, 1e-3)
        return -z[2] / 0.5

    def yaw_rate(self) -> Floats:
        k = self.path_curvature()
        grows = self.v * self.v * self.slope + self.pace() * k
        return self.v * self.curvature() + 2.0 * self.pole_distance / self.limit * abs(k) * self.v * grows

    def _slip(self, speed: float, rate: float, moves: tuple[float, ...], z: Floats, mu: float, creep: float) -> Floats:
        """Slips and drift, m/s, that give the accelerations forward, to the left and about the vertical."""
        f = self.vehicle

        def lacks(z: Floats, creep: float) -> Floats:
            numbers = (f.mass, f.inertia, f.height, f.half_gauge, 4.0 * f.edge, 1.0, mu, creep, 1.0)
            out, x = np.zeros(8), np.array([0.0, 0.0, 0.0, speed, z[2], rate, 0.0, 0.0])
            x[6:] = speed - rate * f.half_gauge + z[0], speed + rate * f.half_gauge + z[1]
            solution = _rates(x, np.array(moves[:2]), np.zeros(2), f.wheels, f.shares, numbers, out)
            return np.array([solution[0], solution[1], out[RATE]]) - moves

        solution = root(lacks, z, (creep,), tol=1e-11).x
        if not abs(lacks(solution, creep)).max() < 1e-7:  # continuation: friction becomes sharper step by step
            solution = rate * np.array([-0.4, 0.4, -0.4])
            for blunt in creep * np.geomspace(300.0, 1.0, 15):
                solution = root(lacks, solution, (blunt,), tol=1e-11).x
        assert abs(lacks(solution, creep)).max() < 1e-7
        return np.asarray(solution)

    @cached_property
    def sprockets(self) -> Floats:
        """Demanded speeds of the sprockets, rad/s, shape (K, 2)."""
        f, far, way = self.vehicle, self.errors[0], self.errors[2]
        k, u, pace, demanded_rate, lag = (
            self.path_curvature(),
            self.v,
            self.pace(),
            self.yaw_rate(),
            self.p["drive.lag"],
        )
        fades = -2.0 * u * (self.curvature() - k) / far - u * way / far**2
        bend = np.clip(u * (u * self.slope + fades) + pace * k, -1.5 * self.yaw_limit, 1.5 * self.yaw_limit)
        rate, lacks = demanded_rate + (lag + self.p["yaw.lag"]) * bend, demanded_rate - self.rate
        learnt, z, speeds = 0.0, np.zeros(3), []
        for i, r in enumerate(rate):
            if abs(self.forward[i]) > SLOW:
                most = self.bound()[i] * abs(self.forward[i])
                learnt = float(np.clip(learnt + self.h[i] * self.p["yaw.integral"] * lacks[i], -most, most))
            moves = self.demanded_speed[i] / np.hypot(self.demanded_speed[i], SLOW)
            more = 0.5 * self.p["width"] * (self.p["yaw.gain"] * lacks[i] + learnt) * moves
            across = self.forward[i] * r
            z = self._slip(0.0, r, (pace[i] - r * z[2], across, bend[i]), z, self.p["friction"], self.creep)
            speed = self.demanded_speed[i] + lag * pace[i]
            speeds.append([speed + z[0] - f.half_gauge * r - more, speed + z[1] + f.half_gauge * r + more])
        return np.array(speeds) / self.radius

    def sprocket(self, side: float) -> Floats:
        return self.sprockets[:, int(side > 0.0)]
