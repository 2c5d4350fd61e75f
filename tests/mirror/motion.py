"""Motion of a track's wheels, and the impulse of a force over a step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from fmus.track.start import drawn
from mirror.record import Floats, Part


def rotation_of(q: Floats) -> Rotation:
    """Rotation of quaternions (..., 4), w first."""
    return Rotation.from_quat(q, scalar_first=True)


def start_frame(parameters: dict[str, Any]) -> tuple[Floats, Rotation]:
    """Origin and attitude of the vehicle frame at the start."""
    x, y, z, height, pitch = (
        float(parameters[f"start.{key}"]) for key in ("position.x", "position.y", "position.z", "height", "pitch")
    )
    frame = ground_frame(parameters)
    return np.array([x, y, z]) + frame.apply([0.0, 0.0, height]), frame * Rotation.from_euler("Y", pitch)


def ground_frame(parameters: dict[str, Any]) -> Rotation:
    """Axes of the start: x along the ground below the heading, z along the ground's normal."""
    angles = (float(parameters[f"start.{key}"]) for key in ("heading", "slope.pitch", "slope.roll"))
    return Rotation.from_euler("ZYX", [*angles])


def place_and_attitude(numbers: Sequence[float]) -> tuple[Floats, Rotation]:
    """Place and attitude in the vehicle frame from seven numbers, or from a drawn place of three."""
    pose = np.array([*numbers, 1.0, 0.0, 0.0, 0.0][:7])
    return pose[:3], rotation_of(pose[3:])


class Wheels(NamedTuple):
    """Wheels in the world frame, shape (k, m, 3): k instants, m wheels."""

    centre: Floats
    velocity: Floats
    spin: Floats  # angular velocity, rad/s
    axle: Floats
    radial: Floats  # unit vector that turns with the wheel

    def advanced(self, tau: float) -> Wheels:
        """Wheels ``tau`` s later (or earlier) at constant velocities."""
        about = Rotation.from_rotvec(tau * self.spin.reshape(-1, 3))
        axle, radial = (about.apply(a.reshape(-1, 3)).reshape(a.shape) for a in (self.axle, self.radial))
        return Wheels(self.centre + tau * self.velocity, self.velocity, self.spin, axle, radial)


def wheels(part: Part) -> Wheels:
    """Wheels of a track at the end of each step, extrapolated from its inputs; at the start as laid out."""
    names = [wheel["name"] for wheel in part.config["track"]["wheels"]]
    k = len(part.t)
    origin, attitude = start_frame(part.parameters)
    lateral = np.array([0.0, float(part.parameters["start.lateral"]), 0.0])
    table = {wheel["name"]: wheel for wheel in drawn(part.config["vehicle"], part.config["track"]["wheels"])}
    places = [(w, [w["position"][0], 0.0, w["position"][1]]) for w in table.values()]
    poses = [place_and_attitude(w.get("start", place)) for w, place in places]
    arrays = [np.zeros((k, len(names), 3)) for _ in range(5)]
    for m, name in enumerate(names):
        place, turned = poses[m][0], attitude * poses[m][1]
        arrays[0][0, m] = origin + attitude.apply(place + lateral)
        arrays[3][0, m], arrays[4][0, m] = turned.apply([0, 1, 0]), turned.apply([1, 0, 0])
        q = rotation_of(part.input_vectors(f"{name}.orientation", "wxyz"))
        moved = (part.input_vectors(f"{name}.{what}") for what in ("position", "velocity", "angular_velocity"))
        inputs = Wheels(*moved, q.apply([0, 1, 0]), q.apply([1, 0, 0]))
        about = Rotation.from_rotvec(part.h[:, None] * inputs.spin)
        arrays[0][1:, m] = inputs.centre + part.h[:, None] * inputs.velocity
        arrays[1][1:, m], arrays[2][1:, m] = inputs.velocity, inputs.spin
        arrays[3][1:, m], arrays[4][1:, m] = about.apply(inputs.axle), about.apply(inputs.radial)
    return Wheels(*arrays)


class Recursion(NamedTuple):
    """Generalised-alpha or HHT as a recursion from forces to impulses.

    Chung and Hulbert 1993, Arnold and Bruels 2007. (1 - alpha_m) W1 + alpha_m W0 = (1 - alpha_f) F1 + alpha_f F0; the
    mean over the step is (1 - gamma) W0 + gamma W1.
    """

    alpha_m: float
    alpha_f: float
    gamma: float

    @classmethod
    def of(cls, radius: float, hht: bool = False) -> Recursion:
        alpha_m, alpha_f = (2 * radius - 1) / (radius + 1), radius / (radius + 1)
        if hht:
            alpha_m, alpha_f = 0.0, (1 - radius) / (1 + radius)
        return cls(alpha_m, alpha_f, 0.5 + alpha_f - alpha_m)

    def means(self, F: Floats) -> Floats:
        """Mean over each of the K steps of a force at K + 1 instants; the first instant is at rest."""
        W, means = F[0], np.zeros((len(F) - 1, *F.shape[1:]))
        for k in range(len(F) - 1):
            before = W
            W = ((1 - self.alpha_f) * F[k + 1] + self.alpha_f * F[k] - self.alpha_m * before) / (1 - self.alpha_m)
            means[k] = (1 - self.gamma) * before + self.gamma * W
        return means

    def rates(self, v: Floats, h: Floats) -> Floats:
        """Inverse of ``means``: accelerations at K + 1 instants from the velocities there, from rest."""
        W, F = np.zeros(v.shape[1:]), np.zeros(v.shape)
        for k in range(len(h)):
            before = W
            W = ((v[k + 1] - v[k]) / h[k] - (1 - self.gamma) * before) / self.gamma
            F[k + 1] = ((1 - self.alpha_m) * W + self.alpha_m * before - self.alpha_f * F[k]) / (1 - self.alpha_f)
        return F
