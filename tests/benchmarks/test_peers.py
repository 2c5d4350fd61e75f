"""The chain of the benchmark and its peers: one motion, one error."""

import numpy as np
import pytest

from tests.benchmarks import chain, motion, peers
from tests.support.named_ports import outputs


@pytest.mark.long
def test_all_are_measured_by_one_reference():
    """Errors at 1 ms are of second order; 1 % more motion gives a hundredfold error."""
    for name, expected in (("flexible", 2.601e-5), ("rigid", 8.917e-6), ("rigid, on the ground", 1.234e-4)):
        case = motion.CASES[name]
        spent, pins = chain.stepped(case, case.quick, 1e-3, "step")
        assert spent > 0.0
        assert motion.error(case, case.quick, pins) == pytest.approx(expected, rel=0.03), name
        np.testing.assert_allclose(pins, chain.stepped(case, case.quick, 1e-3, "advance")[1], atol=1e-10)
    case = motion.CASES["rigid"]
    faster = motion.model(case, 1e-3, **{"start.ovalling": 1.01 * motion.OVALLING})
    for k in range(100):
        faster.step(1e-3 * k, 1e-3, np.zeros(0))
    assert motion.error(case, 0.1, motion.pins(faster)) > 1e-3
    np.testing.assert_allclose(chain.logged(case, 0.1)[1], chain.stepped(case, 0.1, 1e-3, "step")[1], atol=1e-14)


@pytest.mark.long
def test_peers_are_given_what_our_model_starts_with():
    case = motion.CASES["rigid"]
    loop, model, h = motion.loop(case), motion.model(case, 1e-6), 1e-6
    np.testing.assert_allclose(motion.pins(model), loop.pins, atol=1e-14)
    model.step(0.0, h, np.zeros(0))
    np.testing.assert_allclose((motion.pins(model) - loop.pins) / h, loop.velocity, atol=2e-4)
    chord = np.roll(loop.pins, -1, axis=0) - loop.pins
    turning = np.roll(loop.velocity, -1, axis=0) - loop.velocity
    np.testing.assert_allclose(turning[:, 1], loop.rate * chord[:, 0], atol=1e-12)
    np.testing.assert_allclose(np.arctan2(chord[:, 1], chord[:, 0]), loop.angle, atol=1e-12)


OPEN = ("rigid, released", "rigid, folded")


@pytest.mark.long
@pytest.mark.parametrize("name", OPEN)
def test_open_chains_have_references(name):
    """Two integrators in joint coordinates agree with the reference; 2 % more gravity does not."""
    case = motion.CASES[name]
    for integrator, point in (("runge_kutta", 1e-3), ("dormand_prince", 1e-9)):
        assert motion.error(case, case.quick, chain.jointed(case, case.quick, integrator, point)[1][0]) < 1e-8
    later = case.quick * np.sqrt(1.02)  # moves as far as 2 % more gravity
    assert motion.error(case, case.quick, chain.jointed(case, later, "dormand_prince", 1e-9)[1][0]) > 1e-3


def test_a_peer_that_is_missing_is_one_sentence(monkeypatch):
    monkeypatch.setattr(peers, "find_spec", lambda package: None)
    for peer in peers.PEERS:
        rows, reason = peers.runs(peer, "rigid", True, 1)
        assert rows == []
        assert reason.startswith(f"{peer.name} is not installed: pip install -c constraints.txt -e '.[benchmark]' in ")


def test_cost_at_one_error():
    """Cost at equal error: between two steps of an order-2 code, at the longest if accurate, None if not."""
    rows = [{"step": h, "error": 1e-5 * h**2, "cpu": 8.0 / h, "rate": 1.0} for h in (4.0, 2.0, 0.5)]
    at = chain.at_target(rows, 1e-5)
    assert (at["step"], at["cpu"]) == (pytest.approx(1.0), pytest.approx(8.0))
    assert chain.at_target(rows[2:], 1e-5)["step"] == 0.5
    assert chain.at_target(rows[:2], 1e-6)["cpu"] is None


# ------------------------------------------------------------------ with the peers' codes, by hand


@pytest.mark.benchmark
def test_exudyn_moves_the_same_chain():
    """Exudyn converges to our reference with order 2, to 1 % of our error at that step; equal mass."""
    exudyn = pytest.importorskip("exudyn")
    from tests.benchmarks.peers import exudyn_loops

    for name, assembled in (("flexible", exudyn_loops.cables), ("rigid", exudyn_loops.rods)):
        case = motion.CASES[name]
        errors = [motion.error(case, 0.1, exudyn_loops.run(name, 0.1, h, "full Newton", 0.4)[1]) for h in (1e-3, 5e-4)]
        assert 3.6 < errors[0] / errors[1] < 4.4
        assert errors[0] == pytest.approx(motion.error(case, 0.1, chain.stepped(case, 0.1, 1e-3, "step")[1]), rel=0.01)
        mbs, _ = assembled(motion.loop(case))
        solver, chosen = exudyn.MainSolverImplicitSecondOrder(), exudyn_loops.settings(0.1, 1e-3, False, 0.4)
        chosen.linearSolver.solverType = exudyn.LinearSolverType.EXUdense
        solver.InitializeSolver(mbs, chosen)
        solver.ComputeMassMatrix(mbs)
        v = mbs.systemData.GetODE2Coordinates_t()
        kinetic = 0.5 * v @ solver.GetSystemMassMatrix() @ v
        assert kinetic == pytest.approx(kinetic_energy(case), rel=1e-6)


@pytest.mark.benchmark
def test_mujoco_moves_the_same_chain(monkeypatch, tmp_path):
    """MuJoCo closes its loop softly but converges to our reference; its energy is constant and ours."""
    pytest.importorskip("mujoco")
    from tests.benchmarks.peers import mujoco_loops

    case = motion.CASES["rigid"]
    errors = []
    for h in (1e-3, 2.5e-4):
        _, (pins, energy) = mujoco_loops.run(case, 0.1, h, "RK4")
        errors.append(motion.error(case, 0.1, pins))
        assert energy == pytest.approx(kinetic_energy(case), rel=1e-7)
    assert errors[0] < 1e-7
    assert errors[1] < 0.1 * errors[0]
    first, second = (
        motion.error(case, 0.1, mujoco_loops.run(case, 0.1, h, "implicitfast")[1][0]) for h in (1e-3, 5e-4)
    )
    assert first / second == pytest.approx(2.0, rel=0.1)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RuntimeError, match=r"steps of 0.02 s: .*simulation is unstable"):
        mujoco_loops.run(case, 1.0, 0.02, "RK4")
    assert not list(tmp_path.iterdir())


@pytest.mark.benchmark
def test_pinocchio_moves_the_same_chain():
    """Both its algorithms converge to our reference, at the orders of their integrators."""
    pytest.importorskip("pinocchio")
    from tests.benchmarks.peers import pinocchio_loops

    case = motion.CASES["rigid"]
    first, second = (
        motion.error(case, 0.1, pinocchio_loops.run(case, 0.1, pinocchio_loops.FIXED, h)[1][0]) for h in (10e-3, 5e-3)
    )
    assert 3.5 < np.log2(first / second) < 5.5
    assert motion.error(case, 0.1, pinocchio_loops.run(case, 0.1, pinocchio_loops.BY_ERROR, 1e-9)[1][0]) < 1e-10


@pytest.mark.benchmark
@pytest.mark.parametrize("name", OPEN)
def test_peers_move_the_same_open_chains(name):
    """At one step the classical Runge-Kutta method has one error in all codes; Exudyn's is of second order."""
    pytest.importorskip("mujoco"), pytest.importorskip("pinocchio"), pytest.importorskip("exudyn")
    from tests.benchmarks.peers import exudyn_loops, mujoco_loops, pinocchio_loops

    case, stop = motion.CASES[name], 0.4
    truth = chain.jointed(case, stop, "dormand_prince", 1e-11)[1][0]

    def off(pins):
        return float(np.sqrt(np.mean((pins - truth) ** 2)))

    ours = off(chain.jointed(case, stop, "runge_kutta", 2e-3)[1][0])
    assert off(mujoco_loops.run(case, stop, 2e-3, "RK4")[1][0]) == pytest.approx(ours, rel=0.01)
    assert off(pinocchio_loops.run(case, stop, pinocchio_loops.FIXED, 2e-3)[1][0]) == pytest.approx(ours, rel=0.01)
    assert off(pinocchio_loops.run(case, stop, pinocchio_loops.BY_ERROR, 1e-10)[1][0]) < 1e-9
    first, second = (off(exudyn_loops.run(name, stop, h, "full Newton", 0.4)[1]) for h in (1e-3, 5e-4))
    assert first / second == pytest.approx(4.0, rel=0.1)


def kinetic_energy(case):
    """Kinetic energy of our model at the start, J."""
    return outputs(motion.model(case, 1e-3), links=False)["energy.kinetic"]


@pytest.mark.benchmark
def test_the_reference_is_what_it_says():
    from tests.benchmarks import reference

    for name, case in motion.CASES.items():
        step = 2.0 * reference.STEPS[name]
        pins, way = reference.states(case._replace(stop=case.quick), step)[f"{case.quick:g}"]
        assert motion.error(case, case.quick, pins) * way < 1e-7
