"""The master and ``tracks_first`` on two masses, cut at their spring, with exact solutions."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from orchestrator.cosim.coupling.tracks_first import TracksFirst
from orchestrator.cosim.graph import ComponentFailed, Connection, Instance, System, wire
from orchestrator.cosim.master import Clock, run

K, M1, M2, K1, K2 = 1.0, 1.0, 1.0, 1.0, 1.0  # coupling spring, masses, springs to the walls
X1, X2 = 1.0, 0.0  # displaced at the start, at rest
END = 10.0


class ForceSide:
    """Mass 1 and the coupling spring; extrapolates mass 2 by its velocity; returns the mean force."""

    inputs, outputs = ("x", "v"), ("force",)
    stage = 0

    def __init__(self, hold=False):
        self.name, self.hold = "force", hold
        self.u, self.y = np.array([X2, 0.0]), np.zeros(1)
        self.state = np.array([X1, 0.0])
        self.log = []

    def write(self):
        self.log.append("write")

    def step(self, t, h):
        # states: x1, v1, impulse on mass 2, x2, v2 as extrapolated
        rate = 0.0 if self.hold else 1.0
        a = np.zeros((5, 5))
        a[0, 1] = 1.0
        a[1] = [-(K1 + K) / M1, 0.0, 0.0, K / M1, 0.0]
        a[2] = [K, 0.0, 0.0, -K, 0.0]
        a[3, 4] = rate
        end = expm(a * h) @ np.array([*self.state, 0.0, *self.u])
        self.state = end[:2]
        self.mean = end[2] / h

    def read(self):
        self.y[0] = getattr(self, "mean", K * (X1 - X2))


class MotionSide:
    """Mass 2 on its wall spring under a constant force."""

    inputs, outputs = ("force",), ("x", "v")
    stage = 1

    def __init__(self):
        self.name = "motion"
        self.u, self.y = np.zeros(1), np.array([X2, 0.0])
        self.state = np.array([X2, 0.0])

    def write(self):
        pass

    def step(self, t, h):
        w, rest = math.sqrt(K2 / M2), self.u[0] / K2
        c, s = math.cos(w * h), math.sin(w * h)
        x, v = self.state[0] - rest, self.state[1]
        self.state = np.array([rest + c * x + s * v / w, c * v - w * s * x])

    def read(self):
        self.y[:] = self.state


def coupled(*components, motion_first=False):
    first, second = components
    stage = {"force": int(motion_first), "motion": int(not motion_first)}
    system = System(
        tuple(Instance(c.name, None, {}, stage[c.name]) for c in components),
        (
            Connection("force", ("force",), "motion", ("force",), "mean"),
            Connection("motion", ("x",), "force", ("x",), "state"),
            Connection("motion", ("v",), "force", ("v",), "rate"),
        ),
    )
    return TracksFirst(wire(system, {first.name: first, second.name: second}))


def exact(t):
    a = np.array([[0, 1, 0, 0], [-(K1 + K) / M1, 0, K / M1, 0], [0, 0, 0, 1], [K / M2, 0, -(K2 + K) / M2, 0]])
    return expm(a * t) @ np.array([X1, 0.0, X2, 0.0])


def error(h, **options):
    """Largest error of both positions over the run."""
    motion_first = options.pop("motion_first", False)
    force, motion = ForceSide(**options), MotionSide()
    worst = 0.0

    def watch(k, t, h):
        nonlocal worst
        x = exact(t)
        worst = max(worst, abs(force.state[0] - x[0]), abs(motion.state[0] - x[2]))

    force.read()
    outcome = run(coupled(force, motion, motion_first=motion_first), Clock(h, round(END / h)), [watch])
    assert outcome[:3] == ("ok", "", round(END / h))
    return worst


def test_tracks_first_is_second_order():
    coarse, fine = error(0.1), error(0.05)
    assert coarse == pytest.approx(3.82e-3, rel=0.02)
    assert math.log2(coarse / fine) == pytest.approx(TracksFirst.ORDER, abs=0.1)


def test_twins_are_first_order():
    for twin in ({"hold": True}, {"motion_first": True}):
        coarse, fine = error(0.1, **twin), error(0.05, **twin)
        assert math.log2(coarse / fine) < 1.4
        assert coarse > 0.05


def energy(x1, v1, x2, v2):
    return 0.5 * (M1 * v1**2 + M2 * v2**2 + K1 * x1**2 + K2 * x2**2 + K * (x1 - x2) ** 2)


@pytest.mark.parametrize(("hold", "low", "high"), [(False, -1e-4, 1e-4), (True, 0.01, 0.1)])
def test_energy_is_kept_but_for_a_twin_that_holds(hold, low, high):
    force, motion = ForceSide(hold), MotionSide()
    force.read()
    run(coupled(force, motion), Clock(0.01, 1000), [])
    assert low < energy(*force.state, *motion.state) / energy(X1, 0.0, X2, 0.0) - 1.0 < high


def test_impulse_leaves_one_side_and_enters_the_other():
    force, motion = ForceSide(), MotionSide()
    force.read()
    given, received = [], []

    def watch(k, t, h):
        if k:
            given.append(force.y[0])
            received.append(motion.u[0])

    run(coupled(force, motion), Clock(0.1, 50), [watch])
    assert given == received


def test_observers_see_every_point_once_with_the_inputs_of_the_step():
    force, motion = ForceSide(), MotionSide()
    force.read()
    seen, before = [], []

    def watch(k, t, h):
        seen.append((k, t))
        if k:
            assert force.u.tolist() == before[-1], "inputs are not those of the step"
        before.append(motion.state.tolist())

    run(coupled(force, motion), Clock(0.1, 5), [watch])
    assert seen == [(k, k * 0.1) for k in range(6)]


class Failing(MotionSide):
    def step(self, t, h):
        if t > 0.25:
            raise ComponentFailed("motion: no convergence at t = 0.3 s")
        super().step(t, h)


def test_a_failure_ends_the_run_with_its_sentence():
    force, motion = ForceSide(), Failing()
    force.read()
    seen = []
    outcome = run(coupled(force, motion), Clock(0.1, 100), [lambda k, t, h: seen.append(k)])
    assert outcome[:3] == ("failed", "motion: no convergence at t = 0.3 s", 3)
    assert outcome.time == pytest.approx(0.3)
    assert seen == [0, 1, 2, 3]


def test_an_interruption_ends_between_steps():
    force, motion = ForceSide(), MotionSide()
    force.read()
    points = []
    outcome = run(coupled(force, motion), Clock(0.1, 100), [lambda k, t, h: points.append(k)], lambda: len(points) > 4)
    assert outcome.status == "interrupted"
    assert outcome.steps == 4
    assert points == [0, 1, 2, 3, 4]
