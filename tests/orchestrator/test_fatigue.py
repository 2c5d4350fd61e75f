"""Fatigue: rainflow counts of ASTM E1049, Miner's sum by hand."""

import numpy as np
import pytest
from analysis_logs import STEP, made, spinning_log

from fmus.vehicle import BadInput
from orchestrator.log.reader import Log
from orchestrator.results.analyses import fatigue
from orchestrator.results.run_data import Missing, RunData

spinning = pytest.fixture(scope="module")(spinning_log)


E1049 = np.array([-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0])


def test_rainflow_counts_the_example_of_the_standard():
    counted = {}
    for size, number in zip(*fatigue.rainflow_cycles(fatigue.turning_points(E1049)), strict=True):
        counted[size] = counted.get(size, 0.0) + number
    assert counted == {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}


def test_what_lies_between_turning_points_does_not_count():
    fine = np.interp(np.linspace(0, 8, 161), np.arange(9), E1049)
    fine = np.repeat(fine, 2)
    np.testing.assert_array_equal(fatigue.turning_points(fine), E1049)
    values = np.round(np.random.default_rng(5).normal(size=500), 1)  # with equal neighbours
    for whole, part in zip(
        fatigue.rainflow_cycles(values), fatigue.rainflow_cycles(fatigue.turning_points(values)), strict=True
    ):
        np.testing.assert_array_equal(whole, part)
    assert fatigue.rainflow_cycles(fatigue.turning_points(np.full(9, 3.0)))[0].size == 0


def stressed(path, stress):
    topics = {
        "/track/links": [(f"link[{i}].fibre.{side}", "Pa") for side in ("outer", "inner") for i in (1, 2)],
        "/track/out": [("travel", "m")],
    }
    t = np.arange(len(stress)) * STEP
    return made(path, topics, {"/track/links": (t, stress), "/track/out": (t, t[:, None])})


def test_damage_is_that_of_miner(tmp_path):
    """Damage is Miner's sum of counts (S / 100 MPa)^m / 2e6 by hand (E1049, ranges times 20 MPa)."""
    stress = 20e6 * E1049[:, None] * np.array([1.0, 0.5, 2.0, 0.0])
    by_hand = sum(n * (s * 20e6 / 100e6) ** 3 for s, n in ((3, 0.5), (4, 1.5), (6, 0.5), (8, 1.0), (9, 0.5))) / 2e6
    with Log(stressed(tmp_path / "f.mcap", stress)) as log:
        run = RunData(log)
        assessment = fatigue.of(run)
        steeper = fatigue.of(run, line=fatigue.StressLifeLine(slope=5.0))
        with pytest.raises(BadInput, match=r"slope = 0: must be greater than 0"):
            fatigue.of(run, line=fatigue.StressLifeLine(slope=0.0))
    np.testing.assert_allclose(assessment.damage, by_hand * np.array([[1.0, 8.0], [0.125, 0.0]]), rtol=1e-12)
    np.testing.assert_allclose(assessment.largest[:, 0], [180e6, 90e6])
    np.testing.assert_allclose(assessment.cycles, [[4.0, 4.0], [4.0, 0.0]])
    assert steeper.damage[0, 1] / steeper.damage[0, 0] == pytest.approx(32.0)
    assert assessment.life == pytest.approx(8 * STEP / 3600 / (8 * by_hand))


def test_blocks_of_records_do_not_change_cycles(tmp_path, monkeypatch):
    from orchestrator.results.analyses import link_records

    stress = 1e7 * np.random.default_rng(2).normal(size=(60, 4))
    path = stressed(tmp_path / "f.mcap", stress)
    with Log(path) as log:
        whole = fatigue.of(RunData(log))
        monkeypatch.setattr(link_records, "SIZE", 7)
        np.testing.assert_array_equal(fatigue.of(RunData(log)).damage, whole.damage)


def test_without_fibres_one_sentence_says_what_to_record(spinning):
    with Log(spinning) as log, pytest.raises(Missing, match=r"group 'fibres' of track\.link_outputs"):
        fatigue.of(RunData(log))
