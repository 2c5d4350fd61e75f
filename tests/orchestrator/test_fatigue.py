"""Fatigue: rainflow counts of ASTM E1049, Miner's sum by hand."""

import numpy as np
import pytest
from analysis_logs import spinning_log
from made_logs import STEP, made

from fmus.vehicles.tables import BadInput
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


def closed_cycles(values):
    return sorted(fatigue.rainflow_cycles(fatigue.closed(values))[0].tolist())


@pytest.mark.parametrize("shift", range(8))
def test_a_repeated_history_counts_as_in_the_standard(shift):
    """The example of ASTM E1049-85, 5.4.5: ranges 3, 4, 7 and 9 once each, wherever the history begins.

    The largest range, from the highest to the lowest point and back, comes as two half cycles.
    """
    history = np.roll(E1049[:-1], shift)
    sizes, numbers = fatigue.rainflow_cycles(fatigue.closed(history))
    counted = {size: float(numbers[sizes == size].sum()) for size in sizes}
    assert counted == {3.0: 1.0, 4.0: 1.0, 7.0: 1.0, 9.0: 1.0}
    assert closed_cycles(np.append(history, history[0])) == closed_cycles(history), "the same point at both ends"
    assert closed_cycles(np.full(5, 2.0)) == []


@pytest.mark.parametrize("seed", range(6))
def test_a_repeat_does_the_damage_of_fifty_repeats_counted_at_once(seed):
    """Damage of 50 repeats less that of the first is 49 times the closed one, by the package alone."""
    slope = (3.0, 5.0)[seed % 2]
    window = np.cumsum(np.random.default_rng(seed).normal(size=120)) + 0.02 * seed * np.arange(120)

    def damage(values):
        return sum(n * size**slope for size, n in zip(*fatigue.rainflow_cycles(values), strict=True))

    by_repeats = (damage(np.tile(window, 50)) - damage(window)) / 49
    assert damage(fatigue.closed(window)) == pytest.approx(by_repeats, rel=1e-10)
    assert damage(window) < 0.97 * by_repeats, "the twin, half cycles, must differ"
    assert damage(fatigue.closed(1.02 * window)) != pytest.approx(by_repeats, rel=0.05)


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
    once, repeated = (
        sum(n * (s * 20e6 / 100e6) ** 3 for s, n in counts) / 2e6
        for counts in (((3, 0.5), (4, 1.5), (6, 0.5), (8, 1.0), (9, 0.5)), ((3, 1), (4, 1), (7, 1), (9, 1)))
    )
    with Log(stressed(tmp_path / "f.mcap", stress)) as log:
        run = RunData(log)
        (assessment,) = fatigue.of(run).tracks
        (steeper,) = fatigue.of(run, sn=fatigue.StressLifeLine(slope=5.0)).tracks
        with pytest.raises(BadInput, match=r"slope = 0: must be greater than 0"):
            fatigue.of(run, sn=fatigue.StressLifeLine(slope=0.0))
    for found, by_hand in ((assessment.damage_once, once), (assessment.damage_repeated, repeated)):
        np.testing.assert_allclose(found, by_hand * np.array([[1.0, 8.0], [0.125, 0.0]]), rtol=1e-12)
    np.testing.assert_allclose(assessment.largest[:, 0], [180e6, 90e6])
    np.testing.assert_allclose(assessment.cycles, [[4.0, 4.0], [4.0, 0.0]])
    assert steeper.damage_repeated[0, 1] / steeper.damage_repeated[0, 0] == pytest.approx(32.0)
    assert assessment.life == pytest.approx(8 * STEP / 3600 / (8 * repeated))
    assert assessment.life != pytest.approx(8 * STEP / 3600 / (8 * once), rel=0.05), "the twin, half cycles"
    same = 2e6 * (assessment.equivalent / 100e6) ** 3 / 2e6  # damage of 2e6 cycles of the equivalent range
    np.testing.assert_allclose(same, assessment.damage_repeated, rtol=1e-12)
    assert [row[1:3] for row in assessment.rows()] == [(1, "inner"), (2, "outer")], "the worst link comes first"


def test_the_worst_link_is_that_of_the_repeated_window(tmp_path):
    """Link 1 has the larger damage once, link 2 if the window repeats: its residue is one large open loop."""
    wave = 55e6 * np.array([0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0])  # four cycles of 55 MPa
    ramp = 100e6 * np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0])  # one of 100 MPa once it closes, else half
    stress = np.stack([wave, ramp, 0.0 * wave, 0.0 * wave], axis=1)
    with Log(stressed(tmp_path / "f.mcap", stress)) as log:
        (found,) = fatigue.of(RunData(log)).tracks
    assert found.damage_once.argmax() == 0
    assert found.worst == (1, 0)
    assert found.rows()[0][1:5] == (2, "outer", pytest.approx(1.0 / 2e6), pytest.approx(0.5 / 2e6))
    assert found.life == pytest.approx(8 * STEP / 3600 * 2e6)


@pytest.mark.parametrize("size", [200, 3])
def test_the_cost_of_the_interval_is_that_of_every_second_record(tmp_path, monkeypatch, size):
    """Of E1049's points every second one leaves ranges 1 and 3 of 3, 4, 7 and 9, by hand, in any blocks."""
    from orchestrator.results.analyses import record_blocks

    monkeypatch.setattr(record_blocks, "SIZE", size)
    path = stressed(tmp_path / "f.mcap", 1e7 * E1049[:, None] * np.array([1.0, 0.5, 0.3, 0.2]))
    with Log(path) as log:
        found = fatigue.of(RunData(log))
    missed = 1.0 - (1 + 3**3) / (3**3 + 4**3 + 7**3 + 9**3)
    np.testing.assert_allclose(found.tracks[0].cost, missed, rtol=1e-12)
    assert found.notes()[-1] == (
        "recorded every 1 ms (run.links); with every second record alone the most damaged link would have 98 % less"
        " damage, others up to 98 % less"
    )
    fine = np.interp(np.arange(0.0, 8.01, 0.25), np.arange(9), E1049)  # every second record has all turning points
    with Log(stressed(tmp_path / "g.mcap", 1e7 * fine[:, None] * np.ones(4))) as log:
        np.testing.assert_allclose(fatigue.of(RunData(log)).tracks[0].cost, 0.0, atol=1e-12)


@pytest.mark.parametrize("text", ["90e6,1e6,5", "90 MPa,1e6,5", " 90000 kPa , 1e6 , 5"])
def test_a_line_is_read_with_units(text):
    assert fatigue.StressLifeLine.read(text) == pytest.approx((90e6, 1e6, 5.0), rel=1e-12)


@pytest.mark.parametrize("text", ["90 mm,1e6,5", "90e6,1e6", "90e6,1e6,0", "nan,1e6,5"])
def test_a_line_that_is_none_is_one_sentence(text):
    with pytest.raises(BadInput, match=f"sn = {text}: "):
        fatigue.StressLifeLine.read(text)


def test_equivalent_ranges_of_a_force_of_both_tracks(tmp_path):
    """Ten cycles of 30 kN on link 2 of b: 30 kN (10 / 1000)^(1/4) at 1000 cycles and a slope of 4, by hand."""
    t = np.arange(41) * STEP
    wave = 15e3 * np.cos(0.5 * np.pi * np.arange(41))
    topics, rows = {}, {}
    for name, sizes in (("a", (0.5, 0.2)), ("b", (0.1, 1.0))):
        topics[f"/{name}/links"] = [("link[1].tension", "N"), ("link[2].tension", "N")]
        topics[f"/{name}/out"] = [("travel", "m")]
        rows[f"/{name}/links"] = t, wave[:, None] * np.array(sizes)
        rows[f"/{name}/out"] = t, t[:, None]
    path = made(tmp_path / "f.mcap", topics, rows, {"track": {"model": "rigid"}}, ("a", "b"))
    with Log(path) as log:
        run = RunData(log)
        found = fatigue.of(run, signal="tension", sn="1,1000,4")
        again = fatigue.of(run, signal=["b.link[*].tension"], sn="1,1000,4")
        with pytest.raises(Missing, match="rigid links have no stress"):
            fatigue.of(run)
    for each, sizes in zip(found.tracks, ((0.5, 0.2), (0.1, 1.0)), strict=True):
        np.testing.assert_allclose(each.equivalent[:, 0], 30e3 * np.array(sizes) * 0.01**0.25, rtol=1e-12)
    records = found.table().records()
    assert [(row["track"], row["link"]) for row in records] == [("a", 1), ("a", 2), ("b", 2), ("b", 1)]
    assert records[2]["equivalent range"] == pytest.approx(30.0 * 0.01**0.25)
    assert [column.unit for column in found.table().columns] == ["", "", "kN", "kN", ""]
    assert [each.track for each in again.tracks] == ["b"]
    assert (
        found.table().notes[-1].startswith("recorded every 1 ms (run.links); with every second record alone the most")
    )


def test_the_table_has_the_worst_links_and_the_file_all(tmp_path):
    t = np.arange(9) * STEP
    sizes = np.random.default_rng(1).permutation(25) + 1.0
    topics = {"/track/links": [(f"link[{i + 1}].tension", "N") for i in range(25)], "/track/out": [("travel", "m")]}
    rows = {"/track/links": (t, E1049[:, None] * sizes), "/track/out": (t, t[:, None])}
    with Log(made(tmp_path / "f.mcap", topics, rows)) as log:
        found = fatigue.of(RunData(log), signal="tension")
    worst = np.argsort(-sizes)[:10] + 1
    assert [row["link"] for row in found.table().records()] == worst.tolist()
    assert len(found.series().rows) == 25
    assert "the 10 worst of 25 links" in found.table().notes[0]


def test_blocks_of_records_do_not_change_cycles(tmp_path, monkeypatch):
    from orchestrator.results.analyses import record_blocks

    stress = 1e7 * np.random.default_rng(2).normal(size=(60, 4))
    path = stressed(tmp_path / "f.mcap", stress)
    with Log(path) as log:
        (whole,) = fatigue.of(RunData(log)).tracks
        monkeypatch.setattr(record_blocks, "SIZE", 7)
        np.testing.assert_array_equal(fatigue.of(RunData(log)).tracks[0].damage_once, whole.damage_once)


def test_without_fibres_one_sentence_says_what_to_record(spinning):
    with Log(spinning) as log, pytest.raises(Missing, match=r"group 'fibres' of track\.link_outputs"):
        fatigue.of(RunData(log))
