"""Deformation modes at a pin: they satisfy its equations and have the strains of the paper."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.physics.ancf import beam
from tests.validation.ancf import joints, modes, torsion
from tests.validation.ancf.mesh import Member, Mesh, Tie

L, WIDTH, HEIGHT = 0.1524, 0.06, 0.04
STEEL = beam.Beam(L, WIDTH, HEIGHT, 7800.0, 2e11, 0.3, 0.85, torsion.factor(WIDTH, HEIGHT), False, 0.0)
AXES = {"y": (0.0, 1, 0), "z": (0.0, 0, 1), "oblique": (0.3, 0.8, -0.5), "x": (1.0, 0, 0)}
SIZE = 0.02
# strain jumps at the joint, on its axis, in the axes a, b, c of the pin; with a shear aa and cc are of second order
JUMPS = {"rotation": (), "bending": (), "stretch": ("aa",), "section": ("cc",), "shear": ("aa", "cc", "ac"),
         "lean": ("aa", "ab"), "twist": ("cc", "bc"), "pin stretch": ()}  # fmt: skip


def moved(mode, axis, before=False, size=SIZE):
    return modes.straight(L) + modes.displacement(mode, axis, size, L, before)


def energies(pair):
    return np.array([beam.energy(STEEL, np.ascontiguousarray(e)) for e in pair])


def named(E, axis):
    a = modes.triad(axis)
    E = a @ E @ a.T
    return {n + m: E["abc".index(n), "abc".index(m)] for n, m in ("aa", "bb", "cc", "ab", "ac", "bc")}


@pytest.mark.parametrize("before", [False, True])
@pytest.mark.parametrize("axis", AXES.values(), ids=AXES)
@pytest.mark.parametrize("mode", modes.MODES)
def test_every_mode_satisfies_the_pin_and_jumps_where_it_may(mode, axis, before):
    pair = moved(mode, axis, before)
    assert np.abs(modes.pin_rows(axis) @ pair.ravel()).max() < 1e-16
    one, other = (named(E, axis) for E in modes.at_joint(pair, L))
    jumping = {name for name in one if abs(one[name] - other[name]) > 1e-12}
    assert jumping == set(JUMPS[mode])
    held, strained = energies(pair)[::-1] if before else energies(pair)
    if mode == "rotation":
        assert max(held, strained) < 1e-14 * STEEL.E * L * WIDTH * HEIGHT
    else:
        assert strained > 1e-6 * STEEL.E * L * WIDTH * HEIGHT
        assert (held > 0.1 * strained) == (mode == "pin stretch")  # only this mode is shared


@pytest.mark.parametrize("axis", AXES.values(), ids=AXES)
def test_five_deformations_and_one_rotation(axis):
    """Strains of a node's 12 - 6 free coordinates have rank 5; the sixth is rotation; bb never jumps."""
    jump = modes.jump_of_strain(axis)
    assert np.linalg.matrix_rank(jump, 1e-6) == 5
    assert np.abs(jump[:, 0]).max() < 1e-9
    assert np.abs(jump[1]).max() < 1e-9
    changes = [modes.gradient_change(m, axis).ravel() for m in (modes.ROTATION, *modes.DEFORMATIONS)]
    assert np.linalg.matrix_rank(changes) == 6
    assert np.linalg.matrix_rank(modes.pin_rows(axis)) == 6
    assert 2 * 24 - 6 == 42  # coordinates of the pair
    b = modes.triad(axis)[1]
    assert max(np.abs(H.reshape(3, 3) @ b).max() for H in changes) < 1e-15


@pytest.mark.parametrize("axis", AXES.values(), ids=AXES)
def test_a_mesh_with_this_pin_can_move_in_every_mode(axis):
    """The pin of meshes is the same: 48 - 6 coordinates and all modes, unlike that of another axis."""

    def misfit(pin, pair):
        mesh = Mesh([Member(beam, STEEL, modes.straight(L))], [Tie((0, 1), (1, 0), joints.pin_beam(pin))])
        assert mesh.n == 42
        return np.abs(mesh.coordinates(mesh.fit(pair)) - pair.ravel()).max()

    for mode in modes.MODES:
        assert misfit(axis, moved(mode, axis)) < 1e-14
    other = np.roll(axis, 1)
    assert misfit(other, moved("rotation", axis)) > 1e-3


@pytest.mark.parametrize(("mode", "k"), [("stretch", 0), ("pin stretch", 1), ("section", 2)])
def test_a_stretch_is_the_length_of_its_gradient(mode, k):
    """Stretch and section (figures 8 a, c) have the strain s + s^2/2 behind the joint alone, the pin on both sides.

    It decays along the element, and there is no other strain.
    """
    expected, half = np.zeros((3, 3)), 0.5 * SIZE
    expected[k, k] = SIZE + SIZE**2 / 2
    pair = moved(mode, AXES["y"])
    before, behind = modes.at_joint(pair, L)
    np.testing.assert_allclose(behind, expected, atol=1e-16)
    np.testing.assert_allclose(before, expected * (mode == "pin stretch"), atol=1e-16)
    assert not np.allclose(modes.at_joint(moved(mode, AXES["y"], size=1.03 * SIZE), L)[1], expected, rtol=1e-2)
    for e, strained in zip(pair, (mode == "pin stretch", mode != "stretch"), strict=True):
        if mode != "stretch":
            middle = modes.strains(STEEL, e, 0.5, 0.0, 0.0)[k, k]
            assert middle == pytest.approx((half + half**2 / 2) * strained, rel=1e-12, abs=1e-15)


def test_a_pin_does_not_stretch_on_one_side_alone():
    one = modes.straight(L)
    one[1, 2] *= 1.0 + SIZE
    assert np.abs(modes.pin_rows(AXES["y"]) @ one.ravel()).max() == pytest.approx(SIZE)


def test_bending_strains_linearly_across_the_section():
    """Bending (figure 8 b) is 0 on the axis and z theta / l beside it: r_z turns by theta over the length."""
    pair, theta = moved("bending", AXES["y"], size=1e-4), 1e-4
    axial_strains = np.array([modes.at_joint(pair, L, z=z)[1][0, 0] for z in (-0.02, -0.01, 0.0, 0.01, 0.02)])
    assert abs(axial_strains[2]) < 1e-16
    np.testing.assert_allclose(
        axial_strains, -np.array([-0.02, -0.01, 0.0, 0.01, 0.02]) * theta / L, rtol=1e-4, atol=1e-12
    )
    assert np.abs(modes.at_joint(pair, L, z=0.02)[0]).max() < 1e-16  # the other element has no strain
    # relative to the line between the nodes: the gradient turns by theta, the chord stays
    assert pair[1, 1, 2] == pytest.approx(-theta, rel=1e-6)
    assert np.abs(pair[1, 4] - [L, 0, 0]).max() == 0.0
    # its strain energy is at least EI theta^2 4 / (2 l), that of a cantilever with an end couple; locking adds to it
    bending = STEEL.E * WIDTH * HEIGHT**3 / 12 * theta**2 / (2 * L)
    assert energies(pair)[1] > 4 * bending


def test_rotation_costs_nothing_at_any_angle():
    for angle in np.linspace(0.0, 2 * np.pi, 13):
        pair = moved("rotation", AXES["oblique"], size=angle)
        assert energies(pair).max() < 1e-14 * STEEL.E * L * WIDTH * HEIGHT
        assert np.abs(modes.pin_rows(AXES["oblique"]) @ pair.ravel()).max() < 1e-16 * 4
        wrong = modes.straight(L) + modes.displacement("rotation", AXES["y"], angle, L)
        off = np.abs(modes.pin_rows(AXES["oblique"]) @ wrong.ravel()).max()
        assert (off > 0.1) == (0 < angle % (2 * np.pi) < 6)


@pytest.mark.parametrize("mode", modes.MODES)
def test_the_pin_is_one_line_of_material(mode):
    """The pin is one line of material in all modes; beside its axis the sections may separate."""
    pair = moved(mode, AXES["oblique"])
    b = modes.triad(AXES["oblique"])[1]
    gaps = []
    for direction in (b - b[0] * np.eye(3)[0], np.array([0.0, 1.0, 0.0])):
        y, z = 0.01 * direction[1:]
        gaps.append(modes.position(pair[0], L, (1.0, y, z)) - modes.position(pair[1], L, (0.0, y, z)))
    # an oblique pin leaves the section: x along it adds its share of r_x
    slope = pair[0, 5] - pair[1, 1]
    assert np.abs(gaps[0] + 0.01 * b[0] * slope).max() < 1e-16
    assert (np.abs(gaps[1]).max() > 1e-6) == (mode not in ("pin stretch",))
