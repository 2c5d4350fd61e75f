"""Inputs of a driver, and their consequences by the geometry of a finely sampled path."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from mirror.record import Floats, Part

FINE = 2e-4  # m, between samples of the path
SLOW = 0.1  # m/s: at lower speeds the driver does not steer
REST = 0.25  # s, time constant of the remaining distance
PLACE = 0.1  # m, between points of a plan


class DriverView:
    """Motion of the point that follows the path, in the middle of each step (K), and derived quantities."""

    def __init__(self, part: Part) -> None:
        self.p = part.parameters
        vehicle = part.config["vehicle"]
        self.h, self.t, half = part.h, part.t[:-1], 0.5 * part.h[:, None]
        centre = np.array(vehicle["chassis"]["centre"])
        arm = np.array([np.mean(vehicle["road_wheel"]["x"]) - centre[0], 0.0, 0.0])
        w = part.input_vectors("chassis.angular_velocity")
        turned = Rotation.from_quat(part.input_vectors("chassis.orientation", "wxyz"), scalar_first=True)
        v = part.input_vectors("chassis.velocity") + np.cross(w, turned.apply(arm))
        self.place = (part.input_vectors("chassis.position") + turned.apply(arm) + half * v)[:, :2]
        self.rate, ahead = w[:, 2], turned.apply([1.0, 0.0, 0.0])
        self.heading = np.arctan2(ahead[:, 1], ahead[:, 0]) + half[:, 0] * self.rate
        nose = np.stack([np.cos(self.heading), np.sin(self.heading)], axis=1)
        self.forward = (v[:, :2] * nose).sum(1)
        self.lateral_speed = v[:, 1] * nose[:, 0] - v[:, 0] * nose[:, 1]
        pins = vehicle["sprocket"]["teeth"] / vehicle["sprocket"].get("gaps_per_pin", 1)
        pins *= vehicle["sprocket"].get("pins_per_gap", 1)
        self.radius = pins * vehicle["track"]["pitch"] / (2.0 * np.pi)
        self._sample_path(centre, arm)

    def _sample_path(self, centre: Floats, arm: Floats) -> None:
        """Sample the path, straight beyond its end, and project the point onto it."""
        arcs = np.array([arc.split() for arc in self.p["path.arcs"].split(";")], float)
        self.s = np.arange(0.0, arcs[:, 0].sum() + 5.0, FINE)
        ends = np.cumsum(arcs[:, 0])
        self.length, self.bends = ends[-1], arcs[:, 1]
        self.starts, self.ends = ends - arcs[:, 0], ends
        curvature = np.append(arcs[:, 1], 0.0)[np.searchsorted(ends, self.s[:-1] + 0.5 * FINE)]
        self.headings = self.p["start.heading"] + np.concatenate([[0.0], np.cumsum(curvature * FINE)])
        middle = 0.5 * (self.headings[1:] + self.headings[:-1])
        steps = FINE * np.stack([np.cos(middle), np.sin(middle)], axis=1)
        c, s = np.cos(self.p["start.heading"]), np.sin(self.p["start.heading"])
        x, y = centre[0] + arm[0], centre[1]
        first = [self.p["start.position.x"] + c * x - s * y, self.p["start.position.y"] + s * x + c * y]
        self.points = np.vstack([first, np.asarray(first) + np.cumsum(steps, axis=0)])
        near = np.array([((self.points - place) ** 2).sum(1).argmin() for place in self.place])
        off, along = self.place - self.points[near], self.headings[near]
        ahead = off[:, 0] * np.cos(along) + off[:, 1] * np.sin(along)
        self._lateral_error = off[:, 1] * np.cos(along) - off[:, 0] * np.sin(along)
        bend = curvature[np.minimum(near, len(curvature) - 1)]
        self._progress = np.maximum(self.s[near] + ahead / (1.0 - bend * self._lateral_error), 0.0)

    def progress(self) -> Floats:
        return self._progress

    def lateral_error(self) -> Floats:
        """Distance from the path; behind its beginning, distance from the tangent there."""
        return self._lateral_error

    def heading_error(self) -> Floats:
        return self.heading - np.interp(self._progress, self.s, self.headings)

    def ramp(self) -> Floats:
        s = (self.t + 0.5 * self.h - self.p["ramp.start"]) / (self.p["ramp.end"] - self.p["ramp.start"])
        return self.p["speed.end"] * 0.5 * (1.0 - np.cos(np.pi * np.clip(s, 0.0, 1.0)))

    def speed(self) -> Floats:
        left = np.maximum(self.length - self.progress(), 0.0)
        return np.minimum(self.ramp(), np.minimum(np.sqrt(2.0 * self.p["deceleration"] * left), left / REST))

    def path_curvature(self) -> Floats:
        """Curvature of the path at points 10 cm apart, each a mean over as much, linear between them."""
        count = int(np.ceil(self.length / PLACE))
        places = np.linspace(0.0, self.length, count + 1)
        ends = np.clip(places[:, None] + 0.5 * self.length / count * np.array([-1.0, 1.0]), 0.0, self.length)
        turned = np.diff(np.interp(ends, self.s, self.headings), axis=1)[:, 0]
        return np.interp(self.progress(), places, turned / np.diff(ends, axis=1)[:, 0])

    def curvature(self) -> Floats:
        v = np.maximum(self.forward, 0.0)
        reach = np.maximum(self.p["reach"], self.p["preview"] * v)
        way = self.heading_error() + np.arctan2(self.lateral_speed, np.maximum(v, SLOW))
        asked = self.path_curvature() - 2.0 / reach * (way + np.arctan(0.5 * self.lateral_error() / reach))
        most = np.minimum(self.p["curvature.largest"], 1.1 * self.p["acceleration.lateral"] / np.maximum(v, SLOW) ** 2)
        return np.clip(asked, -most, most)

    def yaw_rate(self) -> Floats:
        return self.curvature() * np.maximum(self.forward, 0.0)

    def sprocket(self, side: float) -> Floats:
        lacks, v = self.yaw_rate() - self.rate, self.speed()
        learnt = np.cumsum(self.p["yaw.integral"] * self.h * lacks * (np.abs(self.forward) > SLOW))
        more = 0.5 * self.p["width"] * (self.yaw_rate() + self.p["yaw.gain"] * lacks + learnt)
        pace = np.diff(v, prepend=0.0) / self.h
        return (v + self.p["drive.lag"] * pace + side * more * v / np.hypot(v, SLOW)) / self.radius
