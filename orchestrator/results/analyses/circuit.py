"""Places on the circuit of a closed chain, in metres along it.

The zero is fixed in the hull: the middle of the wrap on the sprocket, where the chain crosses the line from the
middle of the circuit through the sprocket axle (without a sprocket: the line ahead of the middle). Places grow with
the numbers of links: from a sprocket in front down to the ground, rearwards along it, and forwards along the upper
run; from one at the rear forwards along the upper run first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from fmus.vehicles.sides import ground_wheels, of_side, pitch_radius, smooth_wheels
from orchestrator.log.reader import Missing
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import hull, record_blocks
from orchestrator.results.run_data import EVER, RunData, Window, sprocket_end

NEAR = 0.06  # m: distance outside of a wheel's pitch circle within which the middle of a link lies on the wheel,
NEAR_SHORT = 0.4  # or of short links this share of their pitch


class PlacedRecords(NamedTuple):
    """Link records with their places."""

    t: Floats  # (m,) s
    since: Floats  # (m,) s, time since the record before
    length: Floats  # (m,) m, whole circuit
    links: Floats  # (m, links) m, middles of links
    joints: Floats  # (m, joints) m, pins
    centres: Floats  # (m, links, 2) m, middles of links ahead of and above the sprocket axle, in hull axes
    pins: Floats  # (m, joints, 3) m, world; define the axes of forces as in ``record_blocks.py``
    axes: Floats  # (m, 3, 3) columns ahead, left, up of the hull, in world
    values: tuple[Floats, ...]  # one per signal, (m, n) or (m, n, 3)
    track: str = ""

    def stretches(self, scene: dict[str, Any], k: int = 0) -> list[Stretch]:
        """Parts of the circuit in the k-th record (``stretches``)."""
        order = np.argsort(self.links[k])
        return stretches(scene, self.links[k, order], self.centres[k, order], self.track)


class Stretch(NamedTuple):
    """Part of the circuit, m."""

    start: float
    end: float
    name: str  # "sprocket", "lower run", "idler" or "upper run", of some vehicles others (``stretches``)

    @property
    def middle(self) -> float:
        """Place between both ends, m."""
        return 0.5 * (self.start + self.end)


def records(run: RunData, track: str, window: Window = EVER, *signals: str) -> Iterator[PlacedRecords]:
    """Signals of links with their places, in blocks; raises Missing, also for open chains."""
    ray: Floats | None = None
    middle = np.zeros(2)
    port, count = hull.sprocket(run, track), record_blocks.count(run, track)
    for block in record_blocks.records(run, track, window, record_blocks.POSITION, *signals):
        pins = block.values[0]
        if pins.shape[1] != count:
            raise Missing(f"{run.log.path}: of '{track}' {count} links between {pins.shape[1]} pins make no circuit")
        origin, axes = hull.poses(run, track, block.t)
        flat = np.einsum("mni,mij->mnj", pins - origin[:, None], axes[..., [0, 2]])
        if ray is None:
            inside = flat[0].mean(axis=0)
            ray, middle = (np.array([1.0, 0.0]), inside) if port is None else (-inside, middle)
        try:
            links, joints, length = places(flat - middle, ray)
        except ValueError as problem:
            raise Missing(f"{run.log.path}: '{track}' {problem} between {block.t[0]:g} and {block.t[-1]:g} s") from None
        centres = 0.5 * (flat + np.roll(flat, -1, axis=1))
        yield PlacedRecords(
            block.t, block.record_durations, length, links, joints, centres, block.pins, axes, block.values[1:], track
        )


def places(pins: Floats, ray: Floats) -> tuple[Floats, Floats, Floats]:
    """Places of the middles of links and of pins (m, n), and lengths (m,), of closed polygons (m, n, 2).

    The zero is the crossing of a polygon with the ray from the origin along ``ray`` (2,) that is next to the origin.
    Raises ValueError without a crossing.
    """
    after = np.roll(pins, -1, axis=1)
    sides = np.linalg.norm(after - pins, axis=2)
    along = np.cumsum(sides, axis=1) - sides  # of pins, from the first
    length = sides.sum(axis=1)
    offset = pins[..., 0] * ray[1] - pins[..., 1] * ray[0]
    next_offset = np.roll(offset, -1, axis=1)
    crosses = (offset <= 0.0) != (next_offset <= 0.0)
    share = np.where(crosses, offset / np.where(crosses, offset - next_offset, 1.0), 0.0)
    distance = (pins + share[..., None] * (after - pins)) @ ray
    candidates = np.where(crosses & (distance > 0.0), distance, np.inf)
    nearest = candidates.argmin(axis=1)
    row = np.arange(len(pins))
    if not np.isfinite(candidates[row, nearest]).all():
        raise ValueError("does not go round its sprocket")
    zero = along[row, nearest] + share[row, nearest] * sides[row, nearest]
    middle = along + 0.5 * sides
    return *(((distances - zero[:, None]) % length[:, None]) for distances in (middle, along)), length  # type: ignore[return-value]


def stretches(scene: dict[str, Any], place: Floats, middle: Floats, track: str = "") -> list[Stretch]:
    """Parts of the circuit by the scene's sprocket and idler; none without them.

    ``middle`` (links, 2) m: centres of the links ahead of and above the sprocket's axle. The idler touches the link
    farthest from the sprocket's end. With further wheels, at their places in the table, or with an elevated sprocket a
    part between two wheels has the names of both, "rear_idler to sprocket", but that on the ground "ground run". Of
    other tracks a part of a single link is left out.
    """
    try:
        vehicle = of_side(scene["vehicle"], track.removesuffix("_track"))
        end, near = sprocket_end(scene), min(NEAR, NEAR_SHORT * float(vehicle["track"]["pitch"]))
        wrap = pitch_radius(vehicle) + near
        radius = float(vehicle["idler"]["radius"]) + float(vehicle["track"]["face"])
        by_wheels = bool(ground_wheels(vehicle)) if vehicle.get("wheel") or not end else False
    except (AttributeError, LookupError, TypeError, ValueError):  # another scene, or a table of another version
        return []
    round_sprocket = np.linalg.norm(middle, axis=1) < wrap
    idler = middle[(end * middle[:, 0]).argmin()] + [end * radius, 0.0]
    round_idler = np.linalg.norm(middle - idler, axis=1) < radius + near
    level = 0.5 * (middle[:, 1].max() + middle[:, 1].min())
    runs = np.where(middle[:, 1] > level, "upper run", "lower run")
    names = np.where(round_sprocket, "sprocket", np.where(round_idler, "idler", runs))
    if by_wheels:
        names = _by_wheels(vehicle, middle, near, np.where(round_sprocket, "sprocket", "").astype(object))
    edges = [0, *(np.flatnonzero(names[1:] != names[:-1]) + 1), len(names)]
    half_pitch = 0.5 * float(np.median(np.diff(place))) if len(place) > 1 else 0.0
    return [
        Stretch(float(place[first] - half_pitch), float(place[last - 1] + half_pitch), str(names[first]))
        for first, last in pairwise(edges)
        if last - first > 1 or by_wheels
    ]


def _by_wheels(vehicle: Mapping[str, Any], middle: Floats, near: float, names: np.ndarray) -> np.ndarray:
    """Names (links,) of the parts of links by wheels; ``names``: "sprocket" for those on it, else empty."""
    for wheel in (each for each in smooth_wheels(vehicle) if each["kind"] in ("idler", "wheel")):
        distance = np.linalg.norm(middle - [wheel["x"], wheel["z"]], axis=1)
        names[(names == "") & (distance < wheel["radius"] + vehicle["track"]["face"] + near)] = wheel["name"]
    (front, rear), (x, z) = (ground_wheels(vehicle)[k] for k in (0, -1)), middle.T
    low = np.flatnonzero((names == "") & (rear["x"] < x) & (x < front["x"]) & (z < front["z"]))
    names[low] = np.where(2.0 * x[low] > front["x"] + rear["x"], front["name"], rear["name"])
    known = np.flatnonzero(names != "")
    for k in np.flatnonzero(names == "") if known.size else ():
        after = np.searchsorted(known, k) % known.size
        names[k] = " to ".join(dict.fromkeys(names[known[[after - 1, after]]]))
    names[low] = "ground run"
    return names


def part(place: float, parts: Sequence[Stretch]) -> str:
    """Name of the part of the circuit that contains a place, m; empty if none does."""
    return next((stretch.name for stretch in parts if stretch.start <= place <= stretch.end), "")
