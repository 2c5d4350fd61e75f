"""Violation of joints over a run at position, velocity and acceleration level (section 1, point 3).

The equations of a pin between two rigid links are those of ``fmus.physics.rigid.pin``: C[0:3], the ends coincide, and
C[3:5], the axes are parallel. They and both time derivatives are implemented here independently, in numpy, and
evaluated with the poses, velocities and accelerations that the components saved. For ANCF links the equations are (2)
of the paper. Eliminated coordinates are shared by both sides, so their violation is 0.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.reader import Log
from orchestrator.log.time_series import Floats
from orchestrator.results.rotation import matrices
from orchestrator.scene.kinds import Scene
from tests.validation.paper.states import model, saved

TRACK = "left_track"
POSE, SLOPE_Y = 7, 4  # length of a rigid link's pose; index of the slope along the pin in a cable's node
LEVELS = ("position", "velocity", "acceleration")


class Violation(NamedTuple):
    """Violation at one instant: largest gap and axis angle of joints, gap of a cut, and their derivatives."""

    gap: Floats  # (3) m, m/s, m/s2
    tilt: Floats  # (3) rad, rad/s, rad/s2
    cut: Floats  # (3) m, m/s, m/s2 of the pin closed by a spring; 0 without one


def of(file: Path, scene: Scene) -> dict[str, float]:
    """Largest violation over the checkpoints of a log, by level; ``scene`` as recorded."""
    chain = model(scene, TRACK)
    with Log(file) as log:
        violations = []
        for _, states in saved(log):
            chain.state[:] = states[TRACK]
            violations.append(violated(chain, scene.track.closure == "spring"))
    most = {key: np.max([getattr(each, key) for each in violations], axis=0) for key in Violation._fields}
    largest = {f"{level}_{key}": float(most[key][k]) for k, level in enumerate(LEVELS) for key in most}
    return {**largest, "instants": float(len(violations))}


def violated(chain: Any, cut: bool) -> Violation:
    """Violation of a chain's model in its present state; ``cut``: a spring closes the chain."""
    s, n = chain.s, chain.links_count
    if s.q.shape[-1] == POSE:
        return of_poses(s.q, s.v, s.vdot, 0.5 * chain.pitch, cut)
    levels = s.q, s.v, s.vdot
    if len(s.q) == 2 * n:  # each link has its own coordinates
        return of_links(*levels, cut)
    parted = np.array([np.linalg.norm(each[-1, :3] - each[0, :3]) for each in levels])
    return Violation(np.zeros(3), np.zeros(3), parted * cut)  # both sides of each joint share coordinates


def of_links(q: Floats, v: Floats, a: Floats, cut: bool) -> Violation:
    """Violation of a loop of cables with separate nodes (2 n, 6), position and slope: paper (2) about y."""
    joints = slice(None, -1 if cut else None)
    apart = [each[1::2] - np.roll(each[::2], -1, axis=0) for each in (q, v, a)]
    gaps = np.array([np.linalg.norm(each[:, :3], axis=1) for each in apart])
    tilts = np.array([np.abs(each[:, SLOPE_Y]) for each in apart])
    return Violation(gaps[:, joints].max(axis=1), tilts[:, joints].max(axis=1), gaps[:, -1] * cut)


def of_poses(q: Floats, v: Floats, a: Floats, half: float, cut: bool = False) -> Violation:
    """Violation of a loop of rigid links: poses (n, 7), rates, accelerations (n, 6), angular in body axes.

    ``cut``: a spring replaces the last pin.
    """
    A = matrices(q[:, 3:])
    omega, alpha = (np.einsum("nij,nj->ni", A, each[:, 3:]) for each in (v, a))
    e = np.moveaxis(A, 2, 0)  # axes x, y, z of each link
    rate = np.cross(omega, e)
    second = np.cross(alpha, e) + np.cross(omega, rate)
    x, y, z = ((e[k], rate[k], second[k]) for k in range(3))
    place = q[:, :3], v[:, :3], a[:, :3]
    gap = [c + half * axis - np.roll(c - half * axis, -1, axis=0) for c, axis in zip(place, x, strict=True)]
    y = tuple(np.roll(each, -1, axis=0) for each in y)  # of the next link
    tilts = []
    for axis in (x, z):
        zero = _dot(axis[0], y[0])
        first = _dot(axis[1], y[0]) + _dot(axis[0], y[1])
        tilts.append([zero, first, _dot(axis[2], y[0]) + 2.0 * _dot(axis[1], y[1]) + _dot(axis[0], y[2])])
    gaps = np.array([np.linalg.norm(level, axis=1) for level in gap])
    joints = slice(None, -1 if cut else None)
    tilt = np.abs(np.array(tilts))[..., joints].max(axis=(0, 2))
    return Violation(gaps[:, joints].max(axis=1), tilt, gaps[:, -1] * cut)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("ni,ni->n", a, b))
