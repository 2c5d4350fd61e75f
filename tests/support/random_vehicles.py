"""Random vehicles: links, teeth, pitch, wheels, mass and tension; all that belongs to a size is the m113's, scaled."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import scipy

from fmus.vehicles.vehicle import read_table, vehicle

SEED, COUNT = 64, 100
M113 = vehicle(*read_table("m113")).model_dump(mode="json", exclude_none=True)
LENGTHS = ("lateral", "pitch", "face", "width", "pin_radius", "seat_clearance", "tip_radius", "clearance", "travel")


def random_vehicle(k: int) -> dict[str, Any]:
    """Table of vehicle ``k``: 30 to 120 links of 60 to 220 mm, 8 to 17 teeth, a tension of 1 to 20 % of the weight."""
    rng = np.random.default_rng([SEED, k])

    def about(low: float, high: float) -> float:
        return float(math.exp(rng.uniform(math.log(low), math.log(high))))

    table = copy.deepcopy(M113)
    links, teeth, pitch = int(rng.integers(30, 121)), int(rng.integers(8, 18)), float(rng.uniform(0.06, 0.22))
    size, wheels = pitch / M113["track"]["pitch"], int(rng.integers(2, 9))
    heavy = size**2 * links / M113["track"]["links"] * about(0.6, 1.6)
    for part in table.values():
        if isinstance(part, dict):
            _scale(part, size, heavy)
    tooth = table["sprocket"]
    radius = pitch / (2.0 * math.sin(math.pi / teeth))
    height = M113["sprocket"]["outer_radius"] - 0.5 * M113["track"]["pitch"] / math.sin(math.pi / 10)
    tooth |= {"teeth": teeth, "outer_radius": radius + height * size}
    table["chassis"]["hull"] = [[size * x for x in point] for point in M113["chassis"]["hull"]]
    link = size**2 * about(0.6, 1.6)
    table["track"] |= {
        "links": links, "mass": link * M113["track"]["mass"],
        "inertia": [link * size**2 * inertia for inertia in M113["track"]["inertia"]],
    }  # fmt: skip
    for key in ("area", "bending", "lateral_bending", "torsion", "outer_fibre"):
        table["section"][key] *= size ** {"area": 2, "outer_fibre": 1}.get(key, 4)
    for pair in table["contact"].values():
        share = heavy * about(0.5, 2.0) * (5.0 / wheels if pair is table["contact"]["wheel"] else 1.0)
        pair |= {"stiffness": share * pair["stiffness"], "damping": share * pair["damping"]}
    face, forward = table["track"]["face"], float(rng.choice([-1.0, 1.0]))  # of the idler from the sprocket
    idler = radius * about(0.6, 1.1)
    table["idler"] |= {"radius": idler - face, "z": float(rng.uniform(-0.1, 0.1)) * radius}
    road = radius * about(0.4, 0.9)
    ground = -max(radius, idler) * float(rng.uniform(1.0, 1.4))
    table["road_wheel"] |= {"radius": road - face, "z": ground + road}
    rollers = int(rng.integers(0, 4))
    distance = scipy.optimize.brentq(
        lambda x: _belt(table, radius, x, wheels, rollers) - links * pitch, 0.1 * pitch, links * pitch
    )
    drawn = distance + pitch * float(rng.uniform(-0.15, 0.15))
    _place(table, distance, wheels, rollers, radius)
    for part in ("road_wheel", "return_roller"):
        if part in table:
            table[part]["x"] = sorted((forward * x for x in table[part]["x"]), reverse=True)
    table["idler"]["x"] = forward * drawn
    table["chassis"]["centre"] = [forward * 0.5 * distance, 0.0, 0.3 * radius]
    known = vehicle(table, f"random{k}")
    table["track"]["tension"] = round(about(0.01, 0.2) * known.total_mass() * known.gravity, 1)
    return table


def _scale(part: dict[str, Any], size: float, heavy: float) -> None:
    """Scale lengths, masses, inertias and springs of a table of parts in place."""
    for key, value in part.items():
        factor = 1.0
        if key in LENGTHS:
            factor = size
        elif key == "mass":
            factor = heavy
        elif key.endswith("inertia"):
            factor = heavy * size**2
        elif key in ("stiffness", "damping", "preload"):
            factor = heavy
        elif key in ("pivot", "on_arm", "on_chassis"):
            factor = size
        if factor != 1.0:
            part[key] = [factor * x for x in value] if isinstance(value, list) else factor * value


def _place(table: dict[str, Any], distance: float, wheels: int, rollers: int, radius: float) -> None:
    """Place road wheels and return rollers between a sprocket at 0 and an idler at ``distance``, m."""
    table["road_wheel"]["x"] = np.linspace(0.25 * distance, 0.78 * distance, wheels).tolist()
    if rollers:
        small = 0.3 * radius
        table["return_roller"] = {
            "mass": 0.02 * table["chassis"]["mass"], "spin_inertia": 0.1, "transverse_inertia": 0.1,
            "radius": small, "width": table["road_wheel"]["width"],
            "x": (distance * (np.arange(rollers) + 1.0) / (rollers + 1.0)).tolist(), "z": 0.75 * radius - small,
        }  # fmt: skip


def _belt(table: dict[str, Any], radius: float, distance: float, wheels: int, rollers: int) -> float:
    """Length of a belt, m, round the wheels with the idler at ``distance``, m."""
    _place(table, distance, wheels, rollers, radius)
    face = table["track"]["face"]
    circles = [(0.0, 0.0, radius), (distance, table["idler"]["z"], table["idler"]["radius"] + face)]
    for part in ("road_wheel", "return_roller"):
        if part in table:
            each = table[part]
            circles += [(x, each["z"], each["radius"] + face) for x in each["x"]]
    angle = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    points = np.array([(x + r * np.cos(angle), z + r * np.sin(angle)) for x, z, r in circles])
    return float(scipy.spatial.ConvexHull(points.transpose(0, 2, 1).reshape(-1, 2)).area)
