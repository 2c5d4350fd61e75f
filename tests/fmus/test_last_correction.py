"""Change of the contact forces by Newton's last correction: wheels and ground get what the chain gets."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import rigid_track
from flexible_track import LINKS, TABLE, at_rest, carrier, wheels
from named_ports import parameters

from fmus.interface.model import StepFailed
from fmus.physics.chain.flexible.axes_state import from_axes
from fmus.physics.chain.flexible.node_faces import add_last_correction
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.report import GROUND as REPORT_GROUND
from fmus.physics.integrate.generalized_alpha import Slopes
from fmus.track_flexible.model import Model

TRACK_CHAINS = {"fixed": {}, "planar": {"element": "planar"}, "free": {"axes": "free"}, "beam": {"element": "beam"}}
MARKS = {kind: [pytest.mark.long] for kind in ("planar", "free", "beam")}  # kernels of their own
CHAINS = [pytest.param(kind, marks=MARKS.get(kind, [])) for kind in TRACK_CHAINS]
BY = Slopes(0.0, 2e3, 4e6)
TURN = np.array([3e-8, -2e-8])  # of free axes, rad


class Chain:
    """A chain that slides on its wheels, with matrices at the present motion and a correction at random."""

    def __init__(self, kind: str, ground: bool) -> None:
        track = {"links": 64, "closed": True, "wheels": wheels(), "ground": ground, "gravity": 9.81, "ends": None}
        outputs = ["force", "ground", "wheels", "teeth", "rims", "horns"]
        self.model = Model({"vehicle": TABLE, "track": track, "link_outputs": outputs})
        self.model.initialise(parameters(self.model, **TRACK_CHAINS[kind]))
        u = at_rest(self.model)
        for k in range(len(self.model.wheel_list)):
            u[13 * k + 7 : 13 * k + 13] = 0.3, 0.0, -0.2, 0.0, 2.0, 0.0
        for n in range(3):
            self.model.step(n * 1e-3, 1e-3, u)
        s, rng = self.model.s, np.random.default_rng(3)
        dims = self.model.kit.ELEMENT[1]
        self.correction = 1e-8 * rng.standard_normal(s.q.shape)
        self.correction[:, :dims] *= 10.0

    def wrenches(self, change=0.0, fresh=False) -> np.ndarray:
        """Wrenches on wheels and ground with changed coordinates."""
        s, change = self.model.s, np.zeros_like(self.correction) + change
        self.model.evaluate(Motion(s.q + change, s.v + BY.v * change, s.vdot, s.axes), BY, fresh)
        return self.model.work.wrench.copy()

    def corrected(self, turn=(0.0, 0.0)) -> np.ndarray:
        """Change of the wrenches by the correction, as ``add_last_correction`` adds it."""
        s, w = self.model.s, self.model.work
        if w.axes is not None:
            w.axes.turn[:] = turn
        before = self.wrenches(fresh=True)
        add_last_correction(self.model.link, Motion(s.q, self.correction, w.still, s.axes), w)
        return w.wrench - before

    def by_matrices(self, turn=(0.0, 0.0)) -> np.ndarray:
        """Loads (n, rows, axes) by the correction on all links that touch, and on roll and yaw of free axes (n, 2)."""
        model, w = self.model, self.model.work
        change = np.zeros((model.links_count, w.stiffening.shape[1]))
        for i in np.flatnonzero(w.touched):
            e = np.zeros(model.kit.ELEMENT)
            model.kit.gather(model.link, self.correction, i, (i + 1) % model.nodes, e)
            z = np.concatenate([e.ravel(), turn]) if w.axes is not None else e.ravel()
            change[i] = w.stiffening[i] @ z
        self.on_axes = change[:, e.size :]
        return change[:, : e.size].reshape(-1, *e.shape)


@cache
def chain(kind: str, ground: bool) -> Chain:
    return Chain(kind, ground)


def turn_of(kind):
    return TURN if kind == "free" else np.zeros(2)


@pytest.mark.parametrize("kind", CHAINS)
def test_forces_on_wheels_and_ground_are_those_of_the_matrices(kind):
    c = chain(kind, True)
    given, half = c.corrected(turn_of(kind))[:, :3], c.model.kit.ELEMENT[0] // 2
    teeth = np.array([wheel["kind"] == "teeth" for wheel in c.model.wheel_list] + [False])
    loads = c.by_matrices(turn_of(kind))
    total = loads[:, [0, half]].sum(axis=(0, 1))
    in_space = total if len(total) == 3 else np.array([total[0], 0.0, total[1]])
    if kind == "free":
        in_space = np.array(from_axes(c.model.s.axes, in_space))
    size = abs(given).max()
    assert given[~teeth].sum(axis=0) == pytest.approx(in_space, abs=1e-9 * size)
    assert given[~teeth].sum(axis=0) != pytest.approx(1.03 * in_space, abs=1e-3 * size)
    assert abs(given[-1]).max() > 0.01 * size, "the ground has no part"


@pytest.mark.parametrize("kind", CHAINS)
def test_torques_on_wheels_are_those_of_the_matrices(kind):
    """The loads on a link do as much work in a rotation of its coordinates as the wrenches in that of the wheels."""
    c = chain(kind, False)
    given, w = c.corrected(turn_of(kind)), c.model.work
    rims = [k for k, wheel in enumerate(c.model.wheel_list) if wheel["kind"] != "teeth"]
    if kind == "free":
        for row in given:
            row[:3], row[3:] = (c.model.s.axes[:9].reshape(3, 3).T @ part for part in (row[:3], row[3:]))
    moment = sum(given[k, 3:] + np.cross(w.flat[k, :3], given[k, :3]) for k in rims)
    loads, e, about_y = c.by_matrices(turn_of(kind)), np.zeros(c.model.kit.ELEMENT), 0.0
    for i in range(c.model.links_count):
        c.model.kit.gather(c.model.link, c.model.s.q, i, (i + 1) % c.model.nodes, e)
        about_y += e[:, -1] @ loads[i, :, 0] - e[:, 0] @ loads[i, :, -1]
    size = abs(moment).max()
    assert moment[1] == pytest.approx(about_y, abs=1e-6 * size)
    assert moment[1] != pytest.approx(1.03 * about_y, abs=1e-3 * size)
    if kind == "free":
        assert moment[[0, 2]] == pytest.approx(c.on_axes.sum(axis=0), abs=1e-6 * size)


@pytest.mark.parametrize("kind", CHAINS)
def test_wrench_of_the_teeth_is_a_derivative(kind):
    """The matrix of the teeth is exact, so differences of their wrench give its change but for that of the levers."""
    c = chain(kind, True)
    given = c.corrected()[0]
    expected = 0.5 * (c.wrenches(c.correction) - c.wrenches(-c.correction))[0]
    size = abs(expected[:3]).max()
    assert given[:3] == pytest.approx(expected[:3], abs=1e-4 * size)
    assert given[:3] != pytest.approx(1.01 * expected[:3], abs=1e-4 * size)
    assert given[3:] == pytest.approx(expected[3:], abs=0.005 * size)
    assert given[3:] + 0.01 * size != pytest.approx(expected[3:], abs=0.005 * size)


@pytest.mark.parametrize("tolerance", [1e-5, 1e-7])
def test_momentum_goes_where_the_wrenches_say(tolerance):
    """Change of momentum of the chain = impulse of weight - impulse on wheels and ground.

    The last corrections of a step are as large as the tolerance allows; the matrix of the second is kept.
    """
    model = carrier(tolerance=tolerance)
    u = at_rest(model)
    for k, wheel in enumerate(model.wheel_list):
        u[13 * k + 7 : 13 * k + 10] = 0.5, 0.0, -0.3
        u[13 * k + 11] = 3.0 if wheel["kind"] == "teeth" else 1.0

    def momentum() -> np.ndarray:
        p = np.zeros(3)
        for i in range(LINKS):
            j = (i + 1) % LINKS
            slopes = np.array([model.s.v[i, [5, 7, 6]], model.s.v[j, [3, 7, 4]]])
            c = model.link.element
            ends = model.s.v[i, :3] + model.s.v[j, :3]
            p += c.rhoA * c.l * (ends / 2 + c.l / 12 * (slopes[0] - slopes[1]))
        return p

    c = model.link.element
    weight = np.array([0, 0, -LINKS * c.rhoA * c.l * 9.81])
    corrections = []
    t = 0.0
    for h in (2e-3, 2e-3, 2e-3, 1e-5, 2e-4, 2e-3):  # short steps too
        before = momentum()
        model.step(t, h, u)
        t += h
        given = model.s.mean[:-1, :3].sum(axis=0) - model.report[REPORT_GROUND : REPORT_GROUND + 3]
        allowed = 2e-12 * abs(given * 2e-3).max()
        np.testing.assert_allclose(momentum() - before, h * (weight - given), rtol=0.0, atol=allowed)
        corrections.append(abs(model.work.points.step[:, :3]).max())
    assert max(corrections) > 0.1 * tolerance
    assert not np.allclose(momentum() - before, h * (weight - 1.03 * given), atol=2e-6 * abs(given * h).max())


def sliding_rods():
    model = rigid_track.rolling()
    model.initialise(parameters(model))
    return model, rigid_track.inputs(model, 0.0, 0.0)


def sliding_cables():
    model = carrier()
    return model, at_rest(model)


@pytest.mark.parametrize("build", [sliding_rods, sliding_cables])
def test_contact_points_beyond_their_arrays_are_refused(build):
    """The room is what fits side by side; a chain that needs more is told with its number of points."""
    model, u = build()
    state, kept = model.state.copy(), model.work
    model.step(0.0, 1e-3, u)
    used, room = int(kept.points.number[0]), len(kept.points.which)
    assert 0 < used < room == model.most_points < 8 * LINKS * (len(model.wheel_list) + 1)
    model.state[:] = state
    model.work = kept._replace(points=kept.points._replace(which=kept.points.which[: used // 2]))
    model.begin_run()
    with pytest.raises(StepFailed, match=r"touches wheels and ground at \d+ points at t = 0 s, link \d+: "):
        model.step(0.0, 1e-3, u)
    assert np.array_equal(model.state, state)
