"""Eliminated joints: counts and ranks, free rotation, corners, frames, the spinning loop."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from fmus.physics.ancf import beam, cable, cable_general
from fmus.physics.ancf.cable import Cable
from tests.validation.ancf import corner as corners
from tests.validation.ancf import joints, loads, statics, torsion
from tests.validation.ancf.mesh import Member, Mesh, Support, Tie, in_a_row, nodes
from tests.validation.meshes import rotation, turned

PITCH = 0.1524
LINK = Cable(PITCH, 18.0 / PITCH, 2e11 * 0.01516, 2e11 * 2.03e-6, 0.0, 0.0)
SHOE = beam.Beam(PITCH, 0.378, 0.0401, 7800.0, 2e11, 0.3, 5 / 6, torsion.factor(0.378, 0.0401), True, 0.0)
Y = [0.0, 1.0, 0.0]


def chain(kind, c, n, closed):
    """Mesh of links with pins along y, straight or as a polygon, and its ties."""
    e = np.concatenate(
        [nodes(kind, [0, 0, 0], rotation(Y, -2 * np.pi * k / n if closed else 0.0), c.l, 1) for k in range(n)]
    )
    for k in range(1, n):
        e[k, [0, kind.ROWS // 2]] += e[k - 1, kind.ROWS // 2]
    frames = [e[k, 1:4].T for k in range(n)]
    ties = []
    for k in range(n if closed else n - 1):
        j = (k + 1) % n
        pin = joints.pin_beam(Y, frames[k], frames[j]) if kind is beam else joints.pin_cable(Y)
        ties.append(Tie((k, 1), (j, 0), pin))
    return Mesh([Member(kind, c, e)], ties), ties


@pytest.mark.parametrize(
    ("kind", "c", "closed", "dofs"),
    [
        (cable, LINK, True, 512),
        (cable, LINK, False, 516),
        (beam, SHOE, True, 64 * 24 - 64 * 6),
        (beam, SHOE, False, 64 * 24 - 63 * 6),
    ],
)
def test_degrees_of_freedom_of_a_track(kind, c, closed, dofs):
    mesh, ties = chain(kind, c, 64, closed)
    assert mesh.n == dofs
    assert mesh.equations == len(ties) * (6 if kind is beam else 4)
    np.testing.assert_allclose(mesh.coordinates(mesh.start()), mesh.e0, atol=1e-12)  # the joints match the layout
    assert mesh.energy(mesh.start()) < 1e-12


def test_both_tracks_open_have_126_pins():
    ties = chain(cable, LINK, 64, False)[1]
    assert 2 * len(ties) == 126
    assert 5 * 2 * len(ties) == 630  # of rigid bodies; here 504, linear and eliminated


A30 = [0.5, np.sqrt(0.75), 0.0]


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
    c = SHOE if kind is beam else LINK
    ties = [Tie((0, 1), (1, 0), joint)]
    mesh = Mesh([Member(kind, c, nodes(kind, [0, 0, 0], np.eye(3), c.l, 2))], ties)
    C = mesh.constraints(ties)
    assert np.linalg.matrix_rank(C) == joint.equations == rank == mesh.equations
    assert abs(C @ mesh.B.toarray()).max() < 1e-14
    assert np.linalg.matrix_rank(mesh.B.toarray()) == mesh.n
    assert np.linalg.eigvalsh(mesh.M.toarray())[0] > 0


@pytest.mark.parametrize(
    ("kind", "axis"),
    [(cable, Y), (cable_general, Y), (beam, Y), (beam, [0, 0, 1]), (beam, [1, 0, 0]), (beam, [1, 2, 3])],
)
def test_a_pin_turns_freely_through_360_degrees(kind, axis):
    """A pin turns freely through 360 degrees and about no other axis, between two links at an angle."""
    c = SHOE if kind is beam else LINK
    size = 2e11 * 0.01516
    frames = np.eye(3), rotation([0, 0, 1], 0.4) if kind is beam else np.eye(3)
    e = np.concatenate([nodes(kind, [0, 0, 0], frames[0], c.l, 1), nodes(kind, [c.l, 0, 0], frames[1], c.l, 1)])
    pin = joints.pin_beam(axis, *frames) if kind is beam else joints.pin_cable(axis)
    mesh = Mesh([Member(kind, c, e)], [Tie((0, 1), (1, 0), pin)])
    middle, half = np.array([c.l, 0, 0]), kind.ROWS // 2

    def second_turned(about, angle):
        x = e.copy()
        x[1, [0, half]] -= middle
        x[1] = turned(x[1], rotation(about, angle))
        x[1, [0, half]] += middle
        return x

    # the beam's pin turns with the pair; the cable's pin is fixed in the world
    whole = rotation([3, -1, 2], 1.0) if kind is beam else rotation(axis, 1.0)
    for angle in np.radians(np.arange(0, 361, 15)):
        x = turned(second_turned(axis, angle), whole)
        q = mesh.fit(x)
        assert abs(mesh.coordinates(q) - x.ravel()).max() < 1e-14
        assert mesh.energy(q) < 1e-24 * size * c.l
    about = joints.across(axis)[:, 0] if kind is beam else [0.0, 0.0, 1.0]
    wrong = second_turned(about, 0.5)
    assert abs(mesh.coordinates(mesh.fit(wrong)) - wrong.ravel()).max() > 0.05


def test_elimination_gives_the_accelerations_of_multipliers():
    mesh, ties = chain(beam, SHOE, 3, False)
    rng = np.random.default_rng(3)
    q = mesh.start() + 1e-6 * rng.standard_normal(mesh.n)
    f = -mesh.internal(q)
    own = mesh.B @ spsolve(mesh.M, mesh.B.T @ f)
    C = mesh.constraints(ties)
    K = np.block([[mesh.M_e.toarray(), C.T], [C, np.zeros((len(C), len(C)))]])
    kept = np.linalg.solve(K, np.concatenate([f, np.zeros(len(C))]))[: len(f)]
    assert abs(own - kept).max() < 1e-7 * abs(kept).max()


def test_an_end_follows_once():
    e = nodes(cable, [0, 0, 0], np.eye(3), 1.0, 2)
    tie = Tie((0, 1), (1, 0), joints.smooth(2))
    with pytest.raises(ValueError, match="one other end or one support"):
        Mesh([Member(cable, LINK, e)], [tie, tie])
    with pytest.raises(ValueError, match="one other end or one support"):
        Mesh([Member(cable, LINK, e)], [tie], [Support((1, 0), joints.clamped(2))])
    with pytest.raises(ValueError, match="follows itself"):
        Mesh([Member(cable, LINK, e)], [tie, Tie((1, 0), (0, 1), joints.smooth(2))])


# Corners -----------------------------------------------------------------------------------------------------------

SECTIONS = {"T": (90.0, -90.0), "L": (90.0,), "V": (40.0,), "Y in space": (120.0, (75.0, [1.0, 0.0, 1.0]))}


def corner(kind, c, name, n=2):
    """Mesh of a first member along x and others at angles about -y at its end, rigidly connected."""
    frames = [np.eye(3)]
    for angle in SECTIONS[name]:
        degrees, axis = angle if isinstance(angle, tuple) else (angle, [0, -1, 0])
        frames.append(rotation(axis, np.radians(degrees)))
    parts = [Member(kind, c, nodes(kind, [0, 0, 0], frames[0], c.l, n))]
    ties = in_a_row(kind.ROWS // 2, n)
    for k, frame in enumerate(frames[1:], start=1):
        parts.append(Member(kind, c, nodes(kind, [n * c.l, 0, 0], frame, c.l, n)))
        joint = joints.rigid_beam(frames[0], frame) if kind is beam else joints.rigid_cable(frame)
        ties += [Tie((n - 1, 1), (k * n, 0), joint), *in_a_row(kind.ROWS // 2, n, k * n)]
    return Mesh(parts, ties)


@pytest.mark.parametrize("name", SECTIONS)
def test_sections_of_beams_turn_as_one_body(name):
    mesh = corner(beam, SHOE, name)
    for axis, angle in (([0, 1, 0], 1.0), ([1, 2, 3], 2.0), ([1, 0, 0], 3.0)):
        x = turned(mesh.e0, rotation(axis, angle))
        q = mesh.fit(x)
        assert abs(mesh.coordinates(q) - x).max() < 1e-14
        assert mesh.energy(q) < 1e-24 * 2e11 * 0.01516
    stiffness = np.linalg.eigvalsh(mesh.tangent(mesh.start()).toarray())
    assert (abs(stiffness) < 1e-12 * stiffness[-1]).sum() == 6  # no mechanism other than the rigid motion


@pytest.mark.parametrize("name", ["T", "L", "V"])
def test_sections_of_cables_turn_as_one_body_in_their_plane(name):
    mesh = corner(cable, LINK, name)
    x = turned(mesh.e0, rotation(Y, 1.0))
    q = mesh.fit(x)
    assert abs(mesh.coordinates(q) - x).max() < 1e-14
    assert mesh.energy(q) < 1e-24 * LINK.EA
    stiffness, modes = np.linalg.eigh(mesh.tangent(mesh.start()).toarray())
    zero = (mesh.B @ modes[:, abs(stiffness) < 1e-12 * stiffness[-1]]).reshape(
        -1, 3, (abs(stiffness) < 1e-12 * stiffness[-1]).sum()
    )
    assert np.linalg.matrix_rank(zero[:, [0, 2]].reshape(-1, zero.shape[2]), tol=1e-6) == 3
    x = turned(mesh.e0, rotation([1, 0, 0], 1.0))  # rotation out of its plane is blocked: the corner's normal is fixed
    assert abs(mesh.coordinates(mesh.fit(x)) - x).max() > 0.01


def frame_tip(kind, n, stiffer=1.0, h=0.05, rigid=100.0):
    """Errors of a clamped L-frame's tip displacements x, z under a force (1, 0, 1), over Timoshenko's."""
    L1, L2, E, shear, P = 1.0, 0.8, 1e7, 5 / 6, 0.16 * h**4 * 1e3
    A, inertia, kGA = h * h, h**4 / 12, shear * 0.5 * E * h * h
    if kind is beam:
        kGA *= stiffer
        twist = torsion.factor(h, h)
        one, two = (beam.Beam(L / n, h, h, 1e3, stiffer * E, 0.0, shear, twist, False, 0.0) for L in (L1, L2))
    else:
        kGA = np.inf
        one, two = (Cable(L / n, 1.0, E * A, stiffer * E * inertia, 0.0, 0.0) for L in (L1, L2))
    rows, up = kind.ROWS // 2, rotation([0, -1, 0], np.pi / 2)
    joint = joints.rigid_beam(np.eye(3), up) if kind is beam else joints.rigid_cable(up)
    mesh = Mesh(
        [
            Member(kind, one, nodes(kind, [0, 0, 0], np.eye(3), one.l, n)),
            Member(kind, two, nodes(kind, [L1, 0, 0], up, two.l, n)),
        ],
        [*in_a_row(rows, n), Tie((n - 1, 1), (n, 0), joint), *in_a_row(rows, n, n)],
        [Support((0, 0), joints.clamped(rows))],
    )
    mesh = mesh.loaded(loads.point_force(mesh, (2 * n - 1, 1), [P, 0, P]))
    if kind is beam and rigid:
        mesh = mesh.sprung(corners.block(mesh, (n - 1, 1), h**3, rigid * E))
    q = statics.equilibrium(mesh, mesh.start(), steps=1, tolerance=1e-11)
    u = mesh.end(q, (2 * n - 1, 1))[0] - [L1, 0, L2]
    EI, EA = E * inertia, E * A
    # the force P along x bends the column and turns the corner; along z it bends the first member
    corner_turn = P * L2 * L1 / EI - P * L1**2 / (2 * EI)  # by the moment P L2 and by the force P along z, about +y
    x = P * L2**3 / (3 * EI) + P * L2 / kGA + corner_turn * L2 + P * L1 / EA
    z = P * L1**3 / (3 * EI) + P * L1 / kGA - P * L2 * L1**2 / (2 * EI) + P * L2 / EA
    return u[0] / x - 1, u[2] / z - 1


@pytest.mark.parametrize(
    ("kind", "n"), [(beam, 24), (cable, 4), pytest.param(cable_general, 4, marks=pytest.mark.long)]
)
def test_an_l_frame_bends_as_timoshenko_says(kind, n):
    assert max(map(abs, frame_tip(kind, n))) < 5e-3
    assert max(map(abs, frame_tip(kind, n, stiffer=1.03))) > 5e-3


def test_the_l_frame_of_beams_converges():
    """The L-frame of beams under the force along z converges with second order, with a rigid corner."""
    errors = [frame_tip(beam, n)[1] for n in (6, 12, 24)]
    rate = np.log2((errors[0] - errors[1]) / (errors[1] - errors[2]))
    assert 1.9 < rate < 2.2


def test_a_corner_by_gradient_transformation_alone_yields():
    """A corner by gradient transformation alone yields, the more the finer the elements.

    The moment passes by shear in one element of each member.
    """
    errors = [frame_tip(beam, n, rigid=0.0)[0] for n in (12, 24, 48)]
    assert errors == sorted(errors)
    assert errors[-1] > 0.1
    assert 1.8 < (errors[2] - errors[1]) / (errors[1] - errors[0]) < 2.2  # proportional to 1/l


def test_the_block_of_a_corner_has_a_potential_and_turns_freely():
    mesh = corner(beam, SHOE, "L")
    mesh = mesh.sprung(corners.block(mesh, (1, 1), 1e-3, 2e11))
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


# The spinning loop ------------------------------------------------------------------------------------------------


def spinning(kind, c, n=64, omega=5.0):
    """Equilibrium of a spinning free loop about its centre: elastic force = omega^2 M q."""
    mesh, _ = chain(kind, c, n, True)
    e = mesh.e0.reshape(n, 2, -1, 3).copy()
    e[:, :, 0] -= e[:, :, 0].mean(axis=(0, 1))
    q = mesh.fit(e)
    turn = mesh.fit(np.cross(Y, e)) - mesh.fit(np.zeros_like(e))
    hold = mesh.M @ turn / np.sqrt(turn @ mesh.M @ turn)  # nothing resists rotation: keep the azimuth
    for _ in range(12):
        K = mesh.tangent(q).toarray()
        S = omega**2 * mesh.M.toarray()
        residual = S @ q - mesh.force(q)
        dq = np.linalg.solve(K - S + abs(K).max() * np.outer(hold, hold), residual)
        q = q + dq
        if abs(dq).max() < 1e-13:
            break
    return mesh, q


def test_joint_force_and_hoop_strain_of_a_spinning_steel_loop():
    n, omega, m = 64, 5.0, 18.0
    mesh, q = spinning(cable, LINK, n, omega)
    Rc = PITCH / (2 * np.tan(np.pi / n))
    T = m * omega**2 * Rc / (2 * np.sin(np.pi / n))
    assert pytest.approx(7112.513, rel=1e-7) == T
    e = mesh.coordinates(q)
    residual = (mesh.internal(q) - omega**2 * (mesh.M_e @ e)).reshape(n, 4, 3)
    np.testing.assert_allclose(np.linalg.norm(residual[:, 0], axis=1), T, rtol=1e-5)
    e = e.reshape(n, 4, 3)
    hoop = np.linalg.norm(e[:, 2] - e[:, 0], axis=1) / PITCH - 1
    np.testing.assert_allclose(hoop, T / LINK.EA, rtol=5e-4)
    inside = T * np.cos(np.pi / n) + LINK.rhoA * omega**2 * PITCH**2 / 12  # mean along a straight link
    np.testing.assert_allclose(hoop, inside / LINK.EA, rtol=1e-5)
    assert abs(hoop - inside / (1.01 * LINK.EA)).min() > 1e-3 * hoop.max()
