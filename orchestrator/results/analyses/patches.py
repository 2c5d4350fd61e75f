"""Contact patches of wheels: length and depth of the links' inner faces inside a rim.

A face is taken as straight from pin to pin, offset inwards from the pins (``track.face`` of the vehicle table). Faces
of flexible links bend, which changes the depth by a few per cent.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull
from orchestrator.results.run_data import EVER, RunData, Window, means
from orchestrator.results.table import Table
from orchestrator.results.views.bodies import EVERY, Bodies

GAUSS = 0.5 / np.sqrt(3.0)  # offset of the two Gauss points on a unit interval from its middle


class Patches(NamedTuple):
    """Contact patch of each wheel at each link record."""

    wheels: tuple[str, ...]  # "left_track.road_wheel[1]"
    t: Floats  # (m,) s
    length: Floats  # (m, wheels) m, along the chain
    depth: Floats  # (m, wheels) m, mean over the patch; 0 without contact
    links: Floats  # (m, wheels) number of links in contact

    def table(self) -> Table:
        """Table with a row for each wheel over the records of the window."""
        values = (
            1e3 * means(self.t, self.length), 1e3 * self.length.max(axis=0), 1e3 * means(self.t, self.depth),
            1e3 * self.depth.max(axis=0), means(self.t, self.links),
        )  # fmt: skip
        columns = (
            ("wheel", ""), ("length", "mm"), ("longest", "mm"), ("depth", "mm"), ("deepest", "mm"), ("links", ""),
        )  # fmt: skip
        rows = list(zip(self.wheels, *(each.tolist() for each in values), strict=True))
        title = "Contact patches: links inside the rims of wheels; length, depth and links are means over time"
        return Table.of(title, columns, rows)


def patch(pins: Floats, normals: Floats, centre: Floats, radius: float, face: float) -> tuple[Floats, Floats]:
    """Length of each link's inner face inside a rim (m, links), m, and its mean depth (m, links), m.

    ``pins`` (m, nodes, 3), as many nodes as links in a closed chain; ``normals`` (m, links, 3) of the faces,
    outwards; ``centre`` (m, 3) of the wheel. Stiffness times length over pitch times depth is the force of a linear
    contact (``fmus/physics/contact/wheel.py``: two Gauss points).
    """
    links = normals.shape[1]
    along = np.roll(pins, -1, axis=1)[:, :links] - pins[:, :links]
    pitch = np.linalg.norm(along, axis=2)
    to = centre[:, None] - pins[:, :links]
    foot = np.einsum("mnk,mnk->mn", to, along) / pitch
    height = -np.einsum("mnk,mnk->mn", to, normals) - face
    half = np.sqrt(np.maximum(radius * radius - height * height, 0.0)) * (height > 0.0)
    low, high = (np.clip(foot + side * half, 0.0, pitch) for side in (-1.0, 1.0))
    length = high - low
    points = (0.5 * (low + high) + side * GAUSS * length - foot for side in (-1.0, 1.0))
    depth = radius - 0.5 * sum(np.hypot(height, point) for point in points)
    return length, np.where(length > 0.0, depth, 0.0)


def of(run: RunData, track: str = "", window: Window = EVER) -> Patches:
    """Contact patches of the smooth wheels of all tracks or one; raises Missing."""
    bodies, tracks = Bodies(run, EVERY, window=window), hull.tracks(run, track)
    wheels = [wheel for wheel in bodies.wheels if wheel.kind != "sprocket" and wheel.track in tracks]
    if not wheels or not bodies.tracks:
        raise Missing(f"{run.log.path} holds no links on wheels")
    face = hull.vehicle_number(run, "track", "face")
    parts, times = [], []
    for poses in bodies.blocks():
        times.append(poses.t)
        found = np.zeros((3, len(poses.t), len(wheels)))
        for k, wheel in enumerate(wheels):
            links = poses.links[wheel.track]
            centre = poses.wheels[wheel.name].position
            length, depth = patch(links.pins, links.axes[..., 2], centre, wheel.radius, face)
            whole = length.sum(axis=1)
            found[:, :, k] = (
                whole,
                (length * depth).sum(axis=1) / np.where(whole, whole, 1.0),
                (length > 0.0).sum(axis=1),
            )
        parts.append(found)
    names = tuple(wheel.name.replace("/", ".") for wheel in wheels)
    return Patches(names, np.concatenate(times), *np.concatenate(parts, axis=1))
