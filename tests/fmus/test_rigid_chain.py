"""The chain of rigid links against closed forms and balances."""

from __future__ import annotations

import numpy as np
import pytest
from m113 import MASS, TRACK, P

from fmus.physics.chain.explicit import slopes
from fmus.physics.chain.implicit import ImplicitMethod
from fmus.physics.chain.integration import LOOP, Environment
from fmus.physics.chain.layout import close_exactly
from fmus.physics.chain.report import COUNTERS, REPORT
from fmus.physics.chain.rigid.dynamics import accelerations, pin_motion
from fmus.physics.chain.rigid.links import RigidLinks, pins, place
from fmus.physics.chain.rigid.newton import TOLERANCE
from fmus.physics.chain.rigid.state import State, shapes, work
from fmus.physics.chain.state import size, store_first_evaluation, views
from fmus.physics.integrate.generalized_alpha import coefficients
from fmus.physics.rigid.augmented import Ends
from fmus.track import steps as track_steps

pytestmark = pytest.mark.long  # kernels of their own


class Chain:
    """A chain without ports, wheels and ground."""

    def __init__(self, pins, ends, gravity=0.0, inertia=TRACK["inertia"], pitch=P, mass=MASS, radius=0.8):
        n = len(pins) if ends.closed else len(pins) - 1
        inertia = np.array(inertia, float)
        self.link = RigidLinks(0.5 * pitch, TRACK["face"], 0.25 * TRACK["width"], mass, inertia, ends)
        self.method = ImplicitMethod(coefficients(radius), TOLERANCE, True)
        self.env = Environment((0.0, 0.0, -gravity), LOOP, np.zeros((2, 3)), 0.0, -1)
        sizes = shapes(n, ends.closed, 0)
        self.s, self.work = views(State, sizes, np.zeros(size(sizes))), work(n, ends.closed, 0)
        self.report, self.counters = np.zeros(REPORT), np.zeros(COUNTERS, np.int64)
        place(self.link, np.asarray(pins, float), self.s, self.work)

    def parts(self):
        return self.link, None, self.env

    def release(self):
        assert accelerations(*self.parts(), self.s, self.work) == -1
        store_first_evaluation(self.s, self.work)
        return self

    def run(self, time, h, step=track_steps.implicit, scheme=None):
        system = (
            self.link,
            self.env,
            self.method if scheme is None else scheme,
            h,
            self.s,
            self.work,
            self.report,
            self.counters,
        )
        assert not step(*track_steps.parts_without_contacts(*system), 0.0, time, np.zeros(0))
        return self

    def march(self, time, h):
        return self.run(time, h, track_steps.explicit, slopes(self.s))

    def pins(self):
        pin_motion(self.link, self.s, self.work)
        return self.work.pins[0]

    def energy(self):
        s, J = self.s, self.link.inertia
        kinetic = 0.5 * self.link.mass * (s.v[:, :3] ** 2).sum() + 0.5 * (s.v[:, 3:] ** 2 * J).sum()
        return kinetic - self.link.mass * np.dot(s.q[:, :3].sum(axis=0), self.env.gravity)

    def momenta(self):
        """Linear momentum, and angular momentum about the origin, each (3)."""
        s = self.s
        pin_motion(self.link, s, self.work)
        spin = np.einsum("nij,nj->ni", self.work.system.rotation, self.link.inertia * s.v[:, 3:])
        linear = self.link.mass * s.v[:, :3]
        return linear.sum(0), (np.cross(s.q[:, :3], linear) + spin).sum(0)


def ring(n):
    """Pins of a regular polygon, numbered so that the links' z axes point outwards."""
    angle = -2.0 * np.pi * np.arange(n) / n
    return P / (2.0 * np.sin(np.pi / n)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def spinning(n, rate, pitch=P):
    loop = Chain(ring(n) * pitch / P, Ends(True, False, False), pitch=pitch)
    loop.s.v[:, :3] = np.cross([0.0, rate, 0.0], loop.s.q[:, :3])
    loop.s.v[:, 4] = rate
    return loop.release()


@pytest.mark.parametrize("n", [5, 64])
def test_joint_force_of_a_spinning_loop(n):
    rate = 3.0
    expected = MASS * rate**2 * P / (2.0 * np.tan(np.pi / n)) / (2.0 * np.sin(np.pi / n))
    loop = spinning(n, rate)
    assert np.abs(np.linalg.norm(loop.s.lam[:, :3], axis=1) / expected - 1.0).max() < 1e-12
    loop.run(0.5, 1e-3)
    assert np.abs(np.linalg.norm(loop.s.lam[:, :3], axis=1) / expected - 1.0).max() < 1e-6
    assert loop.counters[2] <= 2.1 * loop.counters[0]  # the second correction of a step is below the tolerance
    off = spinning(n, rate, 1.02 * P)  # twin: another pitch
    assert np.abs(np.linalg.norm(off.s.lam[:, :3], axis=1) / expected - 1.0).max() > 1e-3


def released(h, pitch=P, time=0.5, radius=0.8):
    """64 thin rods, pinned at one end and released from the horizontal."""
    pins = np.stack([pitch * np.arange(65), np.zeros(65)], axis=1)
    rods = Chain(pins, Ends(False, True, False), 9.81, (0.25, MASS * pitch**2 / 12, 0.22), pitch=pitch, radius=radius)
    return rods.release().run(time, h)


def test_released_horizontal_chain():
    tips = [released(h).pins()[-1, 0] for h in (2e-3, 1e-3, 5e-4)]
    assert tips[-1] == pytest.approx(9.413161, abs=2e-6)
    assert tips[1] == pytest.approx(9.413161, abs=2e-5)
    rate = np.log2((tips[0] - tips[1]) / (tips[1] - tips[2]))
    assert 1.85 < rate < 2.15
    assert abs(released(1e-3, 1.02 * P).pins()[-1, 0] - 9.413161) > 1e-3


def test_released_chain_explicitly():
    tips = []
    for h in (8e-3, 4e-3, 2e-3):
        rods = released(1e-3, time=1e-9)
        place(rods.link, np.stack([P * np.arange(65), np.zeros(65)], axis=1), rods.s, rods.work)
        rods.s.v[:] = 0.0
        tips.append(rods.march(0.5, h).pins()[-1, 0])
    assert tips[-1] == pytest.approx(9.413161, abs=1e-6)
    assert 3.5 < np.log2((tips[0] - tips[1]) / (tips[1] - tips[2])) < 5.5
    pins(rods.link, rods.s, rods.work)
    assert np.abs(rods.work.system.gap).max() < 1e-11


def test_energy_of_the_released_chain():
    start = released(1e-3, time=1e-9).energy()
    errors = [abs(released(h, radius=1.0).energy() - start) for h in (2e-3, 1e-3)]
    assert errors[1] < 1e-5 * MASS * 64 * 9.81  # relative to the weight times a metre
    assert np.log2(errors[0] / errors[1]) > 1.7


def test_pins_do_not_drift():
    loop = tumbling().run(0.5, 1e-3)
    ends = loop.pins()
    chord = np.linalg.norm(np.roll(ends, -1, axis=0) - ends, axis=1)
    assert np.abs(chord - P).max() < 2e-11
    half = loop.link.half * loop.work.system.rotation[:, :, 0]
    gap = np.roll(loop.s.q[:, :3] + half, 1, axis=0) - (loop.s.q[:, :3] - half)
    assert np.abs(gap).max() < 1e-11
    assert np.abs(loop.work.system.rotation[:, :, 1] - loop.work.system.rotation[0, :, 1]).max() < 1e-10


def test_a_polygon_that_cannot_be_closed_is_refused():
    """Ends 2.01 pitches apart, and 1.99."""
    pins = np.array([[0.0, 0.0], [P, 0.01], [2.01 * P, 0.0]])
    with pytest.raises(ValueError, match=r"links of 0.1524 m cannot be closed: .* m are left open"):
        close_exactly(pins, P, closed=False)
    pins[2, 0] = 1.99 * P
    assert np.linalg.norm(np.diff(close_exactly(pins, P, closed=False), axis=0), axis=1) == pytest.approx(P, abs=1e-15)


def tumbling(n=12):
    """A squashed loop in space that flies and turns about an oblique axis."""
    pins = ring(n)
    pins[:, 1] *= 0.6
    pins = close_exactly(pins, P, closed=True)
    loop = Chain(pins, Ends(True, False, False))
    loop.s.q[:, :3] += [0.3, -0.2, 0.1]
    centre, rate = loop.s.q[:, :3].mean(0), np.array([1.0, 2.0, 1.5])
    pin_motion(loop.link, loop.s, loop.work)
    loop.s.v[:, :3] = np.cross(rate, loop.s.q[:, :3] - centre) + np.array([0.5, 0.1, -0.3])
    loop.s.v[:, 3:] = np.einsum("nji,j->ni", loop.work.system.rotation, rate)
    return loop.release()


def test_momentum_and_energy_in_space():
    errors = []
    for h in (2e-3, 1e-3):
        loop = tumbling()
        (linear, angular), energy = loop.momenta(), loop.energy()
        loop.run(0.5, h)
        after = loop.momenta()
        assert np.abs(after[0] - linear).max() < 1e-11 * np.abs(linear).max()
        errors.append([np.abs(after[1] - angular).max() / np.abs(angular).max(), abs(loop.energy() / energy - 1.0)])
    assert np.all(np.array(errors[1]) < 1e-4)
    assert np.all(np.log2(np.array(errors[0]) / errors[1]) > 1.7)


def test_one_link_turns_as_a_free_body():
    from scipy.integrate import solve_ivp

    J = np.array(TRACK["inertia"])
    one = Chain([[0.0, 0.0], [P, 0.0]], Ends(False, False, False))
    one.s.v[0, 3:] = 0.3, 6.0, 4.0
    start = one.s.v[0, 3:].copy()
    one.release().run(0.5, 2e-4)
    exact = solve_ivp(lambda _, w: -np.cross(w, J * w) / J, (0.0, 0.5), start, rtol=1e-11, atol=1e-12).y[:, -1]
    assert np.abs(one.s.v[0, 3:] - exact).max() < 1e-4
    assert np.abs(exact - start).max() > 0.5
