"""Road profiles and rough surfaces of ISO 8608 from a seed, with the same bits on every machine.

ISO 8608:2016, Mechanical vibration, Road surface profiles: the displacement power spectral density is
Gd(n) = Gd(n0) (n/n0)^-2 over the spatial frequency n, n0 = 0.1 cycles/m; Gd(n0) of class A is 16e-6 m^3, of each
further class four times that of the last. A profile of the period P is the sum of
sqrt(2 Gd(n_k)/P) cos(2 pi n_k x + phase_k) over n_k = k/P within the band, so that its periodogram over one period is
Gd(n_k) exactly. The phases are uniform: the upper 53 bits of the raw numbers of numpy's PCG64 (O'Neill 2014), whose
stream is fixed for a seed.

An isotropic surface is the sum of profiles along DIRECTIONS equal angles, from a random one on. A line at the angle a
to a profile of the frequency v has n = v |cos a|, so that G(n) = 2/pi int_n^H g(v)/sqrt(v^2 - n^2) dv, g of all
profiles together. It is Gd(n) up to the end H of the band if (Abel) g(v) = Gd(v) (b + cot b), cos b = v/H, whose
integral is -Gd(v) v b. A line crosses long waves askew, has them below the band, and b = pi/2 times the variance.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.kernels.jit import kernel
from fmus.physics.arrays import Floats, Integers
from fmus.physics.contact.terrain.heights import EVERYWHERE
from fmus.physics.contact.terrain.rough import Rough
from fmus.physics.elementary import PI, acos, cos, of_each, sin

CLASSES = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6, "E": 4096e-6, "F": 0.016384, "G": 0.065536, "H": 0.262144}
REFERENCE = 0.1  # n0, cycles/m; above, Gd(n0), m^3
DIRECTIONS = 16  # the density along any line is within 0.4 % of the mean, within 5 % near the end of the band
NODES_A_WAVE = 16  # of the shortest wave; the splines between them are wrong by 3e-4 of its amplitude


def spectral_density(iso_class: str, n: Floats) -> Floats:
    """Displacement power spectral density Gd, m^3, of a class at the spatial frequencies ``n``, cycles/m."""
    return CLASSES[iso_class] * (REFERENCE / n) ** 2


def rough_ground(table: Mapping[str, Any]) -> Rough:
    """Rough ground of a table ``ground.rough`` (``fmus.ground.tables``).

    Raises ValueError for a period without a frequency of the band.
    """
    period, (low, high), sides = float(table["period"]), table["band"], 1 if table["correlated"] else 2
    if isotropic := bool(table.get("isotropic")):
        sides = DIRECTIONS
    k = np.arange(1, int(period * high) + 2)
    k = k[(k >= low * period) & (k <= high * period)]
    if not len(k):
        raise ValueError(
            f"no frequency k / {period:g} m is between {low:g} and {high:g} cycles/m: take a longer period"
        )
    size = 4 * (int(k[-1] * NODES_A_WAVE) // 4 + 1)
    spacing = period / size
    amplitude = np.sqrt(2.0 * spectral_density(table["iso_class"], k / period) / period)
    generator, angles = np.random.PCG64(table["seed"]), np.zeros(0)
    phases = _angles(generator, sides * len(k)).reshape(sides, -1)
    if isotropic:
        ends = np.concatenate([[low], (k[:-1] + 0.5) / period, [high]])
        below = spectral_density(table["iso_class"], ends) * ends * of_each(acos, ends / high)
        amplitude = np.sqrt(2.0 * (below[:-1] - below[1:]) / DIRECTIONS)
        angles = (np.arange(DIRECTIONS) * PI + 0.5 * _angles(generator, 1)) / DIRECTIONS
    wave = of_each(cos, np.arange(float(size)) * (2.0 * PI / size))
    # the second derivative of a periodic cubic spline through samples of a cosine is a cosine times this number
    c = wave[k]
    bend = 6.0 * (c - 1.0) / ((2.0 + c) * spacing * spacing)
    nodes = np.zeros((size, 2 * sides))
    for side, phase in enumerate(phases):
        _add_waves(
            k, amplitude * of_each(cos, phase), amplitude * of_each(sin, phase), bend, wave, nodes[:, 2 * side :]
        )
    highest = nodes[:, ::2].max(axis=0) + 0.125 * spacing * spacing * np.abs(nodes[:, 1::2]).max(axis=0)
    directions = np.stack([of_each(cos, angles), of_each(sin, angles)], axis=1)
    start = EVERYWHERE if table.get("start") is None else float(table["start"])
    top = highest.sum() if isotropic else highest.max()
    return Rough(nodes, directions, spacing, float(top), start, float(table["length"]))


def _angles(generator: np.random.PCG64, count: int) -> Floats:
    """Uniform angles up to 2 pi."""
    return (generator.random_raw(count) >> np.uint64(11)).astype(np.float64) * (2.0 * PI / 2**53)


@kernel
def _add_waves(k: Integers, along: Floats, across: Floats, bend: Floats, wave: Floats, nodes: Floats) -> None:
    """Add waves of the numbers ``k`` (m) to heights and second derivatives, the first columns of ``nodes`` (n, _).

    ``along``, ``across``: their amplitudes times cosine and sine of their phases, m; ``wave`` (n): one wave.
    """
    n = len(wave)
    for j in range(len(k)):
        at = 0
        for i in range(n):
            behind = at - n // 4
            h = along[j] * wave[at] - across[j] * wave[behind if behind >= 0 else behind + n]
            nodes[i, 0] += h
            nodes[i, 1] += bend[j] * h
            at += k[j]
            if at >= n:
                at -= n
