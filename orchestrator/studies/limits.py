"""How long a step may be: spectral radii of the linearised coupling and stability limits of explicit integrators.

The coupling's limit is that of two masses joined by a contact and cut there as a track and its wheel are: the side of
the track moves the wheel on by its velocity and gives the mean force over the step, the side of the wheel takes it.
Both sides are exact, so what is unstable is the cut.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from fmus.physics.ancf.cable import Cable
from fmus.physics.ancf.element import highest_frequency
from fmus.physics.arrays import Floats
from orchestrator.execution import summary
from orchestrator.scene.scene import TrackScene, VehicleScene

LONGEST = 0.5  # s
RUNGE_KUTTA = 2.785  # real axis of the stability region of the classical method


class Pair(NamedTuple):
    """A wheel on a chain, SI."""

    k: float  # of the contact, N/m
    c: float  # of the contact, N s/m
    chain: float  # mass of the links in contact, kg
    wheel: float  # mass that the chain moves, kg
    bed: float = 0.0  # stiffness under the links, N/m
    bed_damping: float = 0.0
    spring: float = 0.0  # on the wheel's own side, N/m
    spring_damping: float = 0.0


def amplification(pair: Pair, h: float) -> Floats:
    """Matrix (4, 4) of one step: chain's position and velocity, then the wheel's."""
    p, whole = pair, np.zeros((6, 6))  # chain x, v; extrapolated wheel x, v; their mean force; a one for the wheel
    whole[0, 1] = whole[2, 3] = 1.0
    whole[1, :4] = np.array([-p.k - p.bed, -p.c - p.bed_damping, p.k, p.c]) / p.chain
    whole[4, :4] = np.array([p.k, p.c, -p.k, -p.c]) / h
    end = expm(whole * h)
    own = np.zeros((3, 3))  # wheel x, v, and the mean force
    own[0, 1] = 1.0
    own[1] = np.array([-p.spring, -p.spring_damping, 1.0]) / p.wheel
    made = expm(own * h)
    step = np.zeros((4, 4))
    step[:2] = end[:2, :4]
    step[2:, 2:] = made[:2, :2]
    step[2:] += np.outer(made[:2, 2], end[4, :4])
    return step


def radius(pair: Pair, h: float) -> float:
    """Spectral radius of a step."""
    return float(abs(np.linalg.eigvals(amplification(pair, h))).max())


def coupling_limit(pair: Pair) -> float:
    """The first step at which a step amplifies, s; LONGEST when none does up to there."""
    steps = np.geomspace(1e-5, LONGEST, 200)
    for before, after in pairwise(steps):
        if radius(pair, after) > 1.0 + 1e-6:
            return float(brentq(lambda h: radius(pair, h) - 1.0 - 1e-6, before, after, rtol=1e-6))
    return LONGEST


def explicit_limit(frequency: float, relaxation: float = 0.0) -> float:
    """Largest step of the classical Runge-Kutta method, s, for a mode of ``frequency``, rad/s, damped in proportion.

    x'' + relaxation w^2 x' + w^2 x = 0, the damping of a material with that relaxation time, s.
    """
    decay = 0.5 * relaxation * frequency**2
    root = -decay + np.sqrt(complex(decay**2 - frequency**2))
    roots = (root, -2.0 * decay - root)

    def growth(h: float) -> float:
        z = [h * one for one in roots]
        return max(abs(1 + s + s**2 / 2 + s**3 / 6 + s**4 / 24) for s in z) - 1.0

    guess = 0.9 * RUNGE_KUTTA / max(abs(one) for one in roots)
    high = guess
    while growth(high) <= 0.0:
        high *= 1.01
    low = high / 1.01 if high > guess else 0.0
    return float(brentq(growth, low, high, rtol=1e-9)) if low else guess


def pairs(scene: VehicleScene) -> dict[str, Pair]:
    """The places where a vehicle is cut, as two masses on a contact; loads are those of the vehicle at rest."""
    v = scene.vehicle
    contact, ground, link = v.contact.wheel, v.contact.ground, v.track.mass
    wrapped = math.pi * v.idler.radius / v.track.pitch  # links on half of the idler
    load = summary.weight(scene) / (2.0 * len(v.road_wheel.x))
    spin = v.road_wheel.spin_inertia / v.road_wheel.radius**2
    return {
        "road wheel on its link": Pair(
            contact.stiffness, contact.damping, link, v.road_wheel.mass + 0.5 * v.road_arm.mass,
            ground.stiffness, ground.damping, v.suspension.stiffness, v.suspension.damping,
        ),
        "idler in its bend": Pair(
            0.5 * wrapped * contact.stiffness, 0.5 * wrapped * contact.damping, wrapped * link, v.idler.mass,
            2.0 * v.material.youngs_modulus * v.section.area / abs(v.idler.x),  # both runs to the sprocket
            spring=v.tensioner.stiffness, spring_damping=v.tensioner.damping,
        ),
        "friction that spins a road wheel": Pair(
            0.0, contact.friction * load / contact.friction_velocity, link, spin,
            bed_damping=ground.friction * load / ground.friction_velocity,
        ),
    }  # fmt: skip


def link_frequency(scene: TrackScene) -> float:
    """Highest frequency of one free straight link, rad/s: no mode of its chain is higher."""
    v = scene.vehicle
    E, A, I, line = v.material.youngs_modulus, v.section.area, v.section.bending, v.track.mass / v.track.pitch
    one = Cable(v.track.pitch, line, E * A, E * I, 0.0, 0.0)
    return highest_frequency(one)


def predicted(scene: TrackScene) -> tuple[float, str]:
    """Longest step, s, and what limits it; NaN where nothing does (implicit links alone)."""
    if scene.track.integrator == "runge_kutta" and scene.track.model == "flexible":
        return explicit_limit(link_frequency(scene), scene.vehicle.material.relaxation_time), "highest mode of a link"
    if not isinstance(scene, VehicleScene):
        return math.nan, ""
    return min((coupling_limit(pair), name) for name, pair in pairs(scene).items())
