"""Sprocket drive by its inputs, parameters and `fmus/sprocket_drive/README.md`; world axes."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.integrate import cumulative_trapezoid, quad
from scipy.spatial.transform import Rotation

from mirror.motion import place_and_attitude, rotation_of, start_frame
from mirror.record import Floats, Part

Y = np.array([0.0, 1.0, 0.0])


class Spin:
    """Quantities of a drive, from its record."""

    def __init__(self, part: Part) -> None:
        self.part, self.p, self.J = part, part.parameters, float(part.config["drive"]["inertia"])

    # --- extrapolation of the mount -----------------------------------------------------------------

    @property
    def fixed(self) -> bool:
        """Whether the mount is unconnected, that is a fixed axle."""
        return bool((self.part.u[:, :13] == self.part.start_values[:13]).all())

    @cached_property
    def mount(self) -> tuple[Floats, Rotation, Floats, Floats]:
        """Position, attitude, velocity and angular velocity of the mount at the end of each step (K + 1).

        The first row is the start.
        """
        part, h = self.part, self.part.h[:, None]
        place, mount_attitude = place_and_attitude(part.config["drive"]["mount"])
        place[1] += float(self.p["start.lateral"])
        origin, frame = start_frame(self.p)
        attitude = frame * mount_attitude
        if self.fixed:
            still = np.zeros((len(part.t), 3))
            return still + origin + frame.apply(place), Rotation.concatenate([attitude] * len(part.t)), still, still
        x, v, w = (part.input_vectors(f"mount.{what}") for what in ("position", "velocity", "angular_velocity"))
        q = rotation_of(part.input_vectors("mount.orientation", "wxyz"))
        steeper = self.p["extrapolation"] == "acceleration"
        a, b = (np.vstack([np.zeros(3), np.diff(r, axis=0) / h[:-1]]) * steeper for r in (v, w))
        end_attitude = Rotation.from_rotvec(h * (w + 0.5 * h * b)) * q
        return (
            np.vstack([origin + frame.apply(place), x + h * v + 0.5 * h * h * a]),
            Rotation.concatenate([attitude, end_attitude]),
            np.vstack([np.zeros(3), v + h * a]),
            np.vstack([np.zeros(3), w + h * b]),
        )

    @property
    def input_attitude(self) -> Rotation:
        """Input attitude of the mount at the start of each step."""
        input_attitude = self.part.input_vectors("mount.orientation", "wxyz")
        return self.mount[1][:-1] if self.fixed else rotation_of(input_attitude)

    @property
    def axle(self) -> Floats:
        return self.mount[1].apply(Y)

    @property
    def mount_rate(self) -> Floats:
        """Rate of the mount about the axle (K + 1,), rad/s."""
        return (self.axle * self.mount[3]).sum(1)

    @property
    def chain_torque(self) -> Floats:
        """Torque of the chain about the axle in the middle of each step, mean over the step (K), N m."""
        middle = self.axle[1:] + self.input_attitude.apply(Y)
        return (self.part.input_vectors("sprocket.torque") * middle).sum(1) / np.linalg.norm(middle, axis=1)

    # --- torques -------------------------------------------------------------------------------------

    def profile_speed(self, t: float) -> float:
        """Speed of the half-cosine profile, rad/s."""
        p = self.p
        t0, t1, first, last = p["ramp.start"], p["ramp.end"], p["speed.start"], p["speed.end"]
        if p["stop.start"] >= 0.0 and t > p["stop.start"]:
            s = min((t - p["stop.start"]) / p["stop.time"], 1.0)
            return last * 0.5 * (1.0 + np.cos(np.pi * s))
        s = min(max((t - t0) / (t1 - t0), 0.0), 1.0)
        return first + (last - first) * 0.5 * (1.0 - np.cos(np.pi * s))

    def profile(self, t: Floats) -> Floats:
        return np.array([self.profile_speed(time) for time in t])

    @property
    def brake(self) -> float:
        """Largest torque of the brake, N m."""
        return 0.0 if self.p["mode"] == "speed" else float(self.p["brake.torque"])

    def braked(self) -> Floats:
        """Torque of the brake against the recorded speed, mean over each step (K), N m; NaN where it may hold."""
        s = self.part["speed"]
        slips = (s[1:] * s[:-1] > 0.0) | (self.brake == 0.0)
        return np.where(slips, self.brake * np.sign(s[1:]), np.nan)

    def integrated(self, rates: Floats) -> Floats:
        """Integral of a quantity at instants, by the trapezium rule."""
        return cumulative_trapezoid(rates, self.part.t, initial=0.0)

    # --- outputs ------------------------------------------------------------------------------------

    def speed(self) -> Floats:
        """Speed as prescribed, or integrated from the balance of torques, rad/s."""
        part = self.part
        if self.p["mode"] == "speed":
            return self.profile(part.t)
        gained = part.h * (self.chain_torque + part["torque"][1:]) / self.J - np.diff(self.mount_rate)
        speeds = [self.profile_speed(0.0)]
        for h, gain in zip(part.h, gained, strict=True):  # the brake takes what is there, at most its own impulse
            free = speeds[-1] + gain
            speeds.append(np.sign(free) * max(abs(free) - h * self.brake / self.J, 0.0))
        return np.array(speeds)

    def angle(self) -> Floats:
        part = self.part
        if self.p["mode"] == "speed":
            edges = [self.p[key] for key in ("ramp.start", "ramp.end", "stop.start")]
            edges.append(self.p["stop.start"] + self.p["stop.time"])
            done = [quad(self.profile_speed, a, b, points=[e for e in edges if a < e < b] or None)[0]
                    for a, b in zip(part.t, part.t[1:], strict=False)]  # fmt: skip
            turned_by = np.concatenate([[0.0], np.cumsum(done)])
        else:
            turned_by = self.integrated(part["speed"])
        return self.p["start.angle"] + turned_by

    def torque(self) -> Floats:
        """Motor torque, mean over each step, N m; 0 at the start."""
        part, p = self.part, self.p
        s = part["speed"]
        if p["mode"] == "torque":
            mean = np.full(len(part.h), p["torque.drive"])
        elif p["mode"] == "speed":
            mean = self.J * np.diff(s + self.mount_rate) / part.h - self.chain_torque
        else:
            error = self.profile(part.t) - s
            proportional = p["controller.proportional"] * error
            # anti-windup: the integral stops where the limit cuts a torque that would grow
            sums, torques = 0.0, [proportional[0]]
            for k, h in enumerate(part.h):
                free = abs(proportional[k] + p["controller.integral"] * sums) < p["torque.limit"]
                sums += 0.5 * h * (error[k] + error[k + 1]) * free
                torques.append(proportional[k + 1] + p["controller.integral"] * sums)
            torques = np.clip(torques, -p["torque.limit"], p["torque.limit"])
            mean = 0.5 * (torques[1:] + torques[:-1])
        return np.concatenate([[0.0], mean])

    def kinetic(self) -> Floats:
        return 0.5 * self.J * (self.part["speed"] + self.mount_rate) ** 2

    def work(self) -> Floats:
        part = self.part
        return np.concatenate([[0.0], np.cumsum(part["torque"][1:] * np.diff(part["angle"]))])

    def dissipated(self) -> Floats:
        return self.integrated(self.brake * abs(self.part["speed"]))

    def port_work(self) -> Floats:
        """Work of the chain's wrench on the sprocket less that of the wrench on the mount, J."""
        part = self.part
        turning, swinging = part.vector("sprocket.angular_velocity"), self.mount[3]
        turning, swinging = (0.5 * (w[1:] + w[:-1]) for w in (turning, swinging))
        power = (part.input_vectors("sprocket.torque") * turning).sum(1) - (
            part.vector("mount.torque")[1:] * swinging
        ).sum(1)
        return np.concatenate([[0.0], np.cumsum(part.h * power)])

    def mount_torque(self) -> Floats:
        """Torque on the mount: the chain's torque less the change of the spin; NaN at the start."""
        part = self.part
        momentum = self.J * (part["speed"] + self.mount_rate)[:, None] * self.axle
        spin_torque = np.diff(momentum, axis=0) / part.h[:, None]
        return np.vstack([np.full(3, np.nan), part.input_vectors("sprocket.torque") - spin_torque])

    def steps(self) -> Floats:
        """Number of internal steps, each at most half the time constant of the controller."""
        p, part = self.p, self.part
        counts = np.ones(len(part.h))
        if p["mode"] == "controller":
            fastest = p["controller.proportional"] / self.J + np.sqrt(p["controller.integral"] / self.J)
            counts = np.maximum(1.0, np.ceil(2.0 * part.h * fastest))
        return np.concatenate([[0.0], np.cumsum(counts)])

    def evaluations(self) -> Floats:
        """Four evaluations per step; one for a prescribed speed."""
        return self.steps() * (1.0 if self.p["mode"] == "speed" else 4.0)
