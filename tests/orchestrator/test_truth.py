"""The monolith of a chain and the truth: order, tolerance, energy, error of the truth, its command."""

from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
import pytest
from short_runs import last

from fmus.monolith.model import Monolith
from fmus.physics.chain.report import KINETIC
from fmus.vehicles.tables import BadInput
from orchestrator.execution import monolithic
from orchestrator.execution import truth as module
from orchestrator.execution.monolithic import states_at
from orchestrator.log.reader import Log
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load

SOFT = ("track.start=displaced", "vehicle.material.youngs_modulus=2e7", "chain.links=16")


def energies(log):
    return {name: log.signal(f"chain.energy.{name}")[1] for name in ("kinetic", "strain", "gravity", "dissipated")}


def whole_run(refine=1.0, **how):
    """State at 20 ms of a soft released chain, whose motion is smooth, and the monolith that computed it."""
    assembly = assemble(load("hanging_chain", "flexible", SOFT))
    whole = Monolith(monolithic.parts_of(assembly), assembly.connections, refine, **how)
    for k in range(20):
        whole.advance(k * 1e-3, 1e-3)
    return whole.x.copy(), whole


@pytest.mark.long
def test_monolith_is_of_order_four():
    ends = [whole_run(refine)[0] for refine in (6.4, 12.8, 25.6)]  # 8, 16, 32 steps per millisecond
    slope = np.log2(np.linalg.norm(ends[0] - ends[1]) / np.linalg.norm(ends[1] - ends[2]))
    assert abs(slope - 4.0) < 0.2, slope


@pytest.mark.long
def test_adams_error_follows_its_tolerance_in_fewer_evaluations_than_runge_kutta():
    """With one start, where accuracy limits the steps."""
    (exact, _), (equal, runge_kutta) = whole_run(100.0), whole_run(12.8)
    off, evaluations = [], []
    for tolerance in (1e-6, 1e-8, 1e-10):
        x, whole = whole_run(integrator="adams", rtol=tolerance, atol=tolerance)
        off.append(np.sqrt(np.mean((x - exact) ** 2)))
        evaluations.append(whole.effort.evaluations)
        assert whole.effort.restarts == 1
        assert whole.effort.evaluations == 2 * whole.effort.steps + whole.effort.rejected + 1
        assert whole.models["chain"].counters.tolist() == [*whole.effort[:2], 0, whole.effort.rejected]
    assert 2.0 < off[0] / 1e-6 < 500.0, off
    assert all(one / 1000.0 < other < one / 10.0 for one, other in pairwise(off)), off
    of_order_4 = runge_kutta.effort.evaluations * (np.sqrt(np.mean((equal - exact) ** 2)) / off[-1]) ** 0.25
    assert 2 * evaluations[-1] < of_order_4, (evaluations, off)  # evaluations for the same error


@pytest.mark.long
def test_a_monolith_goes_on_from_the_states_of_a_co_simulation(tmp_path):
    """A chain alone continues to the result of a run without a break."""
    scene = load("hanging_chain", "flexible", (*SOFT, "track.integrator=runge_kutta", "run.step=1 ms", "run.stop=0.03"))
    states, again, assembly = states_at(scene, 0.02), states_at(scene, 0.02), assemble(scene)
    assert states.time == 0.02
    assert np.array_equal(again.parts["chain"], states.parts["chain"])
    straight = Monolith(monolithic.parts_of(assembly), assembly.connections)
    for k in range(30):
        straight.advance(k * 1e-3, 1e-3)
    adams = {"integrator": "adams", "rtol": 1e-9, "atol": 1e-9}
    for name, how, allowed in (("a", {}, 1e-12), ("b", adams, 1e-7)):
        outcome, cost = monolithic.run(scene, tmp_path / f"{name}.mcap", initial_states=states, **how)
        assert (outcome.status, outcome.steps) == ("ok", 30)
        assert how or cost["steps"] == straight.effort.steps / 3
        with Log(tmp_path / f"{name}.mcap") as log:
            times, kinetic = log.signal("chain.energy.kinetic")
        assert times[[0, -1]] == pytest.approx([0.021, 0.03])
        assert kinetic[-1] == pytest.approx(straight.models["chain"].report[KINETIC], rel=allowed)
        assert kinetic[-1] != pytest.approx(kinetic[-2], rel=1e-3)
    with pytest.raises(BadInput):
        monolithic.run(scene, tmp_path / "c.mcap", initial_states=states_at(scene, 0.03))


@pytest.mark.long
@pytest.mark.parametrize("how", [{"refine": 4.0}, {"integrator": "adams"}], ids=["runge-kutta", "adams"])
def test_energy_of_a_free_chain_closes(tmp_path, how):
    settings = (*SOFT, "vehicle.material.relaxation_time=1e-4", "run.stop=0.1", "track.start=polygon")
    monolithic.run(load("hanging_chain", "flexible", settings), tmp_path / "a.mcap", **how)
    with Log(tmp_path / "a.mcap") as log:
        parts = energies(log)
    total = sum(parts.values())
    moved = np.ptp(parts["gravity"])
    assert np.ptp(total) < 1e-6 * moved
    assert np.ptp(total - 0.02 * parts["dissipated"]) > 1e-6 * moved, "a twin that loses 2 % of the dissipation"


@pytest.fixture
def empty(tmp_path, monkeypatch):
    """Empty cache of truths; kernels stay."""
    monkeypatch.setattr(module, "cache_folder", lambda: tmp_path)


@pytest.mark.long
def test_truth_is_built_once_and_knows_its_error(empty):
    scene = load("hanging_chain", "flexible", (*SOFT, "run.stop=0.05"))
    with ThreadPoolExecutor(2) as pool:
        both = [each.result() for each in [pool.submit(module.truth, scene) for _ in range(2)]]
    assert sorted(truth.built for truth in both) == [False, True]
    first = both[0]
    assert both[1].log == first.log
    again = module.truth(load("hanging_chain", "flexible", (*SOFT, "run.stop=0.05", "run.step=5ms")))
    assert (again.built, again.log) == (False, first.log)
    pins = first.difference["pins"]
    assert first.error("pins") == pytest.approx(pins.absolute / 3.0)
    assert 0.0 < pins.relative < 1e-4
    with Log(first.log) as log:
        assert log.signal("chain.travel")[0][1] == pytest.approx(1e-3)


def test_key_is_the_physics():
    def key(*settings):
        return module.key(module.physical_scene(load("hanging_chain", "flexible", settings)))

    plain, beam = key(), key("track.element=beam")
    assert plain == key("run.step=2ms") == key("track.integrator=runge_kutta") == key("track.step=1e-4")
    assert plain == key("track.integrator=adams", "track.rtol=1e-8") == key("track.spectral_radius=0.7")
    assert len({plain, beam, key("vehicle.gravity=9.82"), key("track.start=displaced"), key("run.stop=2")}) == 5


@pytest.mark.long
def test_command_says_where_and_how_good(empty, cotrack):
    arguments = ["truth", "hanging_chain", *(part for setting in SOFT for part in ("--set", setting)), "--stop", "0.02"]
    said = last(cotrack.done(*arguments, "--json"))
    assert said["built"] is True
    pins = said["observables"]["pins"]
    assert pins["error"] == pytest.approx(pins["difference"] / 3.0)
    status, out, err = cotrack(*arguments, "--against", said["coarse_log"])
    assert (status, "found" in out, "is off by" in out, "ends at" in err) == (0, True, True, False)
    status, _, err = cotrack(*arguments, "--stop", "0.01", "--against", said["coarse_log"])
    assert status == 0, err
    assert "coarse.mcap ends at t = 0.02 s, the truth at 0.01 s: they are compared up to 0.01 s" in err
