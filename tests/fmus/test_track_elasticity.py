"""The three elasticities of cables, and beams, in the same chain."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from flexible_track import LINKS, PITCH, TABLE, coordinates, correction, energy_gradient, hanging, scattered, swing
from scipy.optimize import brentq

from fmus.physics.ancf import beam, cable, cable_engineering, cable_general
from fmus.physics.ancf.element import ELASTICITIES
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.interface import observe
from fmus.physics.chain.report import DISSIPATED, KINETIC, STRAIN
from tests.validation.ancf import joints, loads, mesh, statics

LIBRARY = {"small_deformation": cable, "general": cable_general, "engineering": cable_engineering, "beam": beam}
SOFT = {"material.youngs_modulus": 2e6, "material.relaxation_time": 0.0}
# stretch -> tension / EA of a straight link
LAW = {
    "small_deformation": lambda s: 0.5 * s * (s * s - 1.0),
    "general": lambda s: 0.5 * s * (s * s - 1.0),
    "engineering": lambda s: s - 1.0,
}
# kernels of a chain with another elasticity or element than the default take half a minute
each = pytest.mark.parametrize(
    "kind", [pytest.param(e, marks=[pytest.mark.long] if e != "small_deformation" else []) for e in LIBRARY]
)
cables = pytest.mark.parametrize(
    "kind", [pytest.param(e, marks=[pytest.mark.long] if e != "small_deformation" else []) for e in ELASTICITIES]
)


def hung(kind: str, **changes):
    """A hanging chain of a kind."""
    return hanging(**({"element": kind} if kind == "beam" else {"elasticity": kind}), **changes)


@each
def test_force_is_the_gradient_of_the_reported_energy(kind):
    """Of a soft chain without any symmetry."""
    model = hung(kind, links=4, **SOFT)
    model.s.vdot[:] = 0.0
    noise = np.random.default_rng(3).standard_normal(model.s.q.shape)
    model.s.q[:] += 0.05 * noise * ([PITCH] * 3 + [1.0] * (noise.shape[1] - 3))
    model.evaluate(Motion(model.s.q, model.s.v, model.s.vdot, model.s.axes))
    f, gradient = scattered(model, model.work.residual), energy_gradient(model)
    np.testing.assert_allclose(f, gradient, atol=1e-8 * abs(f).max())
    assert abs(f - 1.001 * gradient).max() > 1e-4 * abs(f).max()


def newton(model, most: int = 20, extra: float = 0.0) -> list[float]:
    """Sizes of Newton's corrections (m) up to static equilibrium; ``extra`` mass (1/s2) spoils the matrix."""
    sizes = []
    while len(sizes) < most and (not sizes or sizes[-1] > 1e-11):
        sizes.append(correction(model, extra))
    return sizes


@cables
@pytest.mark.parametrize(("young", "move", "near", "factor_"), [(2e6, 0.02, 3e-4, 200.0), (2e11, 1e-4, 2e-6, 3e5)])
def test_newton_converges_quadratically(kind, young, move, near, factor_):
    """Newton's method converges quadratically after one end was moved.

    Once a correction (m) is below ``near``, the next is below ``factor_`` times its square.
    """
    model = hung(kind, links=16, **{**SOFT, "material.youngs_modulus": young})
    model.s.q[-1, 0] -= move
    spoilt = model.s.q.copy()
    sizes = newton(model)
    assert sizes[-1] < 1e-11, sizes
    tail = [(a, b) for a, b in pairwise(sizes) if a < near]
    assert 1 <= len(tail) <= 3, sizes  # three corrections from there to 1e-11 m
    assert all(b < factor_ * a**2 + 1e-11 for a, b in tail), sizes
    model.s.q[:] = spoilt
    assert len(newton(model, extra=30.0)) > len(sizes) + 2  # twin: a wrong matrix


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
        model = hung(name, **SOFT)
        c = model.link.element
        sag[name] = -model.s.q[:, 2].min()
        said[name] = elastic_catenary(LAW[name], c.EA, c.rhoA * 9.81, length, 0.8 * length)
        assert sag[name] == pytest.approx(said[name], rel=3e-4)
    lower = said["engineering"] - said["general"]
    assert lower > 0.1
    assert sag["engineering"] - sag["general"] == pytest.approx(lower, rel=2e-2)


@pytest.mark.long
@each
def test_a_soft_chain_finds_the_equilibrium_of_the_library(kind):
    """The same mesh in the library, with its own pins, gravity and Newton method, from the shape of another chain."""
    n, soft = 16, SOFT | ({"material.youngs_modulus": 2e7} if kind == "beam" else {})
    model = hung(kind, links=n, **soft)
    if kind == "beam":
        start, pin = hung(kind, links=n), joints.pin_beam([0.0, 1.0, 0.0])
        held = pin.free_directions  # position and axis of the pin are fixed to the ground
        newton(model, 3)  # the start is in equilibrium to 1e-3 N
        model.evaluate(Motion(model.s.q, 0.0 * model.s.q, 0.0 * model.s.q, model.s.axes))
        observe(model.link, model.environment, model.s, model.work, model.report)
    else:
        start = hung("engineering" if kind != "engineering" else "general", links=n, **soft)
        pin, held = joints.pin_cable([0, 1, 0]), joints.held(2)
    assert abs(coordinates(model) - coordinates(start)).max() > 1e-3
    part = mesh.Member(LIBRARY[kind], model.link.element, coordinates(start))
    ties = [mesh.Tie((k, 1), (k + 1, 0), pin) for k in range(n - 1)]
    whole = mesh.Mesh([part], ties, [mesh.Support((0, 0), held), mesh.Support((n - 1, 1), held)])
    whole = whole.loaded(loads.gravity(whole, [0, 0, -9.81]))
    solution = statics.newton(whole, whole.start(), 1.0, 1e-11, 60)
    assert solution is not None
    e = whole.split(whole.coordinates(solution[0]))[0]
    assert abs(e - coordinates(model))[..., [0, 2]].max() < 1e-8
    assert model.report[STRAIN] == pytest.approx(whole.energy(solution[0]), rel=1e-8)


@pytest.mark.long
@each
def test_energy_ledger_of_a_swing(kind):
    """Kinetic + strain + gravity + dissipated energy of a swing of soft, damped links stays constant.

    The damping dissipates many times the error that is allowed.
    """
    links, steps, step, lost = (4, 100, 1.0, 0.6e-4) if kind == "beam" else (8, 200, 2e-5, 1e-3)
    given = {"element": kind} if kind == "beam" else {"elasticity": kind}
    soft = {"material.youngs_modulus": 2e7, "material.relaxation_time": 2e-4, "links": links}
    model, lacks = swing(steps, integrator="runge_kutta", step=step, **soft, **given)
    assert abs(lacks).max() < 1e-6
    assert model.report[DISSIPATED] > lost * model.report[KINETIC]
    other, lacks = swing(steps, step=5e-5, spectral_radius=0.9, **soft, **given)
    assert abs(lacks).max() < 1e-4
    assert abs(model.s.q[:, :3] - other.s.q[:, :3]).max() < 1e-5  # explicit and implicit agree
    _, lacks = swing(steps, links=8, **given)  # steel, as in a scene
    assert abs(lacks).max() < 5e-3


@each
def test_the_explicit_step_follows_the_element_and_its_mass(kind):
    """Local strain has modes within a link, average strain has none; the table's rotary inertia slows the fastest."""
    track, mass = TABLE["track"], TABLE["track"]["mass"]
    slender = track["inertia"][0], mass * PITCH**2 / 12.0, 0.25
    expected = {"small_deformation": (8.045e-6, 8.012e-6), "beam": (4.695e-6, 4.347e-6)}.get(kind, (5.538e-6, 5.538e-6))
    if kind == "beam":
        x, y, z = (mass * size**2 / 12.0 for size in (PITCH, *hung(kind, links=2).link.element[1:3]))
        slender = y + z, z + x, x + y
    for inertia, step in zip((track["inertia"], slender), expected, strict=True):
        model = hung(kind, links=2, start="polygon", table=TABLE | {"track": track | {"inertia": inertia}})
        assert model.stable_step == pytest.approx(step, rel=1e-3)
