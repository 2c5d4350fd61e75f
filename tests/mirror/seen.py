"""What a driver sees, and what follows from it by the geometry of a finely sampled path."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from mirror.record import Floats, Part

FINE = 2e-4  # m
SLOW = 0.1  # m/s: slower ones are not steered


class Seen:
    """The motion of the place that follows the path, in the middle of each step (K), and what follows from it."""

    def __init__(self, part: Part) -> None:
        self.p = part.parameters
        vehicle = part.config["vehicle"]
        self.h, self.t, half = part.h, part.t[:-1], 0.5 * part.h[:, None]
        centre = np.array(vehicle["chassis"]["centre"])
        arm = np.array([np.mean(vehicle["road_wheel"]["x"]) - centre[0], 0.0, 0.0])
        w = part.given("chassis.angular_velocity")
        turned = Rotation.from_quat(part.given("chassis.orientation", "wxyz"), scalar_first=True)
        v = part.given("chassis.velocity") + np.cross(w, turned.apply(arm))
        self.place = (part.given("chassis.position") + turned.apply(arm) + half * v)[:, :2]
        self.rate, ahead = w[:, 2], turned.apply([1.0, 0.0, 0.0])
        self.heading = np.arctan2(ahead[:, 1], ahead[:, 0]) + half[:, 0] * self.rate
        nose = np.stack([np.cos(self.heading), np.sin(self.heading)], axis=1)
        self.forward = (v[:, :2] * nose).sum(1)
        self.sideways = v[:, 1] * nose[:, 0] - v[:, 0] * nose[:, 1]
        self.radius = vehicle["sprocket"]["teeth"] * vehicle["track"]["pitch"] / (2.0 * np.pi)
        self._lay(centre, arm)

    def _lay(self, centre: Floats, arm: Floats) -> None:
        """The path, straight beyond its end."""
        arcs = np.array([arc.split() for arc in self.p["path.arcs"].split(";")], float)
        self.s = np.arange(0.0, arcs[:, 0].sum() + 5.0, FINE)
        ends = np.cumsum(arcs[:, 0])
        self.length, self.bends = ends[-1], arcs[:, 1]
        self.starts, self.ends = ends - arcs[:, 0], ends
        curvature = np.append(arcs[:, 1], 0.0)[np.searchsorted(ends, self.s[:-1] + 0.5 * FINE)]
        self.along = self.p["start.heading"] + np.concatenate([[0.0], np.cumsum(curvature * FINE)])
        middle = 0.5 * (self.along[1:] + self.along[:-1])
        steps = FINE * np.stack([np.cos(middle), np.sin(middle)], axis=1)
        c, s = np.cos(self.p["start.heading"]), np.sin(self.p["start.heading"])
        x, y = centre[0] + arm[0], centre[1]
        first = [self.p["start.position.x"] + c * x - s * y, self.p["start.position.y"] + s * x + c * y]
        self.way = np.vstack([first, np.asarray(first) + np.cumsum(steps, axis=0)])
        self.near = np.array([((self.way - place) ** 2).sum(1).argmin() for place in self.place])

    def progress(self) -> Floats:
        return self.s[self.near]

    def error(self) -> Floats:
        off, along = self.place - self.way[self.near], self.along[self.near]
        return off[:, 1] * np.cos(along) - off[:, 0] * np.sin(along)

    def askew(self) -> Floats:
        return self.heading - self.along[self.near]

    def speed(self) -> Floats:
        s = (self.t + 0.5 * self.h - self.p["ramp.start"]) / (self.p["ramp.end"] - self.p["ramp.start"])
        ramp = self.p["speed.end"] * 0.5 * (1.0 - np.cos(np.pi * np.clip(s, 0.0, 1.0)))
        left = np.maximum(self.starts[None, :] - self.progress()[:, None], 0.0)
        left[self.progress()[:, None] >= self.ends[None, :]] = np.inf  # passed
        curves = self.p["acceleration.lateral"] / np.maximum(np.abs(self.bends), 1e-9)
        ramp = np.minimum(ramp, np.sqrt(curves + 2.0 * self.p["deceleration"] * left).min(axis=1))
        return np.minimum(ramp, np.sqrt(2.0 * self.p["deceleration"] * np.maximum(self.length - self.progress(), 0.0)))

    def curvature(self) -> Floats:
        reach = np.maximum(self.p["reach"], self.p["preview"] * np.abs(self.forward))
        reach = np.maximum(reach, np.minimum(2.0 * np.abs(self.error()), 10.0))
        goal = self.way[np.rint((self.progress() + reach) / FINE).astype(int)] - self.place
        way = self.heading + np.arctan2(self.sideways, np.maximum(np.abs(self.forward), SLOW))
        asked = 2.0 * np.sin(np.arctan2(goal[:, 1], goal[:, 0]) - way) / np.linalg.norm(goal, axis=1)
        most = np.minimum(
            self.p["curvature.largest"], self.p["acceleration.lateral"] / np.maximum(self.forward**2, SLOW**2)
        )
        return np.clip(asked, -most, most)

    def yaw_rate(self) -> Floats:
        return self.curvature() * np.maximum(self.forward, 0.0)

    def sprocket(self, side: float) -> Floats:
        lacks, v = self.yaw_rate() - self.rate, self.speed()
        learnt = np.cumsum(self.p["yaw.integral"] * self.h * lacks * (self.forward > SLOW))
        more = 0.5 * self.p["width"] * (self.yaw_rate() + self.p["yaw.gain"] * lacks + learnt)
        return (v + side * more * v / np.hypot(v, SLOW)) / self.radius
