"""The tension of a link is the pull between its two parts, averaged along it, by equilibrium."""

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
    """Mean tension of the links of a spinning loop, N."""
    young, shear = stiffer * STEEL, stiffer * 7.923e10
    material = f"vehicle.material.youngs_modulus={young} Pa", f"vehicle.material.shear_modulus={shear} Pa"
    scene = load("spinning_loop", model, [f"chain.spin={SPIN} rad/s", f"chain.links={LINKS}", *material, *settings,
                                          f"vehicle.track.mass={mass} kg"])  # fmt: skip
    chain = InProcess(scene)["chain"]
    tensions = chain.link_outputs()[:LINKS]
    assert np.ptp(tensions) < 1e-7 * tensions.mean()
    y = [chain[f"tension.{which}"] for which in ("min", "mean", "max")]
    assert y == pytest.approx([tensions.min(), tensions.mean(), tensions.max()], rel=1e-12)
    return float(tensions.mean())


def by_theory(mass: float = 18.0) -> float:
    """Tension of rods of length l on a circle, N: pull at the pins and m l w^2/12 of their rotation."""
    l, half = 0.1524, np.pi / LINKS
    at_the_pins = mass * SPIN**2 * 0.5 * l / np.tan(half) / (2.0 * np.sin(half)) * np.cos(half)
    return at_the_pins + mass * l * SPIN**2 / 12.0


@pytest.mark.long
def test_of_rigid_links_it_is_that_of_rods():
    assert tension("rigid") == pytest.approx(by_theory(), rel=1e-12)
    assert tension("rigid", mass=1.03 * 18.0) != pytest.approx(by_theory(), rel=0.02)


@pytest.mark.parametrize("kind", [
    "cable", *(pytest.param(kind, marks=pytest.mark.study) for kind in KINDS if kind != "cable")
])  # fmt: skip
def test_flexible_links_have_the_same_as_they_become_stiff(kind):
    """The tension of flexible links approaches that of rods as 1 / E."""
    soft, stiff = (tension(*KINDS[kind], stiffer=k) / by_theory() - 1.0 for k in (1.0, 4.0))
    assert abs(soft) < 5e-4
    assert soft / stiff == pytest.approx(4.0, rel=0.02)
    assert abs(tension(*KINDS[kind], mass=1.03 * 18.0) / by_theory() - 1.0) > 0.02


def test_rotary_inertia_beside_a_rods_is_no_part_of_it():
    """Rotary inertia beyond that of a rod does not change the tension.

    It stretches the element (by 5 times the tolerance here), but no part of the link pulls at the other.
    """
    heavy = 'vehicle.track.inertia=["0.22 kg m^2", "0.05 kg m^2", "0.25 kg m^2"]'
    assert tension("flexible", heavy, stiffer=4.0) == pytest.approx(by_theory(), rel=1e-3)
