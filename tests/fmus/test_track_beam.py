"""The flexible track of beams: pins that turn with the vehicle; forces, equilibria, energies, ports."""

from __future__ import annotations

from functools import partial

import flexible_track
import numpy as np
import pytest
from beam_chains import coordinates, scattered
from flexible_track import (
    LINKS,
    PITCH,
    TABLE,
    carrier,
    correction,
    energy_gradient,
    hanging,
    make,
    second_steps,
    wheels,
)
from fmpy.validation import validate_fmu
from named_ports import parameters

from fmus.fmi.build import build
from fmus.interface.model import InvalidParameter
from fmus.physics.ancf import beam as library
from fmus.physics.ancf import element as elements
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.interface import observe
from fmus.physics.chain.report import DISSIPATED, KINETIC, STRAIN
from orchestrator.cosim.component import Component
from tests.validation.ancf import joints, loads, mesh, statics, torsion

pytestmark = pytest.mark.long  # kernels of their own

SOFT = {"material.youngs_modulus": 2e7, "material.relaxation_time": 0.0}
Y = np.array([0.0, 1.0, 0.0])


def spun(element: str, rate):
    """A free loop, released as a regular polygon that turns at ``rate`` (3) about its middle."""
    model = make({"wheels": wheels(), "gravity": 0.0}, start="polygon", element=element)
    model.contacts, model.environment = None, model.environment._replace(mount=-1)
    model.rows, model.work = np.zeros((0, 15)), model.work._replace(wheels=np.zeros((0, 15)), flat=np.zeros((0, 15)))
    angle = 2 * np.pi * np.arange(LINKS) / LINKS
    radius = PITCH / (2 * np.sin(np.pi / LINKS))
    model.settle_pins(radius * np.stack([np.cos(angle), -np.sin(angle)], axis=1))
    rate = np.asarray(rate, float)
    if element == "beam":
        model.s.v[:] = np.cross(rate, model.s.q.reshape(-1, 6, 3)).reshape(model.s.q.shape)
    else:  # its pins cannot turn: the slope along y stays constant
        q, v = model.s.q, model.s.v
        v[:, :3] = np.cross(rate, q[:, :3])
        for x in (3, 5):
            slope = np.stack([q[:, x], np.zeros(LINKS), q[:, x + 1]], axis=1)
            v[:, [x, x + 1]] = np.cross(rate, slope)[:, [0, 2]]
    return model


def newton(model, count: int, mass: float = 0.0) -> None:
    """Make ``count`` Newton corrections to equilibrium; ``mass`` (1/s2) enters the matrix only."""
    for _ in range(count):
        correction(model, mass)
    model.evaluate(Motion(model.s.q, np.zeros_like(model.s.q), np.zeros_like(model.s.q), model.s.axes))


def test_coordinates_of_a_track():
    """A track of beams has 64 x 24 less 64 x 6 coordinates; an open chain keeps its end gradients."""
    assert carrier(element="beam").s.q.size == 1152
    chain = hanging(element="beam")
    assert chain.s.q.size - 2 * 6 == 1158
    closed = make({"links": LINKS, "wheels": wheels()}, start="polygon", element="beam")
    indices = coordinates(closed, np.arange(1152.0).reshape(closed.s.q.shape))  # index of each coordinate
    assert len(np.unique(indices)) == 1152 == 64 * 24 - 64 * 6  # none is unused
    e = coordinates(closed, np.random.default_rng(1).standard_normal(closed.s.q.shape))
    pin = joints.pin_beam(Y)
    for before, after in zip(e, np.roll(e, -1, axis=0), strict=True):
        one, other = before[4:].ravel(), after[:4].ravel()
        rest = other - pin.transfer @ one  # the motion that joint (3) leaves free
        assert abs(rest - pin.free_directions @ (pin.free_directions.T @ rest)).max() < 1e-14
    assert pin.equations == 6


def test_force_is_the_gradient_of_the_reported_energy():
    model = hanging(links=3, element="beam", **SOFT)
    model.s.vdot[:] = 0.0
    model.s.q[:] += 0.02 * np.random.default_rng(3).standard_normal(model.s.q.shape) * ([PITCH] * 3 + [1.0] * 15)
    model.evaluate(Motion(model.s.q, model.s.v, model.s.vdot, model.s.axes))
    f, gradient = scattered(model, model.work.residual), energy_gradient(model)
    np.testing.assert_allclose(f, gradient, atol=1e-8 * abs(f).max())
    assert abs(f - 1.001 * gradient).max() > 1e-4 * abs(f).max()


def test_the_matrix_is_the_derivative_of_force_and_damping():
    c = library.Beam(PITCH, 0.378, 0.04, 7800.0, 2e7, 0.3, 5 / 6, 0.04, True, 1e-3)
    rng, by_rate, step = np.random.default_rng(2), 300.0, 1e-5
    e = np.vstack([np.zeros(3), np.eye(3), [c.l, 0, 0], np.eye(3)]) + 0.02 * rng.standard_normal((8, 3))
    v, K = rng.standard_normal((8, 3)), np.zeros((24, 24))
    library.tangent(c, e, v, by_rate, K)

    def force(d: np.ndarray) -> np.ndarray:
        Q = np.zeros((8, 3))
        elements.force(c, e + d.reshape(8, 3), v + by_rate * d.reshape(8, 3), Q)
        return Q.ravel()

    numeric = np.array([(force(step * d) - force(-step * d)) / (2 * step) for d in np.eye(24)]).T
    assert abs(K - numeric).max() < 1e-7 * abs(K).max()
    other = np.zeros((24, 24))
    library.tangent(c._replace(tau=1.03 * c.tau), e, v, by_rate, other)
    assert abs(other - numeric).max() > 1e-3 * abs(K).max()


def test_a_hanging_chain_finds_the_equilibrium_of_the_library():
    """A hanging chain has the equilibrium of the same mesh in the library.

    The library has the pins of joint (3), its own gravity and its own Newton method.
    """
    n, model = 16, hanging(links=16, element="beam", **SOFT)
    newton(model, 3)  # the start is in equilibrium to 1e-3 N
    observe(model.link, model.environment, model.s, model.work, model.report)
    steel = hanging(links=16, element="beam")
    assert abs(coordinates(steel) - coordinates(model)).max() > 1e-3
    part = mesh.Member(library, model.link.element, coordinates(steel))
    ties = [mesh.Tie((k, 1), (k + 1, 0), joints.pin_beam(Y)) for k in range(n - 1)]
    free = joints.pin_beam(Y).free_directions  # r and r_y are fixed to the ground
    whole = mesh.Mesh([part], ties, [mesh.Support((0, 0), free), mesh.Support((n - 1, 1), free)])
    assert whole.start().size == n * 24 - (n + 1) * 6
    whole = whole.loaded(loads.gravity(whole, [0, 0, -9.81]))
    solution = statics.newton(whole, whole.start(), 1.0, 1e-11, 60)
    assert solution is not None
    e = whole.split(whole.coordinates(solution[0]))[0]
    assert abs(e - coordinates(model)).max() < 1e-8
    assert model.report[STRAIN] == pytest.approx(whole.energy(solution[0]), rel=1e-8)


def test_sideways_a_chain_of_pins_is_one_beam():
    """Laterally a chain with pins is one Timoshenko beam: F = 12 EI d / (L^3 (1 + phi)).

    Its pins clamp both ends; one end is moved aside.
    """
    n, aside = 16, 1e-3
    model = hanging(links=n, element="beam", start="polygon")
    model.settle_pins(np.column_stack([PITCH * np.arange(n + 1), np.zeros(n + 1)]))
    model.environment = model.environment._replace(gravity=(0.0, 0.0, 0.0))
    model.s.q[-1, 1] += aside
    newton(model, 12, mass=1.0)  # a little mass stabilises the straight chain, which can fold up and down
    force = model.work.residual[-1, 4, 1]
    c, L, area = model.link.element, n * PITCH, TABLE["section"]["area"]
    EI = model.link.young * TABLE["section"]["lateral_bending"]
    phi = 12 * EI / (c.shear * 0.5 * model.link.young / (1 + c.nu) * area * L**2)
    expected = 12 * EI * aside / (L**3 * (1 + phi))
    assert force == pytest.approx(expected, rel=1e-2)
    assert force != pytest.approx(1.03 * expected, rel=1e-2)
    assert force != pytest.approx(expected * (1 + phi), rel=1e-2)


def test_a_chain_twists_as_its_section_says():
    """A chain twists by torque = G J angle / length, J = section.torsion, for any bending."""
    n, angle, section = 4, 1e-3, TABLE["section"]
    assert section["torsion"] == pytest.approx(torsion.constant(0.378, 0.0401), rel=1e-3)

    def torque(**changes):
        ends = {"kind": "pinned", "first": [0.0, 0.0], "last": [0.8 * n * PITCH, 0.0]}
        track = {"links": n, "closed": False, "ends": ends, "gravity": 0.0}
        model = make(track, TABLE | {"section": section | changes}, element="beam", start="polygon")
        model.settle_pins(np.column_stack([PITCH * np.arange(n + 1), np.zeros(n + 1)]))
        model.s.q[-1, 4:6] = np.cos(angle), np.sin(angle)
        newton(model, 12, mass=1.0)
        assert abs(model.work.right_side).max() < 1e-3
        return np.cross(model.s.q[-1, 3:6], model.work.residual[-1, 6])[0]

    expected = TABLE["material"]["shear_modulus"] * section["torsion"] * angle / (n * PITCH)
    assert torque() == pytest.approx(expected, rel=2e-3)
    assert torque(torsion=1.03 * section["torsion"]) == pytest.approx(1.03 * expected, rel=2e-3)
    assert torque(bending=1.03 * section["bending"]) == pytest.approx(expected, rel=2e-3)
    assert torque(lateral_bending=0.97 * section["lateral_bending"]) == pytest.approx(expected, rel=2e-3)


def test_a_free_loop_keeps_energy_and_angular_momentum_about_every_axis():
    """A free loop that spins and yaws keeps energy and angular momentum about every axis.

    A loop of cables does not: its pins take moments about the other axes.
    """

    def momentum(model, M) -> np.ndarray:
        if model.kind.element == "beam":
            e, v = coordinates(model), coordinates(model, model.s.v)
        else:
            e, v = np.zeros((2, LINKS, 4, 3))
            for i in range(LINKS):
                model.kit.gather(model.link, model.s.q, i, (i + 1) % LINKS, e[i])
                model.kit.gather(model.link, model.s.v, i, (i + 1) % LINKS, v[i])
        return np.cross(e, np.einsum("ab,nbj->naj", M, v)).sum((0, 1))

    lost = {}
    for element in ("beam", "cable"):
        model = spun(element, [0.0, 2.0, 1.0])
        model.advance(0.0, 1e-3)
        start, energy = momentum(model, model.work.mass), model.report[[KINETIC, STRAIN, DISSIPATED]].sum()
        for k in range(1, 100):
            model.advance(k * 1e-3, 1e-3)
        lost[element] = abs(momentum(model, model.work.mass) - start).max() / abs(start).max()
        if element == "beam":
            assert model.report[[KINETIC, STRAIN, DISSIPATED]].sum() == pytest.approx(energy, rel=1e-3)
            assert abs(start[2]) > 0.1 * abs(start[1])
    assert lost["beam"] < 1e-5
    assert lost["cable"] > 1e-2


swing = partial(flexible_track.swing, 100, element="beam")


def test_energy_ledger_of_a_swing_and_the_explicit_chain():
    soft = {"material.youngs_modulus": 2e7, "material.relaxation_time": 2e-4}
    model, lacks = swing(links=4, integrator="runge_kutta", step=1.0, **soft)
    assert abs(lacks).max() < 1e-6
    # 30 times the allowed energy error; 0.89e-4, and 1.08e-4 before links had the table's rotary inertia
    assert model.report[DISSIPATED] > 0.6e-4 * model.report[KINETIC]
    other, lacks = swing(links=4, step=5e-5, spectral_radius=0.9, **soft)
    assert abs(lacks).max() < 1e-4
    assert abs(model.s.q[:, :3] - other.s.q[:, :3]).max() < 1e-5
    _, lacks = swing(links=8)  # steel, as in a scene
    assert abs(lacks).max() < 5e-3


def test_the_explicit_step_and_the_mass():
    """The stable explicit step follows the mass: rotary inertia slows the fastest mode."""
    model = hanging(links=2, element="beam", start="polygon")
    assert model.stable_step == pytest.approx(4.695e-6, rel=1e-3)
    x, y, z = (TABLE["track"]["mass"] * size**2 / 12.0 for size in (PITCH, *model.link.element[1:3]))
    table = TABLE | {"track": TABLE["track"] | {"inertia": (y + z, z + x, x + y)}}
    alone = hanging(links=2, element="beam", start="polygon", table=table)
    assert alone.stable_step == pytest.approx(4.347e-6, rel=1e-3)
    total = model.work.mass[np.ix_([0, 4], [0, 4])].sum()
    assert total == pytest.approx(TABLE["track"]["mass"], rel=1e-12)


def test_a_copied_state_goes_on_bit_for_bit():
    after, again = second_steps(carrier(element="beam"))
    assert again == after


def test_one_component_takes_either_element():
    model, fresh = hanging(links=8, element="beam"), hanging(links=8)
    size = model.state.size
    model.initialise(parameters(model))
    assert model.state.tobytes() == fresh.state.tobytes()
    model.initialise(parameters(model, element="beam"))
    assert model.state.size == size > fresh.state.size


def test_the_component_of_beams():
    """The FMU of beams passes fmpy's validation and continues alike from any saved state."""
    ends = {"kind": "pinned", "first": [0.0, 0.0], "last": [0.9, 0.0]}
    track = {"links": 8, "closed": False, "wheels": [], "ground": False, "gravity": 9.81, "ends": ends}
    fmu = build("TrackFlexible", {"vehicle": TABLE, "track": track, "link_outputs": True})
    assert validate_fmu(str(fmu)) == []
    with Component(fmu, "chain") as chain:
        blank = chain.save()
        chain.initialise({"element": "beam", "start": "displaced"})
        chain.step(0.0, 1e-3)
        state = chain.save()
        outputs = []
        for _ in range(2):
            chain.step(1e-3, 1e-3)
            chain.read()
            outputs.append(chain.y.copy())
            chain.restore(state)
        assert np.array_equal(*outputs)
        chain.restore(blank)  # a state from before the element was chosen


def test_what_cannot_be_is_refused():
    with pytest.raises(InvalidParameter, match="element = 'shell': must be one of cable, planar, beam"):
        hanging(links=8, element="shell")
    with pytest.raises(InvalidParameter, match="elasticity = 'general' needs element = 'cable'"):
        hanging(links=8, element="beam", elasticity="general")
    material = TABLE["material"] | {"shear_modulus": 50e9}
    with pytest.raises(InvalidParameter, match=r"shear_modulus = 5.*Poisson's ratio 1, of a beam 0 or more"):
        make({"wheels": wheels()}, TABLE | {"material": material}, element="beam")
