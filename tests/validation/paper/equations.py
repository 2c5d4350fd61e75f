"""Equations of sections 2, 4, 6 and 7, evaluated with the project's elements: found against expected."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from fmus.physics.ancf import cable, cable_general, element
from fmus.physics.arrays import Floats
from orchestrator.studies import Row
from tests.validation import meshes
from tests.validation.ancf import chord, joints, modes, sliding

LINK = meshes.STEEL._replace(nuA=2e5 * meshes.AREA, nuI=2e5 * meshes.SECOND)  # a link of the vehicle, tau = 1e-6 s
ROUNDING = 1e-12
SERIES = 1e-3  # tolerance of comparisons with the first term of a series
BEND, PULL = 0.3, 0.1  # slope and stretch of the closed path
AXIS = (0.3, 0.8, -0.5)  # of a pin, arbitrary
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(5)
XI = 0.5 * (POINTS + 1.0)


def rows() -> list[Row]:
    """Rows of all equations."""
    facts = [*_positions(), *_masses(), *_joints(), *_modes(), *_elasticity(), *_damping()]
    return [
        Row("equation", text, {"where": where, "key": key, "value": value, "reference": reference},
            abs(value - reference) <= tolerance)
        for where, key, text, value, reference, tolerance in facts
    ]  # fmt: skip


Fact = tuple[str, str, str, float, float, float]  # where, key, text, found, expected, tolerance


def shapes(c: cable.Cable, derivative: bool = False) -> Floats:
    """Shape functions S, or S_x, (5, 4) of the cable at the Gauss points."""
    S = np.zeros((len(XI), 4))
    for k, xi in enumerate(XI):
        (cable.shape_slope if derivative else cable.shape)(c, float(xi), S[k])
    return S


def mass_of(c: cable.Cable) -> Floats:
    """Mass matrix M (4, 4), kg."""
    M = np.zeros((4, 4))
    cable.mass(c, M)
    return M


def bent(c: cable.Cable, slope: float) -> Floats:
    """Coordinates of a link between fixed pins, bent to z = slope (x - x^2 / l)."""
    e = cable.straight(c)
    e[1, 2], e[3, 2] = slope, -slope
    return e


def force(c: cable.Cable, e: Floats, v: Floats | None = None) -> tuple[Floats, float]:
    """Internal force, N, and power of damping, W."""
    Q = np.zeros_like(e)
    power = element.force(c, e, np.zeros_like(e) if v is None else v, Q)
    return Q, float(power)


def _positions() -> list[Fact]:
    """Section 2: r = S e."""
    rng, x = np.random.default_rng(2), LINK.l * XI
    power = rng.standard_normal((4, 3))  # of an arbitrary cubic
    cubic = np.vander(x, 4, increasing=True) @ power
    ends = np.array([0.0, LINK.l])
    place = np.vander(ends, 4, increasing=True) @ power
    slope = np.vander(ends, 3, increasing=True) * [1.0, 2.0, 3.0] @ power[1:]
    e = np.array([place[0], slope[0], place[1], slope[1]])
    A, shift = Rotation.from_rotvec([0.4, -1.1, 2.0]).as_matrix(), np.array([3.0, -2.0, 7.0])
    moved = e @ A.T
    moved[[0, 2]] += shift
    S = shapes(LINK)
    return [
        ("2", "cubic", "r = S e: largest error of a cubic from its places and slopes, m",
         float(np.abs(S @ e - cubic).max()), 0.0, ROUNDING),
        ("2", "rigid", "the same of the element turned by 134 degrees and moved, m",
         float(np.abs(S @ moved - (cubic @ A.T + shift)).max()), 0.0, ROUNDING),
    ]  # fmt: skip


def _masses() -> list[Fact]:
    """Section 6: M = int rho A S^T S dx is constant, so no inertia force is quadratic in rates."""
    M, S = mass_of(LINK), shapes(LINK)
    quadrature = LINK.rhoA * np.einsum("k,ka,kb->ab", 0.5 * LINK.l * WEIGHTS, S, S)
    energies = []
    for seed in range(20):  # random bending, stretch and rotation: the velocity of a point is S e'
        rates = np.random.default_rng(seed).standard_normal((4, 3))
        by_points = 0.5 * LINK.rhoA * LINK.l * np.sum(0.5 * WEIGHTS[:, None] * (S @ rates) ** 2)
        energies.append(abs(0.5 * np.sum(rates * (M @ rates)) / by_points - 1.0))
    pin, turning = 0.04, cable.straight(LINK) - [0.5 * LINK.l, 0.0, 0.0]  # of table 1, kg m2; rates of 1 rad/s
    turning[[1, 3]] = [1.0, 0.0, 0.0]
    whole = mass_of(LINK._replace(rotary=pin - LINK.rhoA * LINK.l**3 / 12.0))
    return [
        ("8.1", "inertia", "inertia of a cable about its pin's axis, of table 1: e' M e' at 1 rad/s, kg m2",
         float(np.sum(turning * (whole @ turning))), pin, ROUNDING),
        ("6 (1)", "mass", "M = int rho A S^T S dx: largest difference from its quadrature, of the largest entry",
         float(np.abs(M - quadrature).max() / np.abs(M).max()), 0.0, ROUNDING),
        ("6 (1)", "kinetic", "e' M e' / 2 over the kinetic energy of the points, 20 motions: largest difference",
         float(max(energies)), 0.0, ROUNDING),
    ]  # fmt: skip


def _joints() -> list[Fact]:
    """Sections 4.1 to 4.3: degrees of freedom that joints remove."""
    b, r, s = meshes.rope("cable")
    return [
        ("4.1", "spherical", "equations of the spherical joint (1)", joints.spherical(2, 2).equations, 3, 0),
        ("4.2", "pin", "of the pin of cables (2)", joints.pin_cable([0.0, 1.0, 0.0]).equations, 4, 0),
        ("4.2", "pin_beam", "of the pin of beams (3), about any axis", joints.pin_beam(AXIS).equations, 6, 0),
        ("4.3", "sliding", "degrees of freedom that the sliding joint (4) takes away",
         sliding.removed(b, r, s.X, s.w), 4, 0),
    ]  # fmt: skip


def _modes() -> list[Fact]:
    """Section 4.4: strains (J^T J - 1) / 2 at the pin of beams."""
    jump = modes.jump_of_strain(np.array(AXIS))
    l, size = meshes.PITCH, 0.02
    stretched = modes.straight(l) + modes.displacement("pin stretch", np.array(AXIS), size, l)
    before, behind = modes.at_joint(stretched, l)
    b = modes.triad(np.array(AXIS))[1]
    return [
        ("4.4", "deformations", "independent strains that may jump at a pin of beams",
         int(np.linalg.matrix_rank(jump, 1e-6)), 5, 0),
        ("4.4", "rotation", "largest of them of a rotation about the pin", float(np.abs(jump[:, 0]).max()), 0.0, 1e-9),
        ("4.4", "continuous", "largest jump of the strain along the pin", float(np.abs(jump[1]).max()), 0.0, 1e-9),
        ("4.4", "pin_stretch", f"strain of a pin stretched by {size:g}, both sides less e + e^2 / 2",
         float(max(abs(b @ E @ b - size - 0.5 * size**2) for E in (before, behind))), 0.0, ROUNDING),
    ]  # fmt: skip


def _elasticity() -> list[Fact]:
    """Section 7.1: elastic energy, force and stiffness."""
    slope = 1e-3
    pulled = cable.tension(LINK, bent(LINK, slope)) / (LINK.EA * slope**2 / 6.0)
    straight = cable.straight(LINK)
    stiff = [_secant(LINK, eps) for eps in (1e-4, 2e-4)]
    small, general = force(LINK, bent(LINK, 1e-5))[0], np.zeros_like(straight)
    element.force(cable_general.Section(*LINK), bent(LINK, 1e-5), np.zeros_like(straight), general)
    return [
        ("7.1", "coupling", "tension of a link bent between held pins, over E A slope^2 / 6", float(pulled), 1.0,
         SERIES),
        ("7.1", "bending", "K_e,t of two bent shapes, quotient: constant",
         _bending(LINK, 2e-3) / _bending(LINK, 1e-3), 1.0, SERIES),
        ("7.1", "axial", "K_e,l at twice the strain over K_e,l: in proportion, not constant", stiff[1] / stiff[0], 2.0,
         SERIES),
        ("7.1", "models", "force of (8)-(10) and of (11)-(15) at a slope of 1e-5: largest difference, of the largest",
         float(np.abs(general - small).max() / np.abs(small).max()), 0.0, 1e-3),
        ("7.1", "chord", "work of a closed path by the printed mean strain (d - l) / l, over the energy of its stretch",
         _round_trip(chorded=True), BEND**2 / (3.0 * PULL), SERIES),
        ("7.1", "green", "the same by the mean Green strain", _round_trip(chorded=False), 0.0, 1e-9),
    ]  # fmt: skip


def _secant(c: cable.Cable, eps: float) -> float:
    """First diagonal entry of K_e,l in (12), N/m: axial force at the Green strain ``eps`` over S_x e."""
    return float(cable.linear(c._replace(EI=0.0), c.EA * eps, 0.0)[0][0])


def _bending(c: cable.Cable, slope: float) -> float:
    """Moment on the first slope over the slope, N m, without the tension that bending causes."""
    return float(force(c._replace(EA=0.0), bent(c, slope))[0][1, 2] / slope)


def _round_trip(chorded: bool, steps: int = 400) -> float:
    """Work of the elastic force, J, on the path bend, stretch, straighten, shorten, by the midpoint rule."""
    soft = LINK._replace(EA=1.0, EI=1e-6, nuA=0.0, nuI=0.0)
    s = np.linspace(0.0, 4.0, 4 * steps + 1)
    turn, pull = (np.interp(s, range(5), part) for part in ([0, BEND, BEND, 0, 0], [0, 0, PULL, PULL, 0]))
    way = np.array([bent(soft, a) for a in turn])
    way[:, 2, 0] += pull * soft.l
    work = 0.0
    for one, other in pairwise(way):
        middle = 0.5 * (one + other)
        Q = chord.forces(soft, middle[None])[0] if chorded else force(soft, middle)[0]
        work += float(np.sum(Q * (other - one)))
    return abs(work) / (0.5 * soft.EA * soft.l * PULL**2)


def _damping() -> list[Fact]:
    """Section 7.2: rigid motion is undamped, the fast modes of a link are damped."""
    e = bent(LINK, 1e-4)
    rigid = np.cross([0.0, 3.0, 0.0], e)
    rigid[[0, 2]] += [1.0, 0.0, -2.0]
    stretching = np.zeros_like(e)
    stretching[2, 0] = 1.0
    return [
        ("7.2", "undamped", "power of the damping of a bent link that turns at 3 rad/s, over that of 1 m/s of stretch",
         force(LINK, e, rigid)[1] / force(LINK, e, stretching)[1], 0.0, ROUNDING),
    ]  # fmt: skip
