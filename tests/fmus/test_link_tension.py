"""The tension of a link is the pull between its two parts, averaged along it, by equilibrium."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from vehicle_in_process import InProcess

import fmus.track_flexible.model as track_flexible
from fmus.physics.arrays import Floats
from fmus.physics.chain.link_columns import JOINT
from orchestrator.scene.scene import load

LINKS, SPIN, STEEL = 16, 100.0, 2.06e11  # rad/s, Pa
CHAINS = {
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
    "cable", *(pytest.param(kind, marks=pytest.mark.study) for kind in CHAINS if kind != "cable")
])  # fmt: skip
def test_flexible_links_have_the_same_as_they_become_stiff(kind):
    """The tension of flexible links approaches that of rods as 1 / E."""
    soft, stiff = (tension(*CHAINS[kind], stiffer=k) / by_theory() - 1.0 for k in (1.0, 4.0))
    assert abs(soft) < 5e-4
    assert soft / stiff == pytest.approx(4.0, rel=0.02)
    assert abs(tension(*CHAINS[kind], mass=1.03 * 18.0) / by_theory() - 1.0) > 0.02


def test_rotary_inertia_beside_a_rods_is_no_part_of_it():
    """Rotary inertia beyond that of a rod does not change the tension.

    It stretches the element (by 5 times the tolerance here), but no part of the link pulls at the other.
    """
    heavy = 'vehicle.track.inertia=["0.22 kg m^2", "0.05 kg m^2", "0.25 kg m^2"]'
    assert tension("flexible", heavy, stiffer=4.0) == pytest.approx(by_theory(), rel=1e-3)


STARTING = ("vehicle=robot", "symmetric=true", "drive.speed=6 rad/s", "drive.ramp_start=0", "drive.ramp_time=0.2 s")


def pull_of_pins(area: float) -> Floats:
    """Mean force of the pins less mean tension, N, of a track of the robot that starts to drive, by step."""
    scene = load("straight", "flexible", [*STARTING, f"vehicle.section.area={area} m^2"])
    vehicle, found = InProcess(scene), []
    for _ in range(280):
        vehicle.run(scene.run.step)
        track = vehicle["left_track"]
        pins = track.model.s.on_links[:, JOINT : JOINT + 3]
        found.append(np.linalg.norm(pins, axis=1).mean() - track["tension.mean"])
    return np.array(found)


@pytest.mark.parametrize("pin_error", [0.02, np.inf])
def test_pins_of_very_stiff_links_carry_the_tension(monkeypatch, pin_error):
    """Of links of steel and of a hundred times that area; Newton's tolerance in metres alone is off by 9 N (twin)."""
    monkeypatch.setattr(track_flexible, "PIN_ERROR", pin_error)
    usual, stiff = pull_of_pins(0.001389), pull_of_pins(0.1389)
    assert (abs(stiff - usual).max() < 0.05) == (pin_error < 1.0)
