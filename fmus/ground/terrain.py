"""Ground beyond level and bump: from the plain table ``ground`` of a scene or configuration to a ``Terrain``.

Keys and units (SI) are those of ``fmus.ground.tables``; a missing key and None mean the same. The frame
of the ground has the axes of the world and its origin, but z = 0 is the level part.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fmus.ground.roughness import rough_ground
from fmus.kernels.jit import plain
from fmus.physics.arrays import Floats
from fmus.physics.contact.terrain.heightmap import HeightMap, height_map
from fmus.physics.contact.terrain.heights import EVERYWHERE
from fmus.physics.contact.terrain.plane import Plane
from fmus.physics.contact.terrain.profile import TOP, Obstacle, Z, bump, half_round, profile, step
from fmus.physics.contact.terrain.rough import Rough
from fmus.physics.contact.terrain.shape import REGION, Kerb, Terrain, fill_heights
from fmus.physics.contact.terrain.washboard import Washboard
from fmus.start import FRAME, LEVEL, StartPose, lay_frame

BLEND = 0.5  # m: between the tracks of a vehicle

Table = Mapping[str, Any]


def terrain(ground: Table) -> Terrain:
    """Terrain of a ``ground`` table, with the frame of the ground.

    Raises ValueError for obstacles that overlap, edges too round for a bump and a period too short for the band.
    """
    waves = ground.get("washboard")
    return Terrain(
        LEVEL.copy(),
        _plane(ground),
        obstacles_profile(ground),
        _kerb(ground.get("kerb")),
        Washboard(**_given(waves)) if waves else Washboard(),
        rough_ground(one) if (one := ground.get("rough")) else Rough(np.zeros((0, 4)), np.zeros((0, 2))),
        _heightmap(ground.get("heightmap")),
        BLEND,
        _regions(ground.get("friction") or ()),
    )


def terrain_at(ground: Table, pose: StartPose, lateral: float) -> Terrain:
    """Terrain of a ``ground`` table in the frame of a component at the start, ``lateral`` m left of the vehicle's.

    The ground's frame is the world's, but for the height ``level`` of its level part, m.
    """
    frame = np.zeros(FRAME)
    plain(lay_frame)(pose, 0.0, lateral, 0.0, frame)
    frame[2] -= ground["level"]
    return terrain(ground)._replace(frame=frame)


def heights(ground: Table, x: ArrayLike, y: ArrayLike) -> Floats:
    """Heights of the ground at the points ``x``, ``y``, m (of one shape, or one number), over its level part."""
    return heights_of(terrain(ground), x, y)


def heights_of(shape: Terrain, x: ArrayLike, y: ArrayLike) -> Floats:
    """As ``heights``, of a terrain that is made already."""
    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    out = np.empty(x.size)
    fill_heights(shape, x.ravel(), y.ravel(), out)
    return out.reshape(x.shape)


def _given(table: Table) -> dict[str, Any]:
    return {key: value for key, value in table.items() if value is not None}


def _plane(ground: Table) -> Plane:
    grade, bank = float(ground.get("grade") or 0.0), float(ground.get("bank") or 0.0)
    return Plane(grade, bank, _start(ground, "incline_start"), float(ground.get("incline_length") or 1.0))


def obstacles_profile(ground: Table) -> Floats:
    """Profile of the obstacles across the way, see ``profile.profile``; ValueError for those that overlap."""
    obstacles: list[Obstacle] = []
    if one := ground.get("bump"):
        obstacles.append(bump(**one))  # edges too round for it are refused there
    if one := ground.get("step"):
        obstacles += [step("step", x, one["rise"], one["radius"]) for x in one["x"]]
    if one := ground.get("half_round"):
        obstacles += [half_round("half_round", x, one["radius"], one["fillet"]) for x in one["x"]]
    if one := ground.get("trench"):
        start, end = one["start"], one["start"] + one["width"]
        obstacles.append(step("trench", start, -one["depth"], one["radius"]))
        obstacles.append(step("trench", end, one["depth"], one["radius"]))
    return profile(obstacles)


def _kerb(table: Table | None) -> Kerb:
    """Kerb from its table: beyond y, seen from the middle, the ground is higher by its rise."""
    if not table:
        return Kerb(profile(()))
    y, rise = table["y"], table["rise"]
    row = profile([step("kerb", y, rise if y >= 0.0 else -rise, table["radius"])])
    if y < 0.0:  # 0 is the height of the middle
        row[:, [Z, TOP]] += rise
    return Kerb(row, _start(table), float(table.get("length") or 1.0))


def _heightmap(table: Table | None) -> HeightMap:
    if not table:
        return HeightMap(np.zeros((0, 0)), np.zeros((0, 0)))
    made = height_map(np.array(table["heights"], dtype=float), table["corner"], table["spacing"])
    return made._replace(start=_start(table), length=float(table.get("length") or 1.0))


def _start(table: Table, key: str = "start") -> float:
    """Beginning along x, or EVERYWHERE."""
    return EVERYWHERE if table.get(key) is None else float(table[key])


def _regions(regions: Any) -> Floats:
    """Rows of regions of friction."""
    rows = []
    for each in regions:
        factor, value = each.get("factor"), each.get("coefficient")
        rows.append([*each["x"], *each["y"], *((0.0, value) if factor is None else (factor, 0.0))])
    return np.array(rows, dtype=float).reshape(-1, REGION)
