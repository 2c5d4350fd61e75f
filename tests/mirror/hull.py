"""The chassis and its suspended bodies, from the vehicle table and `fmus/chassis/README.md`.

Plain numpy, world axes. Places follow from the state by geometry alone; velocities are differences of places a moment
before and after. Momentum and energies are sums over bodies: chassis, sprockets, arms, wheels, idlers.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from mirror.ground import Ground
from mirror.motion import rotation_of, start_frame
from mirror.record import Floats, Part
from mirror.touch import Law, Push, press

Y = np.array([0.0, 1.0, 0.0])
MOMENT = 1e-5  # s, for differences


def number(value: float | list[float], i: int) -> float:
    """Number of wheel ``i``, from 0 at the front, of a table in which it is that of all or a list."""
    return value[i] if isinstance(value, list | tuple) else value


class PlaceMotion(NamedTuple):
    """The 13 quantities of a place at T instants."""

    position: Floats
    attitude: Rotation
    velocity: Floats
    spin: Floats


class Body(NamedTuple):
    """A body of the vehicle at T instants, world frame."""

    mass: float
    place: Floats
    velocity: Floats
    spin: Floats  # angular momentum about its centre
    energy: Floats  # of rotation


class Hull:
    """The record of a chassis; leaves are road arms from the front, then the idler, left side first."""

    def __init__(self, part: Part) -> None:
        self.part, self.vehicle, self.sides = part, part.config["vehicle"], list(part.config["chassis"]["sides"])
        self.copies = 2 // len(self.sides)
        v, x, T = self.vehicle, part.state, len(part.state)
        self.arms = len(v["road_wheel"]["x"])
        n = 2 * (self.arms + 1)
        self.place, self.attitude = x[:, :3], rotation_of(x[:, 3:7])
        self.velocity, self.turning = x[:, 7:10], x[:, 10:13]
        self.q, self.angle, self.rate, self.spin = x[:, 13 : 13 + 4 * n].reshape(T, 4, n).transpose(1, 0, 2)
        centre = np.array(v["chassis"]["centre"])
        sign = [1.0, -1.0]  # sign of y, left and right
        pivot, beams = v["road_arm"]["pivot"], v["road_arm"]["beams"] or ()
        self.pivots = [np.array(pivot[k] if isinstance(pivot[0], list) else pivot) for k in range(self.arms)]
        self.beams = [[k - 1 + side * (self.arms + 1) for k in beam] for side in range(2) for beam in beams]
        angle = v["tensioner"]["angle"]
        self.slide = np.array([np.cos(angle), 0.0, np.sin(angle)])
        self.drawn, self.pins = [], []
        for s in sign:
            road, y = v["road_wheel"], s * v["track"]["lateral"]
            wheels = [[x, y, number(road["z"], i)] for i, x in enumerate(road["x"])]
            wheels.append([v["idler"]["x"], s * v["track"]["lateral"], v["idler"]["z"]])
            for k, wheel in enumerate(wheels):
                self.drawn.append(np.array(wheel) - centre)
                arm = [self.pivots[k][0], 0.0, self.pivots[k][1]] if k < self.arms else [0.0, 0.0, 0.0]
                self.pins.append(self.drawn[-1] + arm)
        self.mounts = [np.array([0.0, s * v["track"]["lateral"], 0.0]) - centre for s in sign]
        self.points = {f"seat.{name}": np.array(v["seat"][name]["position"]) - centre for name in v["seat"]}
        self.points |= {"hitch": np.array([v["hitch"]["x"], 0.0, v["hitch"]["z"]]) - centre} if v["hitch"] else {}
        self.start = start_frame(part.parameters)
        self.names = [
            f"{side}.{name}"
            for side in ("left", "right")
            for name in [*(f"road_wheel[{i + 1}]" for i in range(self.arms)), "idler"]
        ]

    # --- places from the state ---------------------------------------------------------------------------

    def pose(self, tau: float) -> tuple[Floats, Rotation]:
        """Pose of the chassis, ``tau`` s after each instant."""
        return self.place + tau * self.velocity, self.attitude * Rotation.from_rotvec(tau * self.turning)

    def _of_leaf(self, k: int, tau: float) -> tuple[Floats, Rotation]:
        origin, attitude = self.pose(tau)
        q = self.q[:, k] + tau * self.rate[:, k]
        if self.is_road(k):
            x, z = self.pivot(k)
            arm = Rotation.from_rotvec(q[:, None] * Y).apply([-x, 0.0, -z])
            local = self.pins[k] + arm
        else:
            local = self.drawn[k] + q[:, None] * self.slide
        spun = self.angle[:, k] + tau * (self.spin[:, k] - self.turning[:, 1])
        return origin + attitude.apply(local), attitude * Rotation.from_rotvec(spun[:, None] * Y)

    def motion_of(self, name: str) -> PlaceMotion:
        """Motion of a place, by its name in the ports."""

        def pose_at(tau: float) -> tuple[Floats, Rotation]:
            if name == "chassis":
                return self.pose(tau)
            side, _, place = name.partition(".")
            if name in self.points:
                origin, attitude = self.pose(tau)
                return origin + attitude.apply(self.points[name]), attitude
            if place == "sprocket":
                origin, attitude = self.pose(tau)
                return origin + attitude.apply(self.mounts[("left", "right").index(side)]), attitude
            return self._of_leaf(self.names.index(name), tau)

        (x, q), (before, p), (after, r) = pose_at(0.0), pose_at(-MOMENT), pose_at(MOMENT)
        return PlaceMotion(x, q, (after - before) / (2 * MOMENT), (r * p.inv()).as_rotvec() / (2 * MOMENT))

    # --- bodies from the outputs -------------------------------------------------------------------------

    @property
    def output_attitude(self) -> Rotation:
        """Attitude of the chassis from its outputs."""
        return rotation_of(self.part.vector("chassis.orientation", "wxyz"))

    def output_motion(self, name: str) -> tuple[Floats, Floats, Floats]:
        """Position, velocity and angular velocity of a place from its outputs."""
        return tuple(self.part.vector(f"{name}.{what}") for what in ("position", "velocity", "angular_velocity"))

    @property
    def shown_leaves(self) -> list[int]:
        """Indices of the leaves that have outputs."""
        return [k for k, name in enumerate(self.names) if name.split(".")[0] in self.sides]

    def bodies(self, without_rates: bool = False) -> list[Body]:
        """All bodies with outputs, the chassis first; arms can be found without the chassis' rate outputs."""
        v, bodies, R = self.vehicle, [], self.output_attitude
        x, u, w = self.output_motion("chassis")
        J = np.array(v["chassis"]["inertia"]) / self.copies
        bodies.append(self.body(v["chassis"]["mass"] / self.copies, J, x, u, w))
        if without_rates:
            h = self.part.h[:, None]
            steps = np.diff(x, axis=0) / h, (R[1:] * R[:-1].inv()).as_rotvec() / h
            u, w = (np.concatenate([0.0 * a[:1], 0.5 * (a[1:] + a[:-1]), a[-1:]]) for a in steps)
        for side in self.sides:
            J = v["sprocket"]["transverse_inertia"]
            bodies.append(self.body(v["sprocket"]["mass"], [J, 0.0, J], *self.output_motion(f"{side}.sprocket")))
        for k in self.shown_leaves:
            table = self.wheel(k)
            J = table["transverse_inertia"]
            xw, uw, ww = self.output_motion(self.names[k])
            bodies.append(self.body(table["mass"], [J, table["spin_inertia"], J], xw, uw, ww))
            if self.is_road(k):
                arm, e = self.arm(k), self.arm_direction(k)
                rate = self.arm_rate(k, u, w)
                pin = x + R.apply(self.pins[k])
                middle, speed = 0.5 * (pin + xw), 0.5 * (u + np.cross(w, pin - x) + uw)
                spin = w + rate[:, None] * R.apply(Y)
                part = (spin * e).sum(1, keepdims=True) * e
                L = arm["pin_inertia"] * (spin - part) + arm["long_inertia"] * part
                bodies.append(Body(arm["mass"], middle, speed, L, 0.5 * (L * spin).sum(1)))
        return bodies

    def body(self, mass: float, inertia, x: Floats, u: Floats, w: Floats) -> Body:
        """Body with principal inertias along the chassis' axes."""
        body_rates = self.output_attitude.inv().apply(w)
        L = np.asarray(inertia) * body_rates
        return Body(mass, x, u, self.output_attitude.apply(L), 0.5 * (L * body_rates).sum(1))

    def wheel(self, k: int) -> dict[str, float]:
        """Numbers of the wheel of a leaf."""
        table = self.vehicle["road_wheel" if self.is_road(k) else "idler"]
        return {key: number(value, k % (self.arms + 1)) for key, value in table.items()}

    def arm(self, k: int) -> dict[str, float]:
        """Numbers of the road arm of a leaf."""
        table = self.vehicle["road_arm"]
        return {key: number(table[key], k % (self.arms + 1)) for key in ("mass", "pin_inertia", "long_inertia")}

    def pivot(self, k: int) -> Floats:
        """(x, z) of the pivot of a leaf from its wheel centre, m."""
        return self.pivots[k % (self.arms + 1)]

    def beam(self, k: int) -> list[int]:
        """Leaves that are one piece with a leaf, itself among them."""
        return next((beam for beam in self.beams if k in beam), [k])

    def is_road(self, k: int) -> bool:
        """Whether a leaf is a road arm with its wheel; else it is an idler."""
        return k % (self.arms + 1) < self.arms

    def arm_direction(self, k: int) -> Floats:
        """Unit vector of a road arm from its pin to its wheel, world frame, from outputs."""
        x, _, _ = self.output_motion("chassis")
        arm = self.output_motion(self.names[k])[0] - x - self.output_attitude.apply(self.pins[k])
        return arm / np.linalg.norm(arm, axis=1, keepdims=True)

    def arm_rate(self, k: int, u: Floats | None = None, w: Floats | None = None) -> Floats:
        """Rate of an arm relative to the chassis, rad/s, from velocity outputs.

        ``u`` and ``w`` replace the velocity and angular velocity of the chassis.
        """
        x, *rates = self.output_motion("chassis")
        u, w = rates if u is None else (u, w)
        xw, uw, _ = self.output_motion(self.names[k])
        arm = xw - x - self.output_attitude.apply(self.pins[k])
        against = uw - u - np.cross(w, xw - x)
        return (against * np.cross(self.output_attitude.apply(Y), arm)).sum(1) / (arm**2).sum(1)

    def arm_angle(self, k: int) -> Floats:
        """Angle of an arm from its drawn position, up positive, from position outputs, rad."""
        x, _, _ = self.output_motion("chassis")
        local = self.output_attitude.inv().apply(self.output_motion(self.names[k])[0] - x) - self.pins[k]
        x, z = self.pivot(k)
        return np.arctan2(z, x) - np.arctan2(-local[:, 2], -local[:, 0])

    def idler_travel(self, k: int) -> tuple[Floats, Floats]:
        """Way of an idler forward on its slide (m) and its rate (m/s), from outputs."""
        x, u, w = self.output_motion("chassis")
        xw, uw, _ = self.output_motion(self.names[k])
        back = self.output_attitude.inv()
        way, rate = back.apply(xw - x) - self.drawn[k], back.apply(uw - u - np.cross(w, xw - x))
        return way @ self.slide, rate @ self.slide

    def spring(self, k: int, angle: Floats) -> tuple[Floats, Floats]:
        """Length of the suspension spring of a leaf at its angle, m, and its moment arm -d(length)/d(angle), m."""
        table, pivot = self.vehicle["suspension"], self.pivot(k)
        a, b = np.array(table["on_arm"]) - pivot, np.array(table["on_chassis"]) - pivot
        c, s = np.cos(angle), np.sin(angle)
        end = np.stack([c * a[0] + s * a[1], c * a[1] - s * a[0]], axis=-1)  # rotation about +y: x to -z
        gap = end - b
        length = np.hypot(*gap.T)
        turning = np.stack([end[:, 1], -end[:, 0]], axis=-1)
        return length, -(gap * turning).sum(1) / length

    # --- loads -------------------------------------------------------------------------------------------

    @cached_property
    def wrenches(self) -> list[tuple[str, Floats, Floats]]:
        """Wrenches of all steps by place: force and torque (K, 3)."""
        places = [name.removesuffix(".torque.x") for name in self.part.inputs if name.endswith(".torque.x")]
        return [
            (name, self.part.input_vectors(f"{name}.force"), self.part.input_vectors(f"{name}.torque"))
            for name in places
        ]


def ground_contacts(hull: Hull) -> tuple[Floats, Push, Floats]:
    """Instants (p,), forces (p,) and depths, m, of hull points and bare wheels on the ground."""
    part, vehicle = hull.part, hull.vehicle
    ground = part.config["chassis"]["ground"]
    law, below = Law.of(part.parameters, vehicle["contact"], "ground"), Ground(part.scene)
    body = hull.motion_of("chassis")
    points = []
    for corner in vehicle["chassis"]["hull"] if ground["hull"] else []:
        arm = body.attitude.apply(np.array(corner) - vehicle["chassis"]["centre"])
        points.append((1.0, body.position + arm, body.velocity + np.cross(body.spin, arm)))
    for k, name in enumerate(hull.names):
        if name.split(".")[0] not in ground["bare"]:
            continue
        table, wheel = hull.wheel(k), hull.motion_of(name)
        axle = body.attitude.apply(Y)
        normal = below.under(wheel.position)[1]
        down = -normal + (normal * axle).sum(1, keepdims=True) * axle
        down /= np.linalg.norm(down, axis=1, keepdims=True)
        for side in (-0.5, 0.5):
            arm = table["radius"] * down + side * table["width"] * axle
            points.append((0.5, wheel.position + arm, wheel.velocity + np.cross(wheel.spin, arm)))
    contacts = []
    for share, x, u in points:
        depth, n = below.under(x)
        on = np.flatnonzero(depth > 0.0)
        contacts.append((on, press(law, share, depth[on], n[on], u[on]), depth[on]))
    t = np.concatenate([f[0] for f in contacts])
    pushes = Push(*(np.concatenate(p) for p in zip(*(f[1] for f in contacts), strict=True)))
    return t, pushes, np.concatenate([f[2] for f in contacts])
