"""Torsion of the beam: Saint-Venant's constant, and skew bending against an exact rod."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

from fmus.physics.ancf import beam
from tests.validation.ancf import joints, loads, statics, torsion
from tests.validation.meshes import line

E, SHEAR = 1e9, 5 / 6
CURES = {"nu = 0": (0.0, False), "split": (0.3, True)}


def cantilever(length, width, height, n, factor, cure="split", shear=SHEAR):
    """Mesh of a cantilever along x, clamped at the origin."""
    nu, split = CURES[cure]
    c = beam.Beam(length / n, width, height, 1000.0, E, nu, shear, factor, split, 0.0)
    return line(beam, c, n, [((0, 0), joints.clamped)])


def tip(mesh, *pushes, steps=1):
    """Vectors r, r_x, r_y, r_z of the tip in equilibrium with the loads ``pushes``."""
    end = (len(mesh.parts[0].e) - 1, 1)
    mesh = mesh.loaded(*(push(mesh, end) for push in pushes))
    return mesh.end(statics.equilibrium(mesh, mesh.start(), steps=steps, tolerance=1e-11), end)


@pytest.mark.parametrize(
    ("ratio", "published"), [(1, 0.1406), (1.5, 0.196), (2, 0.229), (3, 0.263), (5, 0.291), (10, 0.312)]
)
def test_the_series_gives_the_published_constants(ratio, published):
    """The series gives J/(width height^3) of Timoshenko and Goodier's table (three digits)."""
    b, h = 0.03 * ratio, 0.03
    assert torsion.constant(b, h) / (b * h**3) == pytest.approx(published, rel=3e-3)
    assert torsion.constant(b, h) / (b * h**3) != pytest.approx(1.01 * published, rel=3e-3)
    assert torsion.constant(h, b) == torsion.constant(b, h)
    polar = b * h * (b * b + h * h) / 12
    assert torsion.factor(b, h) * polar == pytest.approx(torsion.constant(b, h), rel=1e-14)
    assert torsion.factor(b, h) < 0.85


@pytest.mark.parametrize("cure", CURES)
@pytest.mark.parametrize("ratio", [1, 2, 9.4])
def test_an_end_couple_twists_as_saint_venant_says(ratio, cure):
    """An end couple twists by T L / (G J), not by the polar moment or the factor of transverse shear."""
    h, L, angle = 0.02, 1.0, 1e-3
    b, G = ratio * h, 0.5 * E / (1 + CURES[cure][0])
    T = G * torsion.constant(b, h) * angle / L

    def twist(off=1.0, shear=SHEAR):
        half = [lambda mesh, end, row=row: loads.couple(mesh, end, [0.5 * T, 0.0, 0.0], row) for row in (2, 3)]
        r, _, r_y, r_z = tip(cantilever(L, b, h, 4, off * torsion.factor(b, h), cure, shear), *half)
        assert abs(r - [L, 0, 0]).max() < 1e-8
        return np.array([r_y[2], -r_z[1]]) / angle

    np.testing.assert_allclose(twist(), 1.0, rtol=1e-3)
    np.testing.assert_allclose(twist(shear=1.0), 1.0, rtol=1e-3)
    assert abs(twist(off=1.03) - 1.0).min() > 2e-2


@pytest.mark.parametrize("cure", CURES)
@pytest.mark.parametrize("across", [1, 2])
def test_transverse_shear_keeps_its_own_factor(across, cure):
    """Transverse shear keeps its own factor: Timoshenko's cantilever with any factor of torsion."""
    b, h, L, P = 0.2, 0.1, 0.5, 1.0
    G, depth = 0.5 * E / (1 + CURES[cure][0]), (b, h)[across - 1]
    EI, kGA = E * b * h * depth**2 / 12, SHEAR * G * b * h
    force, expected = P * np.eye(3)[across], P * L**3 / (3 * EI) + P * L / kGA

    def deflection(factor, shear=SHEAR):
        mesh = cantilever(L, b, h, 32, factor, cure, shear)
        return tip(mesh, lambda mesh, end: loads.point_force(mesh, end, force))[0, across]

    tip_deflection = deflection(0.04)
    assert tip_deflection == pytest.approx(expected, rel=1e-3)
    assert deflection(0.8) == pytest.approx(tip_deflection, rel=1e-9)
    assert deflection(0.04, shear=1.03 * SHEAR) != pytest.approx(expected, rel=1e-3)


def exact_rod(length, stiff, bend, F, arm):
    """Tip of Simo's clamped rod, and axes of its section there (columns), under a dead force F at ``arm``.

    ``stiff``: EA and the shear stiffnesses; ``bend``: GJ and the bending stiffnesses, along and about the section's
    axes. Shooting for the moment at the clamp; the matrix of the section is integrated, R' = R hat(curvature). Simo, A
    finite strain beam formulation, Comput. Methods Appl. Mech. Eng. 49, 1985.
    """

    def slope(s, y, F, M):
        R = y[3:].reshape(3, 3)
        k = R.T @ (M - np.cross(y[:3], F)) / bend
        hat = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
        return np.concatenate([R @ ([1.0, 0.0, 0.0] + R.T @ F / stiff), (R @ hat).ravel()])

    def end(M, F):
        start = np.concatenate([np.zeros(3), np.eye(3).ravel()])
        y = solve_ivp(slope, (0.0, length), start, "DOP853", args=(F, M), rtol=1e-8, atol=1e-10).y[:, -1]
        return y[:3], y[3:].reshape(3, 3)

    def excess(M, F):
        r, R = end(M, F)
        return (M - np.cross(r + R @ arm, F)) / np.linalg.norm(F)

    M = np.zeros(3)
    for share in (0.3, 0.6, 1.0):
        solution = root(excess, M, (share * F,), tol=1e-9)
        assert solution.success
        M = solution.x
    return end(M, F)


@pytest.mark.long
@pytest.mark.parametrize(
    ("b", "h", "L", "load", "arm", "twins"),
    [
        (0.02, 0.01, 1.0, [0.2, 5.0, 1.0], [0.0, 0.02, 0.1], ("J", "E", "I_z")),
        (0.047, 0.005, 0.5, [0.1, 4.0, 0.8], [0.0, 0.05, 0.0], ("J", "E")),  # 88 times as stiff about z
    ],
    ids=["b/h = 2", "b/h = 9.4"],
)
def test_a_beam_loaded_askew_bends_as_an_exact_rod(b, h, L, load, arm, twins):
    """A beam under a skew load has position and section of an exact rod to 0.2 %.

    It bends about both axes and twists; its tip moves by a third of the length.
    """
    A, arm = b * h, np.array(arm)
    rod = {"E": E, "J": torsion.constant(b, h), "I_y": b * h**3 / 12, "I_z": h * b**3 / 12}
    F = np.array(load) * E * rod["I_y"] / L**2

    def askew(mesh, end):
        lever = zip((1.0, *arm[1:]), (0, 2, 3), strict=True)
        return loads.Dead(sum(share * (mesh.pull(end, row).T @ F) for share, row in lever))

    def off(E, J, I_y, I_z):
        G = 0.5 * E / (1 + CURES["split"][0])
        stiff, bend = [E * A, SHEAR * G * A, SHEAR * G * A], [G * J, E * I_y, E * I_z]
        r, R = exact_rod(L, np.array(stiff), np.array(bend), F, arm)
        moved = np.linalg.norm(r - [L, 0, 0])
        assert 0.3 * L < moved < 0.6 * L
        return max(np.linalg.norm(tip_coordinates[0] - r) / moved, abs(tip_coordinates[2:].T - R[:, 1:]).max())

    tip_coordinates = tip(cantilever(L, b, h, 64, torsion.factor(b, h)), askew, steps=6)
    assert off(**rod) < 2e-3
    for name in twins:
        assert off(**rod | {name: 1.03 * rod[name]}) > 2e-3, name
