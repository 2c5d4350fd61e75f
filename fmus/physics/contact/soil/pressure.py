"""Pressure of soil over sinkage: Bekker's first loading, Wong's repeated loading.

First loading p = (kc / b + kphi) z^n (Bekker, Introduction to Terrain-Vehicle Systems, 1969). Unloading and reloading
below the deepest sinkage z_u, where the pressure was p_u, are linear: p = p_u - k_u (z_u - z), never tension, with
k_u = k0 + Au z_u (Wong, Theory of Ground Vehicles).

Deviations. k_u is at least ``secant`` p_u / z_u: with a smaller one, as published ones are at high pressure, the ground
would rise above its old level, or give back more than was put in. For n < 1 the first slope is infinite; there the
first loading follows a straight line of the slope ``elastic`` until it meets the curve.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kernels.jit import kernel
from fmus.physics.elementary import power

if TYPE_CHECKING:
    from fmus.physics.contact.soil.parameters import Soil


@kernel
def first_loading(soil: Soil, z: float) -> tuple[float, float]:
    """Pressure, Pa, at the sinkage ``z``, m, that was never reached before, and its slope, Pa/m."""
    if z <= 0.0:
        return 0.0, 0.0
    if z < soil.elastic_depth:
        return soil.elastic * z, soil.elastic
    p = soil.stiffness * power(z, soil.n)
    return p, soil.n * p / z


@kernel
def unloading_slope(soil: Soil, deepest: float) -> float:
    """Slope k_u of unloading from the sinkage ``deepest`` > 0, m, Pa/m."""
    return _unloading(soil, deepest, first_loading(soil, deepest)[0])


@kernel
def _unloading(soil: Soil, deepest: float, p: float) -> float:
    """``unloading_slope`` where the pressure at the deepest sinkage is ``p``, Pa."""
    return max(soil.k0 + soil.Au * deepest, soil.secant * p / deepest)


@kernel
def pressure(soil: Soil, deepest: float, z: float) -> tuple[float, float, float]:
    """Pressure, Pa, at the sinkage ``z`` > 0, m, its slope, Pa/m, and the elastic energy, J/m2.

    ``deepest``, m, is the deepest sinkage so far; all are 0 where the soil is not touched.
    """
    if z < deepest:
        return reloading(soil, deepest, first_loading(soil, deepest)[0], z)
    p, slope = first_loading(soil, z)
    return p, slope, 0.5 * p * p / _unloading(soil, z, p)


@kernel
def reloading(soil: Soil, deepest: float, most: float, z: float) -> tuple[float, float, float]:
    """``pressure`` below the sinkage ``deepest``, m, where the pressure was ``most``, Pa."""
    k = _unloading(soil, deepest, most)
    p = most - k * (deepest - z)
    if p <= 0.0:
        return 0.0, 0.0, 0.0
    return p, k, 0.5 * p * p / k


@kernel
def print_left(soil: Soil, deepest: float, most: float, z: float) -> float:
    """Part of its print that a link has not left: from 1 where contact ends to 0 an elastic rebound p_u / k_u higher.

    Arguments as of ``reloading``.
    """
    return min(max(2.0 - _unloading(soil, deepest, most) * (deepest - z) / most, 0.0), 1.0)


@kernel
def first_work(soil: Soil, z: float) -> float:
    """Work of the first loading up to the sinkage ``z``, m, J/m2."""
    if z <= 0.0:
        return 0.0
    straight = soil.elastic_depth
    if z <= straight:
        return 0.5 * soil.elastic * z * z
    n = soil.n + 1.0
    work = soil.stiffness * power(z, n) / n
    if straight > 0.0:
        work += 0.5 * soil.elastic * straight * straight - soil.stiffness * power(straight, n) / n
    return work


@kernel
def compaction(soil: Soil, deepest: float) -> float:
    """Work, J/m2, that a loading to the sinkage ``deepest``, m, and unloading have left in the soil."""
    if deepest <= 0.0:
        return 0.0
    p, _ = first_loading(soil, deepest)
    return first_work(soil, deepest) - 0.5 * p * p / _unloading(soil, deepest, p)
