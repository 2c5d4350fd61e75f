"""Limits of mobility by statics and by terrain theory, as brackets of what trials find.

Thrust of a track on soil: Wong, Theory of Ground Vehicles, chapter 2, of Janosi and Hanamoto's shear under uniform
pressure. Steps and gaps: statics of a rigid body.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fmus.ground.soils import work_of_pressure
from fmus.vehicles.sides import ground_wheels, pitch_radius, road_arms, smooth_wheels, thickness
from fmus.vehicles.vehicle import VehicleTable

if TYPE_CHECKING:
    from fmus.ground.soils import Soil


BENDS = ("idler", "wheel")  # kinds of wheels at which a chain turns, beside its sprocket


class Bracket(NamedTuple):
    """Least and largest value."""

    low: float
    high: float

    def holds(self, value: float) -> bool:
        """True if the value is in the bracket, or beyond it by a tenth of its width."""
        beyond = 0.1 * (self.high - self.low)
        return bool(self.low - beyond <= value <= self.high + beyond)


def shear_fraction(slip: float, length: float, modulus: float) -> float:
    """Mean of 1 - exp(-j/K) under a track of ``length``, m, whose shear j grows by slip x way."""
    if slip <= 0.0:
        return 0.0
    x = slip * length / modulus
    return 1.0 + math.expm1(-x) / x


def traction(soil: Soil, load: float, area: float, length: float, slip: float) -> float:
    """Thrust of tracks, N: strength of the soil under ``load``, N, on ``area``, m2, by the mobilised part."""
    return (soil.cohesion * area + load * soil.tan) * shear_fraction(slip, length, soil.K)


def compaction_resistance(soil: Soil, pressure: float) -> float:
    """Resistance of a track with uniform ``pressure``, Pa, by compaction, N: work of the first loading by its width."""
    return soil.width * work_of_pressure(soil, pressure)


def centre_of_mass(vehicle: VehicleTable) -> tuple[float, float]:
    """Place x, z, m, of the centre of mass as drawn; tracks count in the middle between sprocket, idlers and wheels."""
    v, wheels = vehicle, smooth_wheels(vehicle.model_dump())
    bends = [np.zeros(2), *(np.array([wheel["x"], wheel["z"]]) for wheel in wheels if wheel["kind"] in BENDS)]
    road = [np.array([wheel["x"], wheel["z"]]) for wheel in wheels if wheel["kind"] == "road_wheel"]
    parts = [(v.chassis.mass, np.array([v.chassis.centre[0], v.chassis.centre[2]])), (2.0 * v.sprocket.mass, bends[0])]
    parts += [(2.0 * wheel["mass"], np.array([wheel["x"], wheel["z"]])) for wheel in wheels]
    arms = zip(road, road_arms(vehicle.model_dump()), strict=False)
    parts += [(2.0 * arm["mass"], place + np.array(arm["pivot"]) / 2.0) for place, arm in arms]
    parts.append((2.0 * v.track.links * v.track.mass, np.mean([*bends, np.mean(road, axis=0)], axis=0)))
    x, z = np.average([place for _, place in parts], axis=0, weights=[mass for mass, _ in parts])
    return float(x), float(z)


def ends(vehicle: VehicleTable) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Place x, z and radius, m, of the hindmost wheel of the chain and of its foremost one."""
    smooth = (wheel for wheel in smooth_wheels(vehicle.model_dump()) if wheel["kind"] in BENDS)
    places = [(0.0, 0.0, _sprocket_radius(vehicle)), *((wheel["x"], wheel["z"], wheel["radius"]) for wheel in smooth)]
    return min(places), max(places)


def _sprocket_radius(vehicle: VehicleTable) -> float:
    """Pitch radius less the chain's half thickness, m: as if a smooth wheel bore the links' faces."""
    return pitch_radius(vehicle.model_dump()) - vehicle.track.face


def passed_step(vehicle: VehicleTable, wheel: tuple[float, float, float]) -> float:
    """Highest step, m, whose edge the centre of mass passes while the vehicle stands on a hind ``wheel`` x, z, radius.

    The lower run of the chain lies on the edge; its line is below the wheels on level ground.
    """
    x, z = centre_of_mass(vehicle)
    thick = thickness(vehicle.track.model_dump())
    low = min(ground_wheels(vehicle.model_dump()), key=lambda wheel: wheel["z"] - wheel["radius"])
    h = z - low["z"] + low["radius"] + thick
    back, up, radius = x - wheel[0], wheel[1] - z, wheel[2] + thick
    pitch = np.linspace(0.0, 1.4, 2000)
    edge = -h / np.cos(pitch)
    ground = -back * np.sin(pitch) + up * np.cos(pitch) - radius
    return float((edge - ground).max())


def largest_step(vehicle: VehicleTable) -> Bracket:
    """Highest step, m, without slip: standing on the hindmost wheels on the ground, and on that of the chain."""
    last = ground_wheels(vehicle.model_dump())[-1]
    hind = (last["x"], last["z"], last["radius"]), ends(vehicle)[0]
    limits = [passed_step(vehicle, wheel) for wheel in hind]
    return Bracket(min(limits), max(limits))


def largest_gap(vehicle: VehicleTable) -> Bracket:
    """Widest gap, m: from the centre of mass to the outer wheels on the ground, and to the axles of both ends."""
    x, _ = centre_of_mass(vehicle)
    hind, front = ends(vehicle)
    wheels = ground_wheels(vehicle.model_dump())
    return Bracket(min(x - wheels[-1]["x"], wheels[0]["x"] - x), min(x - hind[0], front[0] - x))


def drawbar(vehicle: VehicleTable, soil: Soil, weight: float, slip: float) -> Bracket:
    """Bracket of the drawbar pull at a slip, N.

    Least: one link under each wheel on the ground bears, and shear begins anew at it; largest: both tracks bear and
    shear evenly between the outer wheels.
    """
    wheels, track = ground_wheels(vehicle.model_dump()), vehicle.track
    length = wheels[0]["x"] - wheels[-1]["x"]
    areas = [2.0 * track.width * part for part in (len(wheels) * track.pitch, length)]
    resistances = [2.0 * compaction_resistance(soil, weight / area) for area in areas]
    thrusts = [traction(soil, weight, *part, slip) for part in zip(areas, (track.pitch, length), strict=True)]
    return Bracket(thrusts[0] - resistances[0], thrusts[1] - resistances[1])
