"""The track of rigid links behind its ports: rest, impulses, drive, agreement of integrators, errors."""

from __future__ import annotations

import numpy as np
import pytest
from m113 import LINKS, MASS, VEHICLE, P
from named_ports import outputs, parameters
from rigid_track import inputs, rolling
from vehicle_in_process import InProcess

from fmus.interface.model import InvalidParameter
from fmus.physics.chain.contacts import TOOTHED
from fmus.physics.chain.rigid.faces import add_last_correction
from fmus.physics.chain.rigid.links import pins as evaluate_pins
from fmus.physics.chain.rigid.links import residual
from fmus.physics.chain.rigid.newton import TOLERANCE
from fmus.physics.integrate import hht
from fmus.physics.integrate.generalized_alpha import Slopes
from fmus.physics.rigid import body
from fmus.track.choices import INTEGRATORS
from orchestrator.scene.scene import load

COARSE = [("generalized_alpha", 1e-5), ("hht", 1e-5)]  # integrators with tolerances of their iteration, m


@pytest.fixture(scope="module")
def track():
    model = rolling()
    model.initialise(parameters(model))
    return model, model.state.copy()


def test_rigid_links_show_the_forces_that_cables_show_at_rest():
    """Rigid links at rest have the forces of cables, between seated pins too.

    There T cos^2(pi/z), 9.5 % less, passes from link to link. A rim stretches the halves of a cable, by 2 % of its
    tension on the idler.
    """
    shown = {}
    for name, settings in {"rigid": ("rigid",), "cable": ("flexible",)}.items():
        track = InProcess(load("straight", settings[0], settings[1:]))["left_track"]
        shown[name] = track.link_outputs(), track["tension.mean"], track["tension.max"]
        tension = [k for k, output in enumerate(track.links) if output.endswith("tension")]
        force = [k for k, output in enumerate(track.links) if ".force." in output]
    for which, allowed in ((tension, 0.03), (force, 5e-3)):
        one, other = (shown[name][0][which] for name in ("rigid", "cable"))
        assert abs(other).max() > 1e4
        assert abs(one - other).max() < allowed * abs(other).max()
        assert abs(1.05 * one - other).max() > allowed * abs(other).max()
    assert shown["rigid"][1:] == pytest.approx(shown["cable"][1:], rel=3e-3)


@pytest.mark.long
@pytest.mark.parametrize(("integrator", "tolerance"), [*((name, TOLERANCE) for name in INTEGRATORS), *COARSE])
def test_impulses_on_the_wheels_balance_the_momentum(track, integrator, tolerance):
    """They do at any tolerance of Newton's iteration, and in steps of very different lengths."""
    model, state = track
    model.state[:] = state
    model.integrator, method = integrator, model.method
    model.method = method._replace(tolerance=tolerance)
    if integrator == "hht":
        model.method = model.method._replace(alpha=hht.coefficients(0.8))
    model.begin_run()
    s, t = model.s, 0.0
    for h in (*(1e-3,) * 30, *(1e-5, 1e-4, 1e-3) * 4):
        before = MASS * s.v[:, :3].sum(0)
        model.step(t, h, inputs(model, t, 20.0, lateral=0.05))
        t += h
        y = outputs(model)
        gained = MASS * s.v[:, :3].sum(0) - before
        force = [y[f"ground.force.{a}"] - sum(y[f"{w['name']}.force.{a}"] for w in model.wheel_list) for a in "xyz"]
        force[2] -= LINKS * MASS * 9.81
        assert np.abs(gained - h * np.array(force)).max() < 1e-9
    model.integrator, model.method = INTEGRATORS[0], method
    model.begin_run()
    assert np.abs(gained).max() > 0.1


def test_sprocket_drives_the_chain_over_wheels_and_ground(track):
    model, state = track
    model.state[:] = state
    model.counters[:] = 0
    for k in range(400):
        model.step(k * 1e-3, 1e-3, inputs(model, k * 1e-3, 10.0))
    y = outputs(model)
    pins = 10 * 10.0 * 0.3 / (2.0 * np.pi)  # teeth passed: half of the ramp of 0.2 s, and 0.2 s
    assert y["travel"] == pytest.approx(pins * P, rel=0.01)
    assert y["speed"] == pytest.approx(10 * P * 10.0 / (2.0 * np.pi), rel=0.04)
    assert y["energy.dissipated"] > 0.0
    assert model.counters[0] == 400
    assert model.counters[3] == 0
    assert model.counters[2] < 4 * 400
    evaluate_pins(model.rigid, model.s, model.work)
    worst = np.abs(model.work.system.gap).max()
    assert worst < 1e-11


def of_gaps(teeth, gaps, outer=VEHICLE["sprocket"]["outer_radius"], **places):
    """A track whose sprocket takes a pin in one of so many gaps."""
    shape = {"teeth": teeth, "gaps_per_pin": gaps, "outer_radius": outer}
    return rolling(sprocket=VEHICLE["sprocket"] | shape, **places)


def test_a_tooth_between_every_second_gap_leaves_the_bits(track):
    """Twenty teeth with ten pins a turn do what ten teeth do, where no pin climbs a tooth."""
    model, state = track
    model.state[:] = state
    dense = of_gaps(20, 2)
    dense.initialise(parameters(dense))
    for k in range(20):
        for each in (model, dense):
            each.step(k * 1e-3, 1e-3, inputs(each, k * 1e-3, 10.0))
    assert np.array_equal(dense.state, model.state)
    assert not np.array_equal(model.state, state)


@pytest.mark.parametrize(("teeth", "gaps", "outer"), [(10, 1, 0.26), (21, 2, 0.272), (25, 2, 0.324)])
def test_pins_lie_in_every_nth_gap(teeth, gaps, outer):
    """On the circle of teeth / gaps pins; the first lies in any gap, the furthest from other wheels."""
    model = of_gaps(teeth, gaps, outer, idler=-3.998 + 0.6 * (outer - 0.26) * np.pi)
    pins = model.polygon(rest=False)
    radius = 0.5 * P / np.sin(np.pi * gaps / teeth)
    on = np.flatnonzero(abs(np.hypot(*pins.T) - radius) < 1e-6)
    place = np.unwrap(np.sort(np.arctan2(pins[on, 1], pins[on, 0]))) * teeth / (2.0 * np.pi)
    assert len(on) >= 4
    assert abs(place - np.round(place)).max() < 1e-4
    assert np.diff(np.round(place)) == pytest.approx(gaps)


def with_lugs(lugs, links=LINKS):
    """A track whose links are cut into so many, with a lug on every so manyth pin."""
    laws = {k: v | {"stiffness": v["stiffness"] / lugs, "damping": v["damping"] / lugs} for k, v in CONTACT.items()}
    own = {"pitch": P / lugs, "mass": MASS / lugs, "inertia": [each / lugs for each in VEHICLE["track"]["inertia"]]}
    return rolling(
        links=links * lugs, sprocket=VEHICLE["sprocket"] | {"pins_per_gap": lugs}, track=VEHICLE["track"] | own,
        contact=VEHICLE["contact"] | {"wheel": laws["wheel"], "ground": laws["ground"]},
    )  # fmt: skip


CONTACT = {name: law for name, law in VEHICLE["contact"].items() if name != "sprocket"}


@pytest.mark.parametrize("lugs", [2, 3])
def test_a_rim_bears_the_links_between_lugs(monkeypatch, lugs):
    """Lugs lie in gaps, the pins between on the circle of all; without the rim these are far inside."""
    model, radius = with_lugs(lugs), 0.5 * P / lugs / np.sin(np.pi / (10 * lugs))
    pins = model.polygon(rest=False)
    on = np.flatnonzero(abs(np.hypot(*pins.T) - radius) < 1e-5)
    place = np.arctan2(pins[on, 1], pins[on, 0]) * 10.0 / (2.0 * np.pi)
    gaps = place[on % lugs == 0]
    assert len(gaps) >= 4
    assert abs(gaps - np.round(gaps)).max() < 1e-3
    assert abs(place - np.round(place))[on % lugs != 0].min() > 0.3
    model.initialise(parameters(model))
    face = radius * np.cos(np.pi / (10 * lugs)) - VEHICLE["track"]["face"]
    assert model.contacts.radius[0] == pytest.approx(face, rel=1e-14)

    def inside():
        """How far pins foremost on the sprocket, m, are inside the circle."""
        places = model.pins()[:, [0, 2]]
        return radius - np.hypot(*places[places[:, 0] > 0.0].T)

    assert inside().max() < 5e-3
    partners = model.contact_partners
    monkeypatch.setattr(model, "contact_partners", lambda p: teeth_alone(partners(p)))
    model.initialise(parameters(model))
    assert inside().max() > 8e-3, "the twin"


def teeth_alone(partners):
    """Contact partners without the rim of the sprocket."""
    return partners._replace(kind=np.where(np.arange(len(partners.kind)) == 0, TOOTHED, partners.kind))


def test_lugs_are_evenly_round():
    model = with_lugs(2)
    model.links_count -= 1
    with pytest.raises(InvalidParameter, match=r"links, 127, must be divisible by sprocket\.pins_per_gap = 2"):
        model.polygon()


def along_the_whole_chain(q, A, axis):
    """Increments (n, 6) of all links that move the whole chain rigidly: along an axis, or (3 to 5) about one."""
    x = np.zeros((len(q), 6))
    if axis < 3:
        x[:, axis] = 1.0
        return x
    turn = np.eye(3)[axis - 3]
    x[:, :3] = np.cross(turn, q[:, :3] - q[:, :3].mean(0))
    x[:, 3:] = np.einsum("nji,j->ni", A, turn)
    return x


def moved(q, x):
    """Poses of links after increments."""
    ends = np.empty_like(q)
    for before, increment, after in zip(q, x, ends, strict=True):
        body.advance(before, increment, after)
    return ends


@pytest.mark.long
def test_the_matrix_and_the_last_correction_are_derivatives_of_residual_and_forces(track):
    """For motions that open no pin, contacts included: of links, wheels, and what is shown of both.

    The rates outweigh the positions, in which the matrix leaves out how contacts grow.
    """
    model, start = track
    model.state[:] = start
    for k in range(60):
        model.step(1e-3 * k, 1e-3, inputs(model, 1e-3 * k, 20.0, 0.1, 0.1))
    s, w, by, eps = model.s, model.work, Slopes(0.0, 1e5, 0.0), 1e-10
    q, v = s.q.copy(), s.v.copy()
    forces = w.wrench[:, :3], w.wrench[:, 3:], w.on_links, s.load, w.along

    def at(q, v, tangent=False):
        s.q[:], s.v[:] = q, v
        w.increment[:] = 0.0
        residual(*model.system()[:2], model.environment, s, w, by, tangent)
        return [part.copy() for part in (w.system.residual, *forces)]

    for axis in range(6):
        _, *before = at(q, v, tangent=True)
        x = along_the_whole_chain(q, w.system.rotation, axis)
        given = [np.einsum("nij,nj->ni", w.system.iteration_matrix, x)]
        w.points.q[:] = q
        w.system.correction[:] = x
        add_last_correction(model.rigid, s, w)
        given += [now - then for now, then in zip(forces, before, strict=True)]
        ends = [at(moved(q, d * x), v + by.v * d * x) for d in (eps, -eps)]
        for part, after, earlier, allowed in zip(given, *ends, (3e-5, *5 * [1e-3]), strict=True):
            change = (after - earlier) / (2.0 * eps)
            assert abs(part - change).max() < allowed * abs(change).max(), axis
            assert abs(1.03 * part - change).max() > 1e-2 * abs(change).max()


def test_guides_take_the_chain_along_sideways(track):
    model, state = track
    model.state[:] = state
    for k in range(600):
        model.step(k * 1e-3, 1e-3, inputs(model, k * 1e-3, 0.0, lateral=0.05))
    off = model.pins()[:, 1] - 0.05 * 0.6
    play = VEHICLE["guide"]["clearance"]
    assert np.abs(off).max() < play + 2e-3
    free = rolling(guide={"clearance": 1.0}, contact={k: v | {"friction": 0.0} for k, v in VEHICLE["contact"].items()})
    free.initialise(parameters(free))
    for k in range(600):
        free.step(k * 1e-3, 1e-3, inputs(free, k * 1e-3, 0.0, lateral=0.05))
    assert np.abs(free.pins()[:, 1]).max() < 1e-3  # nothing moves it sideways
