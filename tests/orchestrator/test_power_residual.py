"""Power residual: by hand, its order, the energy that it estimates; the step control that uses it."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from orchestrator.cosim.component import Component
from orchestrator.cosim.coupling.power_residual import PowerResidual, bonds, check_bonds, transferred_energies
from orchestrator.cosim.graph import Connection, Miswired
from orchestrator.cosim.master import run
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.scene.scene import load
from orchestrator.studies.step_limits import Oscillator
from tests.validation import coupling as study
from tests.validation.coupling import couple
from tests.validation.slaves import coupled, whole

FREE = Oscillator(k2=0.0, start=(1.0, 0.3, 0.2, -0.4))


def one_step(o, h):
    stages, a, b = coupled("wrench", o)
    scheme = couple("tracks_first", stages)
    scheme.advance(0.0, h)
    (bond,) = bonds(scheme.members)
    return transferred_energies(bond, scheme.past.outputs, h), a.y[0], b.x[1]


@pytest.mark.parametrize(("heavier", "right"), [(1.0, True), (1.02, False)])
def test_by_hand(heavier, right):
    """A free mass under the mean force F (v_1 = v + F h / m) gets F^2 h^2 / 2 m too much energy."""
    h, m, v = 0.1, FREE.m2, FREE.start[3]
    (sent, received), force, after = one_step(FREE._replace(m2=heavier * m), h)
    assert (received == pytest.approx(0.5 * m * (after**2 - v**2), rel=1e-12)) == right
    assert (sent - received == pytest.approx(-0.5 * (force * h) ** 2 / m, rel=1e-12)) == right


ORDERS = {"tracks_first": 1, "jacobi constant": 1, "jacobi linear": 2, "gauss_seidel linear": 2}


@pytest.mark.parametrize(("variant", "order"), ORDERS.items())
def test_order(variant, order):
    """Order of the sum over a second, one less than that of a step."""
    sums = []
    for h in (0.01, 0.005):
        stages, *_ = coupled("wrench", study.FREE._replace(start=(1.0, 0.3, 0.2, -0.4)))
        scheme, total = couple(variant, stages), 0.0
        for k in range(round(1.0 / h)):
            scheme.advance(k * h, h)
            if k > 1:  # steps without a past have a lower order
                sent, received = transferred_energies(bonds(scheme.members)[0], scheme.past.outputs, h)
                total += abs(sent - received)
        sums.append(total)
    assert math.log2(sums[0] / sums[1]) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize(("stiffer", "right"), [(1.0, True), (1.1, False)])
def test_it_is_the_energy_that_the_coupling_loses(stiffer, right):
    """The residual is the energy that the coupling of a conservative system loses."""
    o, h, lost = FREE._replace(k=2.0), 1e-3, 0.0
    stages, a, b = coupled("spring", o)
    scheme = couple("jacobi constant", stages)

    def held(k):
        x1, v1, stretch = a.x
        return 0.5 * (o.m1 * v1**2 + o.m2 * b.x[1] ** 2 + o.k1 * x1**2 + k * stretch**2)

    start = held(stiffer * o.k)
    for k in range(1000):
        scheme.advance(k * h, h)
        sent, received = transferred_energies(bonds(scheme.members)[0], scheme.past.outputs, h)
        lost += sent - received
    assert abs(lost) > 1e-4
    assert (start - held(stiffer * o.k) == pytest.approx(lost, rel=1e-3)) == right


# Step control -----------------------------------------------------------------------------------------------------


def pace(stop=1.0, step=0.02, tolerance=1e-4, shortest=1e-4, longest=0.1):
    return PowerResidual(stop, step, tolerance, shortest, longest, 0.1)


def test_it_lands_on_the_end_and_saves_nothing():
    stages, a, b = coupled("wrench", study.DAMPED)
    a.save = b.save = None
    seen, way = [], pace()
    outcome = run(couple("tracks_first", stages), way, [lambda k, t, h: seen.append((t, h))])
    assert outcome.status == "ok"
    assert outcome.time == pytest.approx(1.0, abs=1e-12)
    h = np.array(seen)[1:, 1]
    assert a.steps == len(h), "steps were tried and rejected"
    assert h.max() <= 0.1
    assert h.max() / h.min() > 1.5
    assert (way.rejected_steps, way.forced_steps) == (0, 0)
    way = pace(tolerance=1e-12, shortest=0.01, longest=0.01)
    assert run(couple("tracks_first", coupled("wrench", study.DAMPED)[0]), way, []).steps == 100
    assert way.forced_steps > 90, "the shortest step is counted where it is too long"


@pytest.mark.long
def test_a_tighter_tolerance_is_more_right():
    """A tighter tolerance gives smaller errors: a hundredth of it, a tenth of the step, order 2."""
    truth, errors, steps = expm(whole(study.FREE) * 3.0) @ study.FREE.start, [], []
    for tolerance in (1e-3, 1e-5):
        stages, a, b = coupled("wrench", study.FREE)
        steps.append(run(couple("tracks_first", stages), pace(3.0, 0.01, tolerance), []).steps)
        errors.append(np.hypot(a.x[0] - truth[0], b.x[0] - truth[2]))
    assert 5.0 < steps[1] / steps[0] < 15.0
    assert 25.0 < errors[0] / errors[1] < 200.0


# Bonds --------------------------------------------------------------------------------------------------------------


BACK = Connection("b", ("v",), "a", ("v",), "value", bond="joint")
THERE = Connection("a", ("force",), "b", ("force",), "value", bond="joint")


@pytest.mark.parametrize(("connections", "said"), [
    ((THERE,), "bond 'joint' needs two connections, there and back, and has 1"),
    ((THERE, BACK, BACK), "and has 3"), ((THERE, THERE), "there and back"),
    ((THERE, BACK._replace(outputs=("v", "w"))), "bond 'joint' has 1 values there and 2 back"),
    ((THERE, BACK._replace(outputs=("x",))), "bond 'joint': a.force times b.x is not in W"),
])  # fmt: skip
def test_bonds_that_are_none_are_refused(connections, said):
    units = {"force": (1, 1, -2, 0, 0, 0, 0, 0), "v": (0, 1, -1, 0, 0, 0, 0, 0), "x": (0, 1, 0, 0, 0, 0, 0, 0)}
    check_bonds((THERE, BACK), lambda instance, name: units[name])
    check_bonds((THERE, BACK._replace(outputs=("x",))), lambda instance, name: None)
    with pytest.raises(Miswired, match=said):
        check_bonds(connections, lambda instance, name: units.get(name))
    outcome = run(couple("tracks_first", coupled("mass", study.FREE)[0]), pace(), [])
    assert outcome[:2] == ("failed", "no connection has a bond, whose power residual a variable step could follow")


def test_units_of_an_fmu(toy):
    with Component(toy, "toy") as component:
        assert component.variables.dimension("force") == (1, 1, -2, 0, 0, 0, 0, 0)
        assert component.variables.dimension("v") == (0, 1, -1, 0, 0, 0, 0, 0)


def test_the_wheels_of_a_vehicle_are_bonds(tmp_path):
    """The wheels of a vehicle are bonds: forces with velocities, torques with angular velocities.

    The log says how the steps were chosen.
    """
    settings = ("run.stop=20 ms", "run.variable.estimate=power", "run.variable.tolerance=1e-5")
    result = simulate(load("hard_stop", "rigid", settings), tmp_path / "run.mcap")
    assert (result["status"], result["rejected_steps"]) == ("ok", 0)
    with Log(tmp_path / "run.mcap") as log:
        assert log.metadata["run"]["step_control"].startswith("power, tolerance 1e-05")
        assert np.ptp(log.read("/left_track/in").h) > 0.0
