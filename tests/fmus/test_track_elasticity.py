"""The three elasticities of the flexible track, in the same chain."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from flexible_track import LINKS, PITCH, TABLE, at_rest, carrier, correction, energy_gradient, hanging, swing
from scipy.optimize import brentq

from fmus.interface.model import InvalidParameter
from fmus.physics.ancf import cable, cable_engineering, cable_general, element
from fmus.physics.ancf.cable import Cable
from fmus.physics.ancf.element import ELASTICITIES
from fmus.physics.chain.flexible.cables import gather
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.interface import observe
from fmus.physics.chain.report import DISSIPATED, KINETIC, STRAIN, STRESS, T_MAX, T_MEAN, T_MIN
from tests.validation.ancf import joints, loads, mesh, statics

LIBRARY = {"small_deformation": cable, "general": cable_general, "engineering": cable_engineering}
SOFT = {"material.youngs_modulus": 2e6, "material.relaxation_time": 0.0}
# stretch -> tension / EA of a straight link
LAW = {
    "small_deformation": lambda s: 0.5 * s * (s * s - 1.0),
    "general": lambda s: 0.5 * s * (s * s - 1.0),
    "engineering": lambda s: s - 1.0,
}
# kernels of a chain with another elasticity than the default take half a minute
each = pytest.mark.parametrize(
    "elasticity", [pytest.param(e, marks=[pytest.mark.long] if e != "small_deformation" else []) for e in ELASTICITIES]
)


def coordinates(model) -> np.ndarray:
    """Coordinates of all links, shape (n, 4, 3)."""
    e = np.zeros((model.links_count, 4, 3))
    for i in range(model.links_count):
        gather(model.link, model.s.q, i, (i + 1) % model.nodes, e[i])
    return e


def bent(elasticity: str, links: int = 4, **changes):
    """A soft chain without any symmetry."""
    model = hanging(links=links, elasticity=elasticity, **{**SOFT, **changes})
    model.s.vdot[:] = 0.0
    model.s.q[:] += 0.05 * np.random.default_rng(3).standard_normal(model.s.q.shape) * ([PITCH] * 3 + [1.0] * 5)
    return model


def residual(model) -> np.ndarray:
    """Residuals of the links summed by coordinate of the pins, shape (nodes, 8)."""
    model.evaluate(Motion(model.s.q, model.s.v, model.s.vdot, model.s.axes))
    f, R = np.zeros_like(model.s.q), model.work.residual
    for i in range(model.links_count):
        j = (i + 1) % model.nodes
        f[i, :3] += R[i, 0]
        f[i, [5, 7, 6]] += R[i, 1]
        f[j, :3] += R[i, 2]
        f[j, [3, 7, 4]] += R[i, 3]
    return f


@pytest.mark.long
@each
def test_force_is_the_gradient_of_the_reported_energy(elasticity):
    model = bent(elasticity)
    f, gradient = residual(model), energy_gradient(model)
    np.testing.assert_allclose(f, gradient, atol=1e-8 * abs(f).max())
    assert abs(f - 1.001 * gradient).max() > 1e-4 * abs(f).max()


@each
def test_the_tangent_is_the_derivative_of_force_and_damping(elasticity):
    """The tangent is the derivative of force and damping, without the rotation of the chord."""
    model = bent(elasticity)
    link = model.link.element._replace(nuA=40.0)
    rng = np.random.default_rng(5)
    e, v, by_rate = coordinates(model)[1], rng.standard_normal((4, 3)), 37.0
    K, M = np.zeros((12, 12)), np.zeros((12, 12))
    element.tangent(link, e, v, by_rate, K)
    expected = np.zeros((12, 12))
    for k in range(12):
        for sign in (1, -1):
            d, Q = np.zeros(12), np.zeros((4, 3))
            d[k] = sign * 1e-6
            element.force(link, e + d.reshape(4, 3), v + by_rate * d.reshape(4, 3), Q)
            expected[:, k] += Q.ravel() / (2 * sign * 1e-6)
    np.testing.assert_allclose(K, expected, atol=2e-8 * abs(K).max())
    element.tangent(link._replace(nuI=0.2), e, v, by_rate, M)
    assert (M - K)[0, 0] == pytest.approx(12 * by_rate * 0.2 / link.l**3, rel=1e-6)


@each
def test_force_and_damping_add_up(elasticity):
    model = bent(elasticity)
    link = model.link.element._replace(nuA=40.0, nuI=0.2)
    e = coordinates(model)[2]
    v, Q, f = np.random.default_rng(7).standard_normal((4, 3)), np.zeros((4, 3)), np.zeros((4, 3))
    power = element.force(link, e, v, Q)
    assert element.force(link, e, np.zeros((4, 3)), f) == 0.0  # at rest the elastic force alone
    assert power == pytest.approx(element.damping(link, e, v, f), rel=1e-12)
    np.testing.assert_allclose(Q, f, atol=1e-12 * abs(f).max())
    others = [other for other in ELASTICITIES if other != elasticity]
    assert all(abs(stored(elasticity, link, e) / stored(other, link, e) - 1) > 1e-4 for other in others)


def stored(elasticity: str, link: Cable, e: np.ndarray) -> float:
    return element.energy(ELASTICITIES[elasticity](*link), e)


def newton(model, most: int = 20, extra: float = 0.0) -> list[float]:
    """Sizes of Newton's corrections (m) up to static equilibrium; ``extra`` mass (1/s2) spoils the matrix."""
    sizes = []
    while len(sizes) < most and (not sizes or sizes[-1] > 1e-11):
        sizes.append(correction(model, extra))
    return sizes


@each
@pytest.mark.parametrize(("young", "move", "near", "factor_"), [(2e6, 0.02, 3e-4, 200.0), (2e11, 1e-4, 2e-6, 3e5)])
def test_newton_converges_quadratically(elasticity, young, move, near, factor_):
    """Newton's method converges quadratically after one end was moved.

    Once a correction (m) is below ``near``, the next is below ``factor_`` times its square.
    """
    model = hanging(links=16, elasticity=elasticity, **{**SOFT, "material.youngs_modulus": young})
    model.s.q[-1, 0] -= move
    spoilt = model.s.q.copy()
    sizes = newton(model)
    assert sizes[-1] < 1e-11, sizes
    tail = [(a, b) for a, b in pairwise(sizes) if a < near]
    assert 1 <= len(tail) <= 3, sizes  # three corrections from there to 1e-11 m
    assert all(b < factor_ * a**2 + 1e-11 for a, b in tail), sizes
    model.s.q[:] = spoilt
    assert len(newton(model, extra=30.0)) > len(sizes) + 2  # twin: a wrong matrix


@pytest.mark.long
def test_steel_hangs_the_same():
    sags = [-hanging(elasticity=name).s.q[:, 2].min() for name in ELASTICITIES]
    assert np.ptp(sags) < 1e-5
    assert sags[0] == pytest.approx(2.589308, abs=2e-5)


def elastic_catenary(law, EA: float, weight: float, length: float, span: float) -> float:
    """Sag (m) of a continuous chain without bending stiffness and with tension = EA law(stretch)."""
    s = np.linspace(0.0, 0.5 * length, 4001)

    def shape(H: float) -> tuple[float, float]:
        T = np.hypot(H, weight * s)
        stretch = np.array([brentq(lambda x, t=t: law(x) - t, 1.0, 20.0) for t in T[::100] / EA])
        stretch = np.interp(s, s[::100], stretch)
        return 2.0 * np.trapezoid(stretch * H / T, s), np.trapezoid(stretch * weight * s / T, s)

    H = brentq(lambda H: shape(H)[0] - span, 1e-2 * weight * length, weight * length)
    return shape(H)[1]


@pytest.mark.long
def test_a_soft_chain_hangs_as_its_law_of_stretch_says():
    """A soft chain hangs as its stretch law says: the engineering chain hangs lower."""
    length, sag, said = LINKS * PITCH, {}, {}
    for name in ELASTICITIES:
        model = hanging(elasticity=name, **SOFT)
        c = model.link.element
        sag[name] = -model.s.q[:, 2].min()
        said[name] = elastic_catenary(LAW[name], c.EA, c.rhoA * 9.81, length, 0.8 * length)
        assert sag[name] == pytest.approx(said[name], rel=3e-4)
    lower = said["engineering"] - said["general"]
    assert lower > 0.1
    assert sag["engineering"] - sag["general"] == pytest.approx(lower, rel=2e-2)


@pytest.mark.long
@each
def test_a_soft_chain_finds_the_equilibrium_of_the_library(elasticity):
    """A soft chain finds the library's equilibrium from the shape of another elasticity."""
    n, other = 16, "engineering" if elasticity != "engineering" else "general"
    model = hanging(links=n, elasticity=elasticity, **SOFT)
    start = hanging(links=n, elasticity=other, **SOFT)
    assert abs(model.s.q[:, :3] - start.s.q[:, :3]).max() > 1e-3
    equilibrium = coordinates(model)
    part = mesh.Member(LIBRARY[elasticity], model.link.element, coordinates(start))
    ties = [mesh.Tie((k, 1), (k + 1, 0), joints.pin_cable([0, 1, 0])) for k in range(n - 1)]
    held = [mesh.Support((0, 0), joints.held(2)), mesh.Support((n - 1, 1), joints.held(2))]
    whole = mesh.Mesh([part], ties, held)
    whole = whole.loaded(loads.gravity(whole, [0, 0, -9.81]))
    solution = statics.newton(whole, whole.start(), 1.0, 1e-11, 40)
    assert solution is not None
    e = whole.split(whole.coordinates(solution[0]))[0]
    assert abs(e[:, [0, 2]] - equilibrium[:, [0, 2]]).max() < 1e-8
    assert model.report[STRAIN] == pytest.approx(whole.energy(solution[0]), rel=1e-8)


@each
def test_tension_and_stress_of_a_stretched_chain(elasticity):
    """The tension of links stretched by a fifth is the pins' force, EA law(1.2).

    The stress of (12) is E eps, that of the others tension over area.
    """
    stretch = 1.2
    model = hanging(links=8, elasticity=elasticity, start="polygon", **SOFT)
    model.environment = model.environment._replace(gravity=(0.0, 0.0, 0.0))
    model.s.q[:] = 0.0
    model.s.q[:, 0] = stretch * PITCH * np.arange(9)
    model.s.q[:, [3, 5]] = stretch
    c, f = model.link.element, residual(model)
    carried = c.EA * LAW[elasticity](stretch)
    assert -f[0, 0] == pytest.approx(carried, rel=1e-12)
    observe(model.link, model.environment, model.s, model.work, model.report)
    assert model.report[[T_MIN, T_MEAN, T_MAX]] == pytest.approx([carried] * 3, rel=1e-12)
    strained = carried / stretch if elasticity == "small_deformation" else carried
    assert model.report[STRESS] == pytest.approx(strained / model.link.area, rel=1e-12)


@each
def test_stress_of_a_bent_link(elasticity):
    """Stress of a steel link bent by 0.01 rad is E times fibre distance over radius."""
    model = hanging(links=2, elasticity=elasticity, start="polygon")
    angle, radius = 0.01, PITCH / 0.01
    turns = angle * np.arange(3)
    model.s.q[:, 0], model.s.q[:, 2] = radius * np.sin(turns), radius * (1 - np.cos(turns))
    for x in (3, 5):
        model.s.q[:, x], model.s.q[:, x + 1] = np.cos(turns), np.sin(turns)
    observe(model.link, model.environment, model.s, model.work, model.report)
    young = model.link.element.EA / model.link.area
    assert model.report[STRESS] == pytest.approx(young * model.link.outer_fibre / radius, rel=1e-4)


@pytest.mark.study  # a minute of compilation: contacts with links of another elasticity
def test_a_closed_track_settles_on_its_wheels():
    """A closed track of steel has the same tensions with every elasticity and stays at rest on its wheels."""
    outputs = {}
    for name in ELASTICITIES:
        model = carrier(elasticity=name)
        first, u = model.s.q.copy(), at_rest(model)
        for k in range(10):
            model.step(k * 1e-3, 1e-3, u)
        assert abs(model.s.v).max() < 1e-6
        assert abs(model.s.q - first).max() < 1e-8
        outputs[name] = np.zeros(model.link_ports)
        model.link_outputs(outputs[name])
    tensions = {name: y[:LINKS] for name, y in outputs.items()}
    scale = tensions["small_deformation"].max()
    assert scale > 1e3
    for name in ("general", "engineering"):
        np.testing.assert_allclose(tensions[name], tensions["small_deformation"], atol=1e-4 * scale)
        np.testing.assert_allclose(
            outputs[name][LINKS : 2 * LINKS], outputs["small_deformation"][LINKS : 2 * LINKS], rtol=2e-2, atol=1e5
        )


@pytest.mark.long
@each
def test_energy_ledger_of_a_swing(elasticity):
    """Kinetic + strain + gravity + dissipated energy of a swing of soft, damped links stays constant.

    The damping dissipates more than 0.1 % of the kinetic energy.
    """
    soft = {"material.youngs_modulus": 2e7, "material.relaxation_time": 2e-4}
    model, lacks = swing(200, links=8, elasticity=elasticity, integrator="runge_kutta", step=2e-5, **soft)
    assert abs(lacks).max() < 1e-6
    assert model.report[DISSIPATED] > 1e-3 * model.report[KINETIC]
    other, lacks = swing(200, links=8, elasticity=elasticity, step=5e-5, spectral_radius=0.9, **soft)
    assert abs(lacks).max() < 1e-4
    assert abs(model.s.q[:, :3] - other.s.q[:, :3]).max() < 1e-5  # explicit and implicit agree
    _, lacks = swing(200, links=8, elasticity=elasticity)  # steel, as in a scene
    assert abs(lacks).max() < 5e-3


@each
def test_the_explicit_step_follows_the_elasticity(elasticity):
    """The stable explicit step follows the elasticity.

    Local strain has modes within a link, average strain has none. The fastest mode of average strain is slower with the
    table's rotary inertia than with that of a rod.
    """
    track = TABLE["track"]
    rod = TABLE | {"track": track | {"inertia": (track["inertia"][0], track["mass"] * PITCH**2 / 12.0, 0.25)}}
    for table, average in ((TABLE, 8.045e-6), (rod, 8.012e-6)):
        model = hanging(links=2, elasticity=elasticity, start="polygon", table=table)
        assert model.stable_step == pytest.approx({"small_deformation": average}.get(elasticity, 5.538e-6), rel=1e-3)


@pytest.mark.long
def test_the_default_is_small_deformation():
    one, other = hanging(links=8), hanging(links=8, elasticity="small_deformation")
    third = hanging(links=8, elasticity="general")
    assert type(one.link.element) is Cable
    assert one.state.tobytes() == other.state.tobytes() != third.state.tobytes()


def test_an_unknown_elasticity_is_refused():
    with pytest.raises(InvalidParameter, match="elasticity = 'large': must be one of small_deformation, general, eng"):
        hanging(links=8, elasticity="large")
    port = next(port for port in hanging(links=8).ports if port.name == "elasticity")
    assert port.choices == tuple(ELASTICITIES)  # the FMU's shell checks these at the end of initialisation
