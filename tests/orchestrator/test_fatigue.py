"""Fatigue: rainflow counts of ASTM E1049-85 and beside two packages, Miner's sum by hand, equivalent ranges."""

import fatpack
import numpy as np
import pytest
import rainflow
from made_logs import STEP, made

from orchestrator.log.reader import Log
from orchestrator.results.analyses import fatigue, record_blocks
from orchestrator.results.run_data import RunData

E1049 = np.array([-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0])
CLASSES = 1 << 20  # fatpack puts a record into classes of this number
RANDOM = {
    "white": np.random.default_rng(1).normal(size=3000),
    "wandering": np.cumsum(np.random.default_rng(2).normal(size=3000)),
    "many equal": np.round(np.random.default_rng(3).normal(size=500), 1),
    "of a circuit": 20.0 + 6.0 * np.sin(0.05 * np.arange(2000)) + np.random.default_rng(4).normal(size=2000),
}


def counted(values):
    sizes, numbers = fatigue.rainflow_cycles(values)
    return {size: float(numbers[sizes == size].sum()) for size in sizes}


# counts


@pytest.mark.parametrize("shift", range(8))
def test_counts_are_those_of_the_standard(shift):
    """Its example once, 5.4.4, and repeated, 5.4.5: 3, 4, 7 and 9 once each, wherever the history begins.

    The largest range, from the highest to the lowest point and back, comes as two half cycles.
    """
    assert counted(fatigue.turning_points(E1049)) == {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}
    history = np.roll(E1049[:-1], shift)
    for values in (history, np.append(history, history[0])):  # the same point at both ends
        assert counted(fatigue.closed(values)) == {3.0: 1.0, 4.0: 1.0, 7.0: 1.0, 9.0: 1.0}
    assert counted(fatigue.closed(np.full(5, 2.0))) == counted(fatigue.turning_points(np.full(9, 3.0))) == {}


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


def ours(values):
    """Damage of the repeated record, its residue closed, at a slope of 4."""
    return sum(n * size**4 for size, n in zip(*fatigue.rainflow_cycles(fatigue.closed(values)), strict=True))


def half(values):
    """The same with the residue as half cycles, by the package alone."""
    return sum(n * size**4 for size, _, n, _, _ in rainflow.extract_cycles(values.tolist()))


def without(values):
    """The same without the residue, by the other package."""
    cycles, _ = fatpack.find_rainflow_cycles(fatpack.find_reversals(values, k=CLASSES)[0])
    return float((np.abs(np.diff(cycles.reshape(-1, 2), axis=1)) ** 4).sum())


def test_what_is_done_with_the_residue_is_the_difference():
    """The figures of analyses.md#fatigue: a record of nine points, closed, as half cycles, counted twice, left out."""
    whole = ours(E1049)
    assert whole == 3.0**4 + 4.0**4 + 7.0**4 + 9.0**4, "5.4.5 of the standard"
    shares = [each / whole for each in (half(E1049), half(np.concatenate([E1049[:-1], E1049])), without(E1049))]
    assert [round(each, 2) for each in shares] == [0.91, 1.91, 0.03]


@pytest.mark.parametrize("values", RANDOM.values(), ids=RANDOM)
def test_a_record_is_counted_as_by_two_packages(values):
    """Fatpack closes the residue by counting it twice over, we begin at the largest value: the same cycles.

    Its record begins and ends at the least value: between other ends fatpack 0.7.8 leaves out a peak (`findings/`).
    As half cycles it is counted as by rainflow. What lies between turning points does not count.
    """
    first, digits = int(values.argmin()), 3.0 * np.ptp(values) / CLASSES
    theirs = np.sort(fatpack.find_rainflow_ranges(np.concatenate([values[first:], values[: first + 1]]), k=CLASSES))
    sizes, counts = fatigue.rainflow_cycles(fatigue.closed(values))
    assert counts.sum() == len(theirs)
    twice = np.sort(np.repeat(sizes, np.rint(2.0 * counts).astype(int)))  # the largest comes as two halves
    np.testing.assert_allclose(twice[::2], theirs, atol=digits)
    assert not np.allclose(1.02 * twice[::2], theirs, atol=digits)
    assert without(values) < half(values) < ours(values)
    sizes, counts = fatigue.rainflow_cycles(values)
    assert (counts * sizes**4).sum() == pytest.approx(half(values), rel=1e-12)
    fine = np.repeat(np.interp(np.arange(0.0, len(values) - 0.9, 0.5), np.arange(len(values)), values), 2)
    np.testing.assert_array_equal(fatigue.turning_points(fine), fatigue.turning_points(values))
    for whole, part in zip((sizes, counts), fatigue.rainflow_cycles(fatigue.turning_points(values)), strict=True):
        np.testing.assert_array_equal(whole, part)


@pytest.mark.parametrize("values", RANDOM.values(), ids=RANDOM)
def test_the_peak_of_a_cycle_is_its_largest_value(values):
    """The places that cycles are booked at, in the closed record and in the record itself."""
    places = fatigue.closed_places(values)
    ranges, means, _, peaks = fatigue.cycles_with_peaks(values[places])
    np.testing.assert_allclose(values[places[peaks]], means + 0.5 * ranges, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(values[places], fatigue.closed(values))


# of a log


def stressed(path, stress):
    topics = {
        "/track/links": [(f"link[{i}].fibre.{side}", "Pa") for side in ("outer", "inner") for i in (1, 2)],
        "/track/out": [("travel", "m")],
    }
    t = np.arange(len(stress)) * STEP
    return made(path, topics, {"/track/links": (t, stress), "/track/out": (t, t[:, None])})


@pytest.mark.parametrize("size", [200, 3])
def test_damage_is_that_of_miner(tmp_path, monkeypatch, size):
    """Damage is Miner's sum of counts (S / 100 MPa)^m / 2e6 by hand (E1049, ranges times 20 MPa), in any blocks."""
    monkeypatch.setattr(record_blocks, "SIZE", size)
    stress = 20e6 * E1049[:, None] * np.array([1.0, 0.5, 2.0, 0.0])
    once, repeated = (
        sum(n * (s * 20e6 / 100e6) ** 3 for s, n in counts) / 2e6
        for counts in (((3, 0.5), (4, 1.5), (6, 0.5), (8, 1.0), (9, 0.5)), ((3, 1), (4, 1), (7, 1), (9, 1)))
    )
    with Log(stressed(tmp_path / "f.mcap", stress)) as log:
        run = RunData(log)
        (assessment,) = fatigue.of(run).tracks
        (steeper,) = fatigue.of(run, sn=fatigue.StressLifeLine(slope=5.0)).tracks
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
    missed = 1.0 - (1 + 3**3) / (3**3 + 4**3 + 7**3 + 9**3)  # every second record leaves ranges 1 and 3
    np.testing.assert_allclose(assessment.cost[stress[1].reshape(2, 2).T > 0.0], missed, rtol=1e-12)
    fine = np.interp(np.arange(0.0, 8.01, 0.25), np.arange(9), E1049)  # every second record has all turning points
    with Log(stressed(tmp_path / "g.mcap", 1e7 * fine[:, None] * np.ones(4))) as log:
        np.testing.assert_allclose(fatigue.of(RunData(log)).tracks[0].cost, 0.0, atol=1e-12)


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


@pytest.mark.parametrize("text", ["90e6,1e6,5", "90 MPa,1e6,5", " 90000 kPa , 1e6 , 5"])
def test_a_line_is_read_with_units(text):
    assert fatigue.StressLifeLine.read(text) == pytest.approx((90e6, 1e6, 5.0), rel=1e-12)


def pulled(path, tensions):
    """Log of tensions (m, n) of links by track."""
    topics, rows = {}, {}
    for name, values in tensions.items():
        t = np.arange(len(values)) * STEP
        topics[f"/{name}/links"] = [(f"link[{i + 1}].tension", "N") for i in range(values.shape[1])]
        topics[f"/{name}/out"] = [("travel", "m")]
        rows |= {f"/{name}/links": (t, values), f"/{name}/out": (t, t[:, None])}
    return made(path, topics, rows, {"track": {"model": "rigid"}}, tuple(tensions))


def test_equivalent_ranges_of_a_force_of_both_tracks(tmp_path):
    """Ten cycles of 30 kN on link 2 of b: 30 kN (10 / 1000)^(1/4) at 1000 cycles and a slope of 4, by hand."""
    wave = 15e3 * np.cos(0.5 * np.pi * np.arange(41))[:, None]
    path = pulled(tmp_path / "f.mcap", {"a": wave * [0.5, 0.2], "b": wave * [0.1, 1.0]})
    with Log(path) as log:
        run = RunData(log)
        found = fatigue.of(run, signal="tension", sn="1,1000,4")
        again = fatigue.of(run, signal=["b.link[*].tension"], sn="1,1000,4")
    for each, sizes in zip(found.tracks, ((0.5, 0.2), (0.1, 1.0)), strict=True):
        np.testing.assert_allclose(each.equivalent[:, 0], 30e3 * np.array(sizes) * 0.01**0.25, rtol=1e-12)
    records = found.table().records()
    assert [(row["track"], row["link"]) for row in records] == [("a", 1), ("a", 2), ("b", 2), ("b", 1)]
    assert records[2]["equivalent range"] == pytest.approx(30.0 * 0.01**0.25)
    assert [column.unit for column in found.table().columns] == ["", "", "kN", "kN", ""]
    assert [each.track for each in again.tracks] == ["b"]


def test_the_table_has_the_worst_links_and_the_file_all(tmp_path):
    sizes = np.random.default_rng(1).permutation(25) + 1.0
    with Log(pulled(tmp_path / "f.mcap", {"track": E1049[:, None] * sizes})) as log:
        found = fatigue.of(RunData(log), signal="tension")
    worst = np.argsort(-sizes)[:10] + 1
    assert [row["link"] for row in found.table().records()] == worst.tolist()
    assert len(found.series().rows) == 25
