"""Meshes of elements with eliminated joints: ranks, free rotation, corners, orders of integrators, energy.

Exact and published figures, with twins, are rows of the study of the mechanics (``tests/validation/test_mechanics``).
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from fmus.physics.ancf import beam, cable, cable_engineering, cable_general
from fmus.physics.ancf.cable import Cable
from tests.validation import element_cases, meshes
from tests.validation.ancf import chord, corner, dynamics, joints, loads
from tests.validation.ancf.mesh import Member, Mesh, Support, Tie, nodes
from tests.validation.meshes import SECTIONS, SHOE, TRACK, Y, rotation, turned

A30 = [0.5, np.sqrt(0.75), 0.0]


def link(kind):
    return SHOE if kind is beam else TRACK


@pytest.mark.parametrize(
    ("kind", "joint", "rank"),
    [
        (cable, joints.spherical(2, 2), 3),
        (cable, joints.pin_cable(Y), 4),
        (cable, joints.pin_cable([1, 2, 3]), 4),
        (cable, joints.rigid_cable(rotation(Y, 1.0)), 6),
        (cable, joints.smooth(2), 6),
        (beam, joints.spherical(4, 4), 3),
        (beam, joints.pin_beam(Y), 6),
        (beam, joints.pin_beam(A30, np.eye(3), rotation([1, 1, 0], 0.7)), 6),
        (beam, joints.rigid_beam(np.eye(3), rotation(Y, 1.0)), 12),
        (beam, joints.smooth(4), 12),
    ],
)
def test_rank_of_what_a_joint_eliminates(kind, joint, rank):
    ties = [Tie((0, 1), (1, 0), joint)]
    mesh = Mesh([Member(kind, link(kind), nodes(kind, [0, 0, 0], np.eye(3), link(kind).l, 2))], ties)
    C = mesh.constraints(ties)
    assert np.linalg.matrix_rank(C) == joint.equations == rank == mesh.equations
    assert abs(C @ mesh.B.toarray()).max() < 1e-14
    assert np.linalg.matrix_rank(mesh.B.toarray()) == mesh.n
    assert np.linalg.eigvalsh(mesh.M.toarray())[0] > 0


@pytest.mark.parametrize("kind", [cable, beam])
@pytest.mark.parametrize("closed", [True, False])
def test_the_joints_of_a_track_match_its_layout(kind, closed):
    mesh = meshes.chain(kind, link(kind), meshes.polygon(64) if closed else np.zeros(64), closed)
    np.testing.assert_allclose(mesh.coordinates(mesh.start()), mesh.e0, atol=1e-12)
    assert mesh.equations == (64 if closed else 63) * (6 if kind is beam else 4)
    assert mesh.energy(mesh.start()) < 1e-12


@pytest.mark.parametrize(
    ("kind", "axis"),
    [(cable, Y), (cable_general, Y), (beam, Y), (beam, [0, 0, 1]), (beam, [1, 0, 0]), (beam, [1, 2, 3])],
)
def test_a_pin_turns_freely_through_360_degrees(kind, axis):
    """A pin turns freely through 360 degrees and about no other axis, between two links at an angle."""
    c = link(kind)
    frames = np.eye(3), rotation([0, 0, 1], 0.4) if kind is beam else np.eye(3)
    e = np.concatenate([nodes(kind, [0, 0, 0], frames[0], c.l, 1), nodes(kind, [c.l, 0, 0], frames[1], c.l, 1)])
    pin = joints.pin_beam(axis, *frames) if kind is beam else joints.pin_cable(axis)
    mesh = Mesh([Member(kind, c, e)], [Tie((0, 1), (1, 0), pin)])
    # the beam's pin turns with the pair; the cable's pin is fixed in the world
    whole = rotation([3, -1, 2], 1.0) if kind is beam else rotation(axis, 1.0)
    for angle in np.radians(np.arange(0, 361, 15)):
        x = turned(meshes.folded(mesh, axis, angle), whole)
        q = mesh.fit(x)
        assert abs(mesh.coordinates(q) - x.ravel()).max() < 1e-14
        assert mesh.energy(q) < 1e-24 * meshes.MODULUS * meshes.AREA * c.l
    wrong = meshes.folded(mesh, joints.across(axis)[:, 0] if kind is beam else [0.0, 0.0, 1.0], 0.5)
    assert abs(mesh.coordinates(mesh.fit(wrong)) - wrong.ravel()).max() > 0.05


def test_elimination_gives_the_accelerations_of_multipliers():
    mesh, pin = meshes.chain(beam, SHOE, np.zeros(3)), joints.pin_beam(Y)
    q = mesh.start() + 1e-6 * np.random.default_rng(3).standard_normal(mesh.n)
    f = -mesh.internal(q)
    own = mesh.B @ spsolve(mesh.M, mesh.B.T @ f)
    C = mesh.constraints([Tie((0, 1), (1, 0), pin), Tie((1, 1), (2, 0), pin)])
    K = np.block([[mesh.M_e.toarray(), C.T], [C, np.zeros((len(C), len(C)))]])
    kept = np.linalg.solve(K, np.concatenate([f, np.zeros(len(C))]))[: len(f)]
    assert abs(own - kept).max() < 1e-7 * abs(kept).max()


# Corners -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SECTIONS)
def test_a_section_of_beams_has_no_mechanism(name):
    mesh = meshes.cornered(beam, [SHOE] * (1 + len(SECTIONS[name])), SECTIONS[name], 2)
    stiffness = np.linalg.eigvalsh(mesh.tangent(mesh.start()).toarray())
    assert (abs(stiffness) < 1e-12 * stiffness[-1]).sum() == 6


@pytest.mark.parametrize("name", ["T", "L", "V"])
def test_a_section_of_cables_turns_in_its_plane_alone(name):
    mesh = meshes.cornered(cable, [TRACK] * (1 + len(SECTIONS[name])), SECTIONS[name], 2)
    stiffness, modes = np.linalg.eigh(mesh.tangent(mesh.start()).toarray())
    free = abs(stiffness) < 1e-12 * stiffness[-1]
    zero = (mesh.B @ modes[:, free]).reshape(-1, 3, free.sum())
    assert np.linalg.matrix_rank(zero[:, [0, 2]].reshape(-1, free.sum()), tol=1e-6) == 3
    x = turned(mesh.e0, rotation([1, 0, 0], 1.0))  # rotation out of its plane is blocked: the corner's normal is fixed
    assert abs(mesh.coordinates(mesh.fit(x)) - x).max() > 0.01


def test_a_corner_by_gradient_transformation_alone_yields():
    """A corner by gradient transformation alone yields, the more the finer the elements.

    The moment passes by shear in one element of each member.
    """
    tips = [meshes.frame_tip(beam, n, rigid=0.0) for n in (12, 24, 48)]
    errors = [u[0] / exact[0] - 1.0 for u, exact in tips]
    assert errors == sorted(errors)
    assert errors[-1] > 0.1
    assert 1.8 < (errors[2] - errors[1]) / (errors[1] - errors[0]) < 2.2  # proportional to 1/l


def test_the_block_of_a_corner_has_a_potential_and_turns_freely():
    mesh = meshes.cornered(beam, [SHOE, SHOE], SECTIONS["L"], 2)
    mesh = mesh.sprung(corner.block(mesh, (1, 1), 1e-3, 2e11))
    block = mesh.springs[0]
    q = mesh.fit(turned(mesh.e0, rotation([1, 2, 3], 2.0)))
    assert block.energy(q) < 1e-24 * block.VE
    q = q + 0.02 * np.random.default_rng(1).standard_normal(len(q))
    f, K = block.force(q), block.tangent(q).toarray()
    steps = 1e-5 * np.eye(len(q))
    by_energy = np.array([(block.energy(q + d) - block.energy(q - d)) / 2e-5 for d in steps])
    by_force = np.array([(block.force(q + d) - block.force(q - d)) / 2e-5 for d in steps])
    assert abs(f - by_energy).max() < 1e-7 * abs(f).max()
    assert abs(K - by_force).max() < 1e-7 * abs(K).max()


# Frequencies and motion ---------------------------------------------------------------------------------------------


def test_frequencies_of_a_stubby_beam_are_timoshenkos():
    """Frequencies of a pinned beam of L/h = 20 are Timoshenko's (shear, rotatory inertia), order 2."""
    h, E = 1 / 20, 12 * 20.0**4
    kGA, rhoI, waves = 0.5 * E * h * h, h * h / 12, np.pi * np.arange(1, 4)
    b = 1 + waves**2 * (1 / kGA + rhoI)  # (rhoI/kGA) w^4 - (1 + k^2 (EI/kGA + rhoI)) w^2 + EI k^4 = 0
    square = (b - np.sqrt(b * b - 4 * rhoI / kGA * waves**4)) / (2 * rhoI / kGA)
    errors = [element_cases.beta(beam, n, 20, "pinned") / square**0.25 - 1 for n in (16, 32, 64)]
    assert abs(errors[-1]).max() < 1e-3
    rates = np.log2(errors[1] / errors[2])
    assert rates.min() > 1.9
    assert rates.max() < 2.1
    assert abs(square**0.25 / waves - 1).min() > 1e-3  # Euler-Bernoulli would fail


def rotating(kind, n=4, tau=0.0):
    """Mesh, q and v of a pinned rubber cable of 1 m that starts to turn about y under gravity along -y."""
    c = meshes.round_cable(1.0 / n, 2.5e-5, 1.6e6, 320.0)
    return meshes.rotating(kind, c._replace(nuA=tau * c.EA, nuI=tau * c.EI), n)


def last(motion):
    for moment in motion:
        t, q, v = moment
    return t, q.copy(), v.copy()


@pytest.mark.long
@pytest.mark.parametrize("kind", [cable, cable_general, cable_engineering])
def test_energy_of_the_rotating_cable(kind):
    """It changes by the work of the weight; damping takes energy alone, by either integrator."""
    mesh, q, v = rotating(kind)
    _, p, u = last(dynamics.runge_kutta(mesh, q, v, 4e-4, 500))
    work = mesh.applied(p) @ (p - q)
    assert mesh.energy(p) + mesh.kinetic(u) == pytest.approx(mesh.energy(q) + mesh.kinetic(v) + work, rel=1e-6)
    damped, q, v = rotating(kind, tau=0.01)
    for moved in (
        dynamics.runge_kutta(damped, q, v, 2e-4, 500, damped=True),
        dynamics.generalized_alpha(damped, q, v, 1e-3, 100, damped=True),
    ) * (kind is cable):
        _, p, u = last(moved)
        energy = damped.energy(p) + damped.kinetic(u) - damped.applied(p) @ (p - q)
        assert 0.5 * damped.kinetic(v) < energy < 0.999 * damped.kinetic(v)


@pytest.mark.long
def test_integrators_keep_their_orders():
    mesh, q, v = rotating(cable_engineering, n=2)
    for method, order, end, steps, reference in (
        (dynamics.runge_kutta, 4, 0.02, (40, 80, 160), 640),  # steps that resolve the highest mode, 1365 rad/s
        (dynamics.generalized_alpha, 2, 0.1, (100, 200, 400), 1600),
    ):
        exact = last(dynamics.runge_kutta(mesh, q, v, end / reference, reference))[1]
        errors = [abs(last(method(mesh, q, v, end / n, n))[1] - exact).max() for n in steps]
        rates = np.log2(np.divide(errors[:-1], errors[1:]))
        assert abs(rates - order).max() < 0.2, (order, rates)


class Chord(Mesh):
    """Small-deformation cables with the strain printed below (12), which has no potential."""

    def internal(self, q):
        return np.concatenate([chord.forces(c, e).ravel() for c, e in self._elements(self.coordinates(q))])


@pytest.mark.long
@pytest.mark.parametrize(("kind", "worst"), [(Mesh, (0.0, 1e-6)), (Chord, (0.01, 0.05))], ids=["green", "chord"])
def test_energy_of_a_soft_chain_released_from_the_horizontal(kind, worst):
    """Energy error of a soft chain (16 links, EA = 1e5 N) over the largest strain energy."""
    c, n = Cable(0.1524, 118.0, 1e5, 20.0, 0.0, 0.0), 16
    ties = [Tie((k, 1), (k + 1, 0), joints.pin_cable([0, 1, 0])) for k in range(n - 1)]
    mesh = kind([Member(cable, c, nodes(cable, [0, 0, 0], np.eye(3), c.l, n))], ties, [Support((0, 0), joints.held(2))])
    mesh = mesh.loaded(loads.gravity(mesh, [0, 0, -9.81]))
    q, error, strain = mesh.start(), 0.0, 0.0
    for _, p, v in dynamics.runge_kutta(mesh, q, np.zeros(mesh.n), 0.8 / 1600, 1600):
        error = max(error, abs(mesh.energy(p) + mesh.kinetic(v) - mesh.applied(p) @ (p - q)))
        strain = max(strain, mesh.energy(p))
    assert worst[0] < error / strain < worst[1]
