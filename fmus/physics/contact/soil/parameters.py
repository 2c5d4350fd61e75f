"""Parameters of a soil under the links of one track."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from fmus.kernels.jit import implemented_in, kernel
from fmus.physics.elementary import cos, power, sin

OPTIONAL: dict[str, Any] = {"k0": 0.0, "Au": 0.0, "rebound": None, "elastic": 0.0, "damping": 0.0, "width": None}


@implemented_in(ground=".force")
class Soil(NamedTuple):
    """Parameters of a soil; see ``pressure`` and ``shear``."""

    stiffness: float  # kc / b + kphi, Pa/m^n
    n: float  # exponent of the sinkage
    elastic: float  # largest slope of the first loading, Pa/m, where n < 1
    elastic_depth: float  # sinkage up to which the first loading has this slope, m; 0 where n >= 1
    k0: float  # slope of unloading from the surface, Pa/m
    Au: float  # its growth with the deepest sinkage, Pa/m2
    secant: float  # its least ratio to the secant p_u / z_u
    cohesion: float  # Pa
    tan: float  # tangent of the angle of internal friction
    K: float  # shear deformation modulus, m
    damping: float  # normal damping, Pa s/m
    length: float  # pitch of a link, m
    width: float  # width of a link, m


@kernel
def with_friction(law: Soil, factor: float, value: float) -> Soil:
    """See ``laws``: the strength of soil is its own; regions of friction are refused on it."""
    return law


def soil(numbers: Mapping[str, Any], pitch: float, track_width: float) -> Soil:
    """Return a Soil from its ``numbers`` in SI units, under links of ``pitch`` and ``track_width``, m.

    Required are Bekker's kc, kphi and n; cohesion, friction_angle and shear_deformation_modulus; k0 or Au or, in their
    place, rebound, the part of the sinkage that springs back; for n < 1 elastic. Optional are damping, and width, that
    of the pressed area in kc / width + kphi, by default the track's. Raises ValueError with the key, the value and what
    is allowed.
    """
    p = {**OPTIONAL, **numbers}
    n, rebound, width = p["n"], p["rebound"], track_width if p["width"] is None else p["width"]
    for key, value in (("n", n), ("shear_deformation_modulus", p["shear_deformation_modulus"]), ("width", width)):
        if not value > 0.0:
            raise ValueError(f"{key} = {value:g}: must be above 0")
    for key in ("kc", "kphi", "cohesion", "k0", "Au", "damping"):
        if not p[key] >= 0.0:
            raise ValueError(f"{key} = {p[key]:g}: must not be negative")
    stiffness = p["kc"] / width + p["kphi"]
    if not stiffness > 0.0:
        raise ValueError("kc = 0 and kphi = 0: one of them must be above 0, or the soil bears nothing")
    if not 0.0 <= p["friction_angle"] < 1.5:
        raise ValueError(f"friction_angle = {p['friction_angle']:g} rad: must be at least 0 and below 1.5")
    if p["k0"] == p["Au"] == 0.0 and rebound is None:
        raise ValueError("k0 = 0 and Au = 0: soil without a slope of unloading is nearly elastic; give one or rebound")
    most = 1.0 / max(1.0, n)
    if rebound is not None and not 0.0 < rebound <= most:
        raise ValueError(f"rebound = {rebound:g}: must be above 0 and at most 1 / max(1, n) = {most:g}")
    if n < 1.0 and not p["elastic"] > 0.0:
        raise ValueError(f"elastic = {p['elastic']:g} Pa/m: must be above 0, as the first slope is infinite for n < 1")
    return Soil(
        stiffness,
        n,
        p["elastic"],
        power(stiffness / p["elastic"], 1.0 / (1.0 - n)) if n < 1.0 else 0.0,
        p["k0"],
        p["Au"],
        max(1.0, n) if rebound is None else 1.0 / rebound,
        p["cohesion"],
        sin(p["friction_angle"]) / cos(p["friction_angle"]),
        p["shear_deformation_modulus"],
        p["damping"],
        pitch,
        track_width,
    )
