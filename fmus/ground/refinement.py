"""How many contact points a link needs on a ground, so that no obstacle passes between them.

On level ground a link has two Gauss points along it and, where it is wide, two across: ``LEVEL``. A refinement of
(n, m) gives n times as many along it and m times as many across, at equal parts of the link. What a ground asks for is
the mean distance of points at which the rise of a wheel over it is within 5 % of that with many points: half a radius
of a half round, a quarter of a wave, the radius of an edge. It is measured in ``tests/test_obstacles.py``.

Each grouser of a link has as many points as its plate, the outer face; what is low and narrow passes between grousers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from math import ceil, inf
from typing import Any, NamedTuple

import numpy as np

from fmus.physics.arrays import Floats
from fmus.vehicles.sides import grousers

LEVEL = (1, 1)
MAX_AUTOMATIC = (8, 4)  # that is chosen by itself: the cost of a step grows with the points
BUMP = "bump.radius"
LOWEST_PEAK = 5e-3  # of a map of heights that counts, m
Table = Mapping[str, Any]


class Feature(NamedTuple):
    """Narrowest part of a primitive of the ground."""

    key: str  # of the number, under ``ground``
    what: str
    length: float  # its own, m
    along: float  # largest mean distance of points along x, m
    across: float  # and along y, m


def refinement(ground: Table, track: Table, heading: float | None) -> tuple[int, int]:
    """Refinement for the links of a vehicle's ``track`` on a ``ground``: its own, or as its features ask.

    Features get MAX_AUTOMATIC at most. ``heading``, rad: of a vehicle that keeps it; None of one that turns.
    """
    if ground.get("refinement"):
        return tuple(ground["refinement"])
    along, across = LEVEL
    for feature in features(ground, track["pitch"]):
        a, b = _distances(feature, heading)
        along = max(along, ceil(0.5 * track["pitch"] / a - 1e-9))
        across = max(across, ceil(0.5 * track["width"] / b - 1e-9))
    return min(along, MAX_AUTOMATIC[0]), min(across, MAX_AUTOMATIC[1])


def sections(track: Table, refined: Sequence[int] | None, hard: bool) -> Floats:
    """Sections (k, 7) of a link with contact points: of its grousers, then of its plate; columns: ``contact.grounds``.

    On ``hard`` ground its grousers have the whole stiffness of a link, on soil the part of its area that they cover.
    The plate has the rest of the area, evenly over the link.
    """
    from fmus.physics.contact.wheel import GAUSS  # kernels

    (along, across), bar, count = refined or LEVEL, grousers(track), grousers(track)["count"]
    length, covered = bar["length"] / track["pitch"], bar["length"] / track["pitch"] * (bar["width"] / track["width"])
    begins = [(k + 0.5) / count - 0.5 * length for k in range(count)]
    faces = [(begin, length, bar["width"], bar["height"], 1.0 / count if hard else covered) for begin in begins]
    if (rest := 1.0 - count * covered) > 1e-9:
        faces.append((0.0, 1.0, track["width"], 0.0, rest))
    part, rows = 0.5 / (along * across), product(faces, range(along), (-1.0, 1.0), range(across))
    return np.array([
        (begin + size * ((k + 0.5 + half * GAUSS) / along), 0.25 * width * (2 * strip + 1) / across, height,
         share * part, size * (half * (0.25 - GAUSS) / along), size * (0.25 / along), part * along * width)
        for (begin, size, width, height, share), k, half, strip in rows
    ])  # fmt: skip


def gaps(track: Table, refined: tuple[int, int]) -> tuple[float, float]:
    """Largest distances of neighbouring points of a link, or of one of its grousers, along it and across, m."""
    from fmus.physics.contact.wheel import GAUSS  # kernels

    return 2.0 * GAUSS * grousers(track)["length"] / refined[0], 0.5 * grousers(track)["width"] / refined[1]


def passed_over(ground: Table, track: Table, heading: float | None) -> list[str]:
    """One sentence for each feature of the ground that is narrower than the points of a link allow."""
    refined = refinement(ground, track, heading)
    (gap, side), sentences, what = gaps(track, refined), [], "grouser" if track.get("grouser") else "link"
    for feature in features(ground, track["pitch"]):
        a, b = _distances(feature, heading)
        if max(0.5 * grousers(track)["length"] / refined[0] / a, side / b) > 1.0 + 1e-9:
            sentences.append(
                f"ground.{feature.key}: {feature.what} of {feature.length:.3g} m may pass between the contact points of"
                f" a {what}, which are up to {gap:.3g} m apart along it and {side:.3g} m across;"
                f" ground.refinement = [{refined[0]}, {refined[1]}] may be larger"
            )
    return sentences


def features(ground: Table, pitch: float) -> Iterator[Feature]:
    """Yield the narrowest feature of each primitive of a ``ground`` table under links of ``pitch`` m."""
    if one := ground.get("half_round"):
        yield Feature("half_round.radius", "half rounds with a width", 2.0 * one["radius"], 0.5 * one["radius"], inf)
    for key in ("bump", "step", "trench"):
        if one := ground.get(key):
            yield Feature(f"{key}.radius", "edges with a radius", one["radius"], one["radius"], inf)
    if one := ground.get("kerb"):
        yield Feature("kerb.radius", "edges with a radius", one["radius"], inf, one["radius"])
    if one := ground.get("washboard"):
        yield Feature("washboard.wavelength", "waves", one["wavelength"], 0.25 * one["wavelength"], inf)
    if one := ground.get("rough"):
        wave = 1.0 / one["band"][1]
        yield Feature("rough.band", "waves", wave, 0.25 * wave, 0.25 * wave if one["isotropic"] else inf)
    if one := ground.get("heightmap"):
        heights = np.asarray(one["heights"], dtype=float)
        x, y = (_narrowest_peak(each, d, pitch) for each, d in zip((heights, heights.T), one["spacing"], strict=True))
        if min(x, y) < inf:
            yield Feature("heightmap.heights", "peaks with a width", min(x, y), 0.25 * x, 0.25 * y)


def _distances(feature: Feature, heading: float | None) -> tuple[float, float]:
    """Largest mean distances of points along and across a vehicle with this ``heading``, rad, or with any; m."""
    x, y = feature.along, feature.across
    if heading is None:
        return min(x, y), min(x, y)
    if heading == 0.0 or feature.key == BUMP:  # a bump lies ahead of the start
        return x, y
    from fmus.physics.elementary import cos, sin  # kernels

    c, s = max(abs(cos(heading)), 1e-9), max(abs(sin(heading)), 1e-9)
    return min(x / c, y / s), min(x / s, y / c)


def _narrowest_peak(heights: Floats, spacing: float, reach: float) -> float:
    """Least width of the peaks of a map along its first axis, m; inf without peaks.

    A peak counts if it stands LOWEST_PEAK above lower ground within ``reach`` m on both sides. Its width is that of a
    parabola with its height over the higher of both and its curvature.
    """
    from scipy.ndimage import minimum_filter1d

    half = ceil(0.5 * reach / spacing)
    before, after = (minimum_filter1d(heights, 2 * half + 1, 0, mode="nearest", origin=at) for at in (half, -half))
    rise, bend = (heights - np.maximum(before, after))[1:-1], 2.0 * heights[1:-1] - heights[:-2] - heights[2:]
    peaks = (rise >= LOWEST_PEAK) & (heights[1:-1] >= np.maximum(heights[:-2], heights[2:]))
    return float(2.0 * spacing * np.sqrt(2.0 * rise[peaks] / bend[peaks]).min()) if peaks.any() else inf
