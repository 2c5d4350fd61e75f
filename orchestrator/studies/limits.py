"""Step limits: spectral radii of the linearised coupling, stability limits of explicit integrators.

The coupling's limit is that of two masses (``oscillator``) joined by a contact and cut there like a track and its
wheel: the side of the track extrapolates the wheel by its velocity and outputs the mean force over the step, which
the side of the wheel receives. Both sides are exact, so any instability comes from the cut.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from fmus.physics.ancf.cable import Cable
from fmus.physics.ancf.element import highest_frequency
from orchestrator.execution import summary
from orchestrator.scene.kinds import Scene, VehicleScene
from orchestrator.studies.oscillator import Oscillator, radius

LONGEST = 0.5  # s
RUNGE_KUTTA = 2.785  # end of the stability region on the real axis, classical method
AMPLIFIED = 1.0 + 1e-6  # spectral radius beyond rounding


def coupling_limit(pair: Oscillator) -> float:
    """First step, s, at which the spectral radius exceeds 1; LONGEST if none does."""

    def growth(h: float) -> float:
        return radius("tracks_first", "linear", "wrench", pair, h) - AMPLIFIED

    for before, after in pairwise(np.geomspace(1e-5, LONGEST, 200)):
        if growth(after) > 0.0:
            return float(brentq(growth, before, after, rtol=1e-6))
    return LONGEST


def explicit_limit(frequency: float, relaxation: float = 0.0) -> float:
    """Largest step of classical Runge-Kutta, s, for a mode of ``frequency``, rad/s, and its damping.

    The mode is x'' + relaxation w^2 x' + w^2 x = 0, as of a material with that relaxation time, s.
    """
    roots = np.roots([1.0, relaxation * frequency**2, frequency**2])

    def growth(h: float) -> float:
        z = h * roots
        return float(abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24).max()) - 1.0

    high = 0.9 * RUNGE_KUTTA / float(abs(roots).max())  # stable for any damping
    while growth(high) <= 0.0:
        high *= 1.01
    return float(brentq(growth, high / 1.01, high, rtol=1e-9))


def pairs(scene: VehicleScene) -> dict[str, Oscillator]:
    """Cuts of a vehicle as two masses on a contact, with the loads of the vehicle at rest.

    Mass 1 is that of the links in contact, on the ground below; mass 2 is what the chain moves, on its own springs.
    """
    v = scene.vehicle
    contact, ground, link = v.contact.wheel, v.contact.ground, v.track.mass
    wrapped = math.pi * v.idler.radius / v.track.pitch  # links on half of the idler
    load = summary.weight(scene) / (2.0 * len(v.road_wheel.x))
    spin = v.road_wheel.spin_inertia / v.road_wheel.radius**2
    return {
        "road wheel on its link": Oscillator(
            k=contact.stiffness, c=contact.damping, m1=link, m2=v.road_wheel.mass + 0.5 * v.road_arm.mass,
            k1=ground.stiffness, c1=ground.damping, k2=v.suspension.stiffness, c2=v.suspension.damping,
        ),
        "idler in its bend": Oscillator(
            k=0.5 * wrapped * contact.stiffness, c=0.5 * wrapped * contact.damping, m1=wrapped * link, m2=v.idler.mass,
            k1=2.0 * v.material.youngs_modulus * v.section.area / abs(v.idler.x),  # both spans to the sprocket
            k2=v.tensioner.stiffness, c2=v.tensioner.damping,
        ),
        "friction that spins a road wheel": Oscillator(
            k=0.0, c=contact.friction * load / contact.friction_velocity, m1=link, m2=spin, k1=0.0, k2=0.0,
            c1=ground.friction * load / ground.friction_velocity,
        ),
    }  # fmt: skip


def link_frequency(scene: Scene) -> float:
    """Highest frequency of a free straight link, rad/s: an upper bound for its chain."""
    v = scene.vehicle
    E, A, I, l, mass = v.material.youngs_modulus, v.section.area, v.section.bending, v.track.pitch, v.track.mass
    rotary = v.track.inertia[1] - mass * l**2 / 12.0
    return highest_frequency(Cable(l, mass / l, E * A, E * I, 0.0, 0.0, rotary=rotary))


def predicted(scene: Scene) -> tuple[float, str]:
    """Longest step, s, and its cause; NaN without a limit (implicit links alone)."""
    if scene.track.integrator == "runge_kutta" and "element" in scene.track.choices():
        return explicit_limit(link_frequency(scene), scene.vehicle.material.relaxation_time), "highest mode of a link"
    if not isinstance(scene, VehicleScene):
        return math.nan, ""
    return min((coupling_limit(pair), name) for name, pair in pairs(scene).items())
