"""Soil under the points of links, from their recorded places alone, instant after instant.

Bekker's pressure k z^n, Wong's unloading, Janosi and Hanamoto's shear as the equation K dm/ds = d - m, Mohr and
Coulomb's strength: ``fmus/physics/README.md``. The soil is level, and damping 0. Each point keeps its
deepest sinkage while it is below the surface, reads it from the rut as it goes below, and presses its part of the link
into the rut as it leaves. A point that lifts off loses its shear over the height of the elastic rebound.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from mirror.record import Floats

CELL = 0.05  # m
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


class Law:
    """Pressure, energies and strength of a soil."""

    def __init__(self, table: Mapping[str, Any], track_width: float) -> None:
        assert not table["damping"]
        self.n, self.K, self.c = table["n"], table["shear_deformation_modulus"], table["cohesion"]
        self.k = table["kc"] / (table["width"] or track_width) + table["kphi"]
        self.k0, self.Au, self.rebound = table["k0"], table["Au"], table["rebound"]
        self.elastic, self.tan = table["elastic"], np.tan(table["friction_angle"])

    def first(self, z: Floats) -> Floats:
        """Pressure at a sinkage that was never reached before, Pa."""
        curve = self.k * z**self.n
        return np.minimum(curve, self.elastic * z) if self.n < 1.0 else curve

    def unloading(self, deepest: Floats) -> Floats:
        """Slope of unloading from the deepest sinkage, Pa/m."""
        least = max(1.0, self.n) if self.rebound is None else 1.0 / self.rebound
        deepest = np.maximum(deepest, 1e-300)
        return np.maximum(self.k0 + self.Au * deepest, least * self.first(deepest) / deepest)

    def pressure(self, deepest: Floats, z: Floats) -> Floats:
        """Pressure at the sinkage z where the deepest is that or more, Pa."""
        return np.maximum(self.first(deepest) - self.unloading(deepest) * (deepest - z), 0.0)

    def compaction(self, deepest: Floats) -> Floats:
        """Work of first loading and unloading, J/m2, by quadrature of Bekker's pressure over z = u^4."""
        ends = deepest[:, None] ** 0.25
        u = 0.5 * ends * (1.0 + NODES)
        loading = (0.5 * ends * WEIGHTS * 4.0 * u**3 * self.first(u**4)).sum(1)
        return loading - 0.5 * self.first(deepest) ** 2 / self.unloading(deepest)

    def strength(self, pressure: Floats) -> Floats:
        """Shear strength, Pa; none without pressure."""
        return np.where(pressure > 0.0, self.c + self.tan * pressure, 0.0)

    def lifted(self, m: Floats, deepest: Floats, z: Floats) -> Floats:
        """Mobilised shear (p, 3) limited by the height of the link over the soil, over that of the elastic rebound."""
        rebound = self.first(deepest) / self.unloading(deepest)
        height = np.divide(deepest - rebound - z, rebound, out=np.zeros_like(z), where=rebound > 0.0)
        length = np.maximum(np.linalg.norm(m, axis=1), 1e-300)
        return m * np.minimum(np.clip(1.0 - height, 0.0, 1.0) / length, 1.0)[:, None]

    def mobilised(self, m: Floats, way: Floats) -> tuple[Floats, Floats]:
        """Mobilised shear (p, 3) after a straight way (p, 3), and its work by quadrature over the strength, m."""
        r = np.linalg.norm(way, axis=1, keepdims=True)
        d = way / np.where(r > 0.0, r, 1.0)
        s = 0.5 * r * (1.0 + NODES)
        along = ((m - d) * d).sum(1, keepdims=True) * np.exp(-s / self.K) + (d * d).sum(1, keepdims=True)
        after = np.where(r > 0.0, d + (m - d) * np.exp(-r / self.K), m)
        return after, (0.5 * r * WEIGHTS * along).sum(1)


class Points(NamedTuple):
    """Points of all links at all instants, in axes with z along the soil's normal: p points."""

    place: Floats  # (T, p, 3) m
    depth: Floats  # (T, p) m below the undisturbed soil
    along: Floats  # (T, p, 2) from the first to the last pin of the link, horizontal, m
    part: Sequence[float]  # (p) from the point to the middle of its part of the link, of ``along``
    area: Sequence[float]  # (p) of each point, m2
    half: Sequence[tuple[float, float]]  # (p) half of the part of each point: along, of the link, and across, m


class Soft(NamedTuple):
    """Response of the soil at the points."""

    normal: Floats  # (T, p) N
    shear: Floats  # (T, p, 3) N on the link
    stored: Floats  # (T, p) J
    compacted: Floats  # (T) J lost by compaction in the step that ends here
    sheared: Floats  # (T) J lost by shear


def march(law: Law, points: Points) -> Soft:
    """Forces, energies and losses at all instants; the soil is untouched at the first."""
    T, p = points.depth.shape
    area = np.asarray(points.area)
    found = Soft(np.zeros((T, p)), np.zeros((T, p, 3)), np.zeros((T, p)), np.zeros(T), np.zeros(T))
    rut: dict[tuple[int, int], float] = defaultdict(float)
    deepest, pressure, m, place = np.zeros(p), np.zeros(p), np.zeros((p, 3)), np.zeros((p, 3))
    along, inside = np.zeros((p, 2)), np.zeros(p, bool)
    for t in range(T):
        z, now = np.maximum(points.depth[t], 0.0), points.depth[t] > 0.0
        cells = [(int(a), int(b)) for a, b in np.floor(points.place[t, :, :2] / CELL)]
        before = np.where(inside, deepest, [rut.get(cell, 0.0) for cell in cells])
        reached = np.maximum(before, z)
        pressed = np.where(now, law.pressure(reached, z), 0.0)
        bears = pressed > 0.0
        held = bears & inside & (pressure > 0.0)
        way = np.where(held[:, None], points.place[t] - place, 0.0) * (1.0, 1.0, 0.0)
        after, work = law.mobilised(m, way)
        after = np.where(bears[:, None], after, law.lifted(m, reached, z)) * now[:, None]
        old, new = (law.strength(each) for each in (pressure, pressed))
        spring = [0.5 * law.K * s * (each**2).sum(1) for s, each in ((old, m), (new, after))]
        if t:
            grown = np.where(now & (reached > before), law.compaction(reached) - law.compaction(before), 0.0)
            found.compacted[t] = (area * grown).sum()
            found.sheared[t] = (area * (0.5 * (old + new) * np.where(bears, work, 0.0) + spring[0] - spring[1])).sum()
        found.normal[t], found.shear[t] = area * pressed, -(area * new)[:, None] * after
        found.stored[t] = area * (0.5 * pressed**2 / law.unloading(reached) + spring[1])
        for k in np.flatnonzero(inside & ~now):
            _press(rut, place[k, :2] + points.part[k] * along[k], along[k], points.half[k], deepest[k])
        place[bears], along[bears] = points.place[t, bears], points.along[t, bears]
        along[~now] = 0.0  # a point that comes down again and never bears presses nothing
        deepest, pressure, m = np.where(now, reached, 0.0), pressed, after
        inside = now
    return found


def _press(rut: dict[tuple[int, int], float], middle: Floats, along: Floats, half: tuple, deepest: float) -> None:
    """Press a rectangle of these ``half`` sizes into the rut: the cells whose middles lie in it."""
    length = np.linalg.norm(along)
    if length == 0.0:  # it passed the surface into a rut, and never bore
        return
    e = along / length
    reach = half[0] * length, half[1]
    corner = np.floor((middle - sum(reach)) / CELL).astype(int)
    for i, j in np.ndindex(*(2 * int(np.ceil(sum(reach) / CELL)) + 2,) * 2):
        cell = int(corner[0] + i), int(corner[1] + j)
        x, y = CELL * (np.array(cell) + 0.5) - middle
        if abs(e[0] * x + e[1] * y) <= reach[0] and abs(e[0] * y - e[1] * x) <= reach[1]:
            rut[cell] = max(rut[cell], deepest)
