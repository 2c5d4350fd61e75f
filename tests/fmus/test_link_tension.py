"""Tension of links means one thing: the pull between a link's two parts, mean along it, by equilibrium."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from vehicle_in_process import InProcess

from orchestrator.scene.scene import load

LINKS, SPIN, STEEL = 16, 100.0, 2.06e11  # rad/s, Pa
KINDS = {
    "cable": ("flexible",),
    "general": ("flexible", "track.elasticity=general"),
    "engineering": ("flexible", "track.elasticity=engineering"),
    "beam": ("flexible", "track.element=beam"),
}


@cache
def tension(model: str, *settings: str, stiffer: float = 1.0, mass: float = 18.0) -> float:
    """Tension of each link of a rotating loop, N."""
    young, shear = stiffer * STEEL, stiffer * 7.923e10
    material = f"vehicle.material.youngs_modulus={young} Pa", f"vehicle.material.shear_modulus={shear} Pa"
    scene = load("spinning_loop", model, [f"chain.spin={SPIN} rad/s", f"chain.links={LINKS}", *material, *settings,
                                          f"vehicle.track.mass={mass} kg"])  # fmt: skip
    chain = InProcess(scene)["chain"]
    found = chain.link_outputs()[:LINKS]
    assert np.ptp(found) < 1e-7 * found.mean()
    y = [chain[f"tension.{which}"] for which in ("min", "mean", "max")]
    assert y == pytest.approx([found.min(), found.mean(), found.max()], rel=1e-12)
    return float(found.mean())


def by_theory(mass: float = 18.0) -> float:
    """Rods of length l on a circle: the pull of their pins along them, and m l w^2/12 of their own turning."""
    l, half = 0.1524, np.pi / LINKS
    at_the_pins = mass * SPIN**2 * 0.5 * l / np.tan(half) / (2.0 * np.sin(half)) * np.cos(half)
    return at_the_pins + mass * l * SPIN**2 / 12.0


def test_of_rigid_links_it_is_that_of_rods():
    assert tension("rigid") == pytest.approx(by_theory(), rel=1e-12)
    assert tension("rigid", mass=1.03 * 18.0) != pytest.approx(by_theory(), rel=0.02)


@pytest.mark.parametrize("kind", [
    "cable", *(pytest.param(kind, marks=pytest.mark.study) for kind in KINDS if kind != "cable")
])  # fmt: skip
def test_flexible_links_have_the_same_as_they_become_stiff(kind):
    """The difference falls as 1 / E, on both sides of steel."""
    soft, stiff = (tension(*KINDS[kind], stiffer=k) / by_theory() - 1.0 for k in (1.0, 4.0))
    assert abs(soft) < 5e-4
    assert soft / stiff == pytest.approx(4.0, rel=0.02)
    assert abs(tension(*KINDS[kind], mass=1.03 * 18.0) / by_theory() - 1.0) > 0.02


def test_rotary_inertia_beside_a_rods_is_no_part_of_it():
    """Rotary inertia stretches the element (5 times the tolerance), but causes no tension."""
    heavy = 'vehicle.track.inertia=["0.22 kg m^2", "0.05 kg m^2", "0.25 kg m^2"]'
    assert tension("flexible", heavy, stiffer=4.0) == pytest.approx(by_theory(), rel=1e-3)
