"""Motion of the chain benchmark for all codes, and the error at its end.

A loop of 64 links, a regular polygon without gravity, turns at 5 rad/s. Its links also turn by 4 rad/s cos(2 angle),
so it becomes an oval of 1.6 by 4.2 m and back. All links are thin rods with the m113's mass. Flexible ones have a
twentieth of the stiffness of steel: rigid links would then be 1.3e-4 of the way off, with steel only 8e-6. On the
ground the loop only turns, has gravity, and is set down: it slips, drives off and sags. Its first 0.3 s are known to
1e-7 m; beyond half a second no two steps give the same heap. Two open chains, held at one end, are the gallery's.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.physics.chain.layout import ovalling, regular_polygon
from orchestrator.scene.kinds import Scene
from orchestrator.scene.parts import Part
from tests.benchmarks import own

Floats = NDArray[np.float64]

SCENE = "spinning_loop"
LINKS, MASS = 64, 18.02  # of the m113, kg per link
MODULUS, RELAXATION = 1e10, 2e-4  # of flexible links, Pa and s: the stretch of the start has decayed after 0.1 s
SPIN = 5.0  # rad/s
OVALLING = 4.0  # rad/s
GRAVITY = 9.81  # m/s2
REFERENCE = Path(__file__).with_name("reference.json")


class Case(NamedTuple):
    """Chain to be measured."""

    track: str  # track model
    ground: bool
    stop: float  # s
    quick: float  # s, end of the quick form
    planar: bool = False  # cables without lateral dofs, as the peers'
    scene: str = SCENE
    longest: float = 1.0  # s, longest explicit step that is tried

    def steps(self, steps: Iterable[float]) -> list[float]:
        """Steps of a list, s, that are tried."""
        return [step for step in steps if step <= self.longest]


CASES = {
    "flexible": Case("flexible", False, 1.0, 0.1, planar=True),
    "rigid": Case("rigid", False, 1.0, 0.1),
    "rigid, on the ground": Case("rigid", True, 0.3, 0.1),
    "rigid, released": Case("rigid", False, 0.5, 0.1, scene="released_chain", longest=5e-3),
    "rigid, folded": Case("rigid", False, 0.8, 0.1, scene="folded_chain", longest=5e-3),
}


class Loop(NamedTuple):
    """Chain at t = 0 for other codes, SI units, in the plane (x, z); n links, m = n pins, n + 1 of an open chain."""

    pins: Floats  # (m, 2) pins, in an open chain the first one is held
    velocity: Floats  # (m, 2) of pins
    angle: Floats  # (n) of links, from x towards z
    rate: Floats  # (n) derivative of ``angle``
    pitch: float
    mass: float  # one link
    axial: float  # EA, N
    bending: float  # EI, N m2
    relaxation: float  # s: damping over stiffness
    gravity: float = 0.0  # m/s2, against z

    @property
    def closed(self) -> bool:
        """Whether it is a loop."""
        return len(self.pins) == len(self.angle)


def scene(case: Case, *settings: str) -> Scene:
    """Scene of a chain without contact."""
    if case.scene != SCENE:
        return own.scene(case.scene, case.track, settings)
    rod = own.scene(SCENE, case.track, ["vehicle=m113"]).vehicle
    inertia = (rod.track.inertia[0], MASS * rod.track.pitch**2 / 12.0, rod.track.inertia[2])
    given = [
        "vehicle=m113", f"vehicle.track.mass={MASS}", f"vehicle.track.inertia={list(inertia)}",
        f"vehicle.material.youngs_modulus={MODULUS} Pa", f"vehicle.material.relaxation_time={RELAXATION} s",
        f"chain.links={LINKS}", f"chain.spin={SPIN}", f"chain.ovalling={0.0 if case.ground else OVALLING}",
        "track.start=polygon", f"planar={str(case.planar).lower()}",
    ]  # fmt: skip
    return own.scene(SCENE, case.track, [*given, *settings])


@cache
def part(case: Case) -> Part:
    """Component of the loop; in a case with a ground, this lies just below the loop, and there is gravity."""
    component = own.part(scene(case), "chain")
    if not case.ground:
        return component
    vehicle = component.config["vehicle"]
    wheel, track = vehicle["road_wheel"], vehicle["track"]
    depth = 0.5 * track["pitch"] / np.tan(np.pi / LINKS) + track["face"]
    drawn = {**wheel, "z": wheel["radius"] + 2.0 * track["face"] - depth}  # the ground is below the wheels as drawn
    config = {
        "vehicle": {**vehicle, "road_wheel": drawn},
        "track": {**component.config["track"], "ground": True, "gravity": GRAVITY},
    }
    return component._replace(config={**component.config, **config})


def model(case: Case, step: float, **changes: float | str) -> Any:
    """Model of the component at the start, with internal steps of ``step`` s."""
    return own.started(part(case), step=step, **changes)


def loop(case: Case) -> Loop:
    """Loop for other codes."""
    vehicle = part(case).config["vehicle"]
    track, section, material = vehicle["track"], vehicle["section"], vehicle["material"]
    if case.scene != SCENE:
        start = pins(model(case, 1e-3))
        chord, gravity = np.diff(start, axis=0), part(case).config["track"]["gravity"]
        angle, still = np.arctan2(chord[:, 1], chord[:, 0]), np.zeros_like(start)
        return Loop(start, still, angle, np.zeros(len(angle)), track["pitch"], track["mass"], 0.0, 0.0, 0.0, gravity)
    first_pins = regular_polygon(track["pitch"], LINKS)
    turning, velocity = ovalling(first_pins, 0.0 if case.ground else OVALLING)
    velocity = velocity + SPIN * np.stack([first_pins[:, 1], -first_pins[:, 0]], axis=1)
    chord = np.roll(first_pins, -1, axis=0) - first_pins
    angle, modulus = np.arctan2(chord[:, 1], chord[:, 0]), material["youngs_modulus"]
    stiffness = modulus * section["area"], modulus * section["bending"]
    rate = -(turning + SPIN)  # rotation about y is from z towards x
    return Loop(
        first_pins, velocity, angle, rate, track["pitch"], track["mass"], *stiffness, material["relaxation_time"]
    )


def pins(model: Any) -> Floats:
    """Pin positions of a model, (n, 2) of x and z, from its link outputs."""
    names = [port.name for port in model.ports if port.causality == "output" and isinstance(port.start, float)]
    y = np.empty(model.link_ports)
    model.link_outputs(y)
    return places(names[-model.link_ports :], y)


def places(names: list[str], y: Floats) -> Floats:
    """Pin positions from values of link outputs by name."""
    at = {axis: [k for k, name in enumerate(names) if name.endswith(f".position.{axis}")] for axis in "xz"}
    return np.stack([y[at["x"]], y[at["z"]]], axis=1)


# --- the reference ----------------------------------------------------------------------------------------


def key(case: Case) -> str:
    """Name of a case."""
    return next(name for name, each in CASES.items() if each == case)


def error(case: Case, stop: float, motion: Floats) -> float:
    """RMS distance of the pins from the reference at ``stop``, over the RMS of their paths' lengths."""
    reference = json.loads(REFERENCE.read_text(encoding="utf-8"))["cases"][key(case)][f"{stop:g}"]
    distance = np.linalg.norm(motion - np.array(reference["pins"]), axis=1)
    return float(np.sqrt(np.mean(distance**2))) / float(reference["way"])
