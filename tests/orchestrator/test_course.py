"""Life of a course: Miner's sum of runs by hand, whole circuits, and its spread."""

import re

import cotrack as installed
import numpy as np
import pytest
from life_logs import LENGTH, LINE, TABLE, log_of, waves
from made_logs import STEP

from fmus.vehicles.tables import BadInput
from orchestrator.execution import course
from orchestrator.execution.course import ALL, ERROR, HALVES, RECORDS, REST, SEEDS, WORST
from orchestrator.log.reader import Missing
from orchestrator.results.analyses import life
from orchestrator.results.run_data import RunData

PER_NEWTON = life.stresses(TABLE.model_dump())["pin bending"]


def one_cycle(amplitude):
    """Damage of the bending of a pin by a cycle with this amplitude, N."""
    return float(life.damage_of(np.array([PER_NEWTON * amplitude]), LINE.model_dump())[0])


def course_of(folder, *runs):
    """Life on a course of runs, each a log's name, km and further lines."""
    lines = (f"[[run]]\nlog = {log}\nkm = {km}\n{more}\n" for log, km, more in runs)
    (folder / "course.toml").write_text("\n".join(lines), encoding="utf-8")
    return course.life(folder / "course.toml")


def life_of(found, estimate=ALL):
    """Least and largest life of 50 %, km, by an estimate."""
    row = found.table().records()[estimate]
    return row["50 % last, least"], row["50 % last, most"]


@pytest.fixture
def runs(tmp_path):
    """Folder of two runs of the same chain, one of pins that all have the same, one of pins that have not."""
    log_of(tmp_path / "even.mcap", waves(20e3, 20e3, 20e3, 20e3))
    log_of(tmp_path / "odd.mcap", waves(20e3, 22e3, 24e3, 30e3))
    return tmp_path


def test_the_life_of_a_course_by_hand(runs):
    """30 km of one run and 10 km of the other: Miner's sum of the means of all links, and of the worst ones."""
    found = course_of(runs, ('"even.mcap"', 30, ""), ('"odd.mcap"', 10, ""))
    circuits = 1000.0 / LENGTH  # in a km
    even, odd = (circuits * np.array([one_cycle(a) for a in each]) for each in ([20e3] * 4, [20e3, 22e3, 24e3, 30e3]))
    by_hand = 1.0 / (0.75 * even.mean() + 0.25 * odd.mean())
    assert life_of(found) == pytest.approx((by_hand, by_hand), rel=1e-4)
    assert life_of(found, WORST)[0] == pytest.approx(1.0 / (0.75 * even.max() + 0.25 * odd.max()), rel=1e-4)
    row = found.table().records()[ALL]
    assert row["90 % last, least"] == pytest.approx(by_hand / np.sqrt(3.0), rel=1e-4)
    assert (row["track"], row["breaks by"]) == ("track", "pin bending")
    rows = found.runs().records()
    assert [one["of it"] for one in rows] == pytest.approx(
        [100.0 * 0.75 * even.mean() * by_hand, 100.0 * 0.25 * odd.mean() * by_hand], rel=1e-4
    )
    assert [one["worst over all"] for one in rows] == pytest.approx([1.0, odd.max() / odd.mean()], rel=1e-4)
    assert [one["circuits"] for one in rows] == [4, 4]
    both = course_of(runs, ('["even.mcap", "odd.mcap"]', 10, ""))
    assert life_of(both, WORST)[0] == pytest.approx(1.0 / odd.max(), rel=1e-4), "the worst link of any log"
    twin = course_of(runs, ('"even.mcap"', 29, ""), ('"odd.mcap"', 11, ""))
    assert life_of(twin)[0] != pytest.approx(by_hand, rel=0.02)


def test_order_and_unit_of_the_shares_do_not_matter(runs):
    """Runs in another order, a run in two parts, shares in m: the same life; also from Python."""
    found = course_of(runs, ('"even.mcap"', 30, ""), ('"odd.mcap"', 10, ""))
    other = course_of(runs, ('"odd.mcap"', '"4000 m"', ""), ('"even.mcap"', 24, ""), ('["odd.mcap"]', 4, ""))
    assert life_of(other) == pytest.approx(life_of(found), rel=1e-12)
    np.testing.assert_allclose(installed.life(runs / "course.toml").rates["track"], other.rates["track"])


def test_a_rest_of_a_circuit_is_left_out(tmp_path):
    """Four circuits and 0.4 of one with a larger cycle: the rest says what it would add."""
    whole = waves(20e3, 20e3, 20e3, 20e3)
    more = waves(*[20e3] * 4, seconds=4.4, growth=lambda t: 1.0 + 1.0 * (t > 4.1))
    log_of(tmp_path / "whole.mcap", whole)
    log_of(tmp_path / "more.mcap", more)
    found, longer = (course_of(tmp_path, (f'"{name}.mcap"', 1, "")) for name in ("whole", "more"))
    assert life_of(longer) == pytest.approx(life_of(found), rel=1e-6)
    least, most = life_of(longer, REST)
    assert least < 0.5 * most
    assert life_of(found, REST) == pytest.approx(life_of(found), rel=1e-9)
    window = course_of(tmp_path, ('"more.mcap"', 1, 'from = 1\nto = "3.2 s"'))
    assert window.circuits == (2,)
    assert life_of(window) == pytest.approx(life_of(found), rel=1e-3)


def test_a_chain_that_stands_adds_nothing(tmp_path):
    """A rest before and after the way: of the same circuits, the same life."""
    force = waves(20e3, 20e3, 20e3, 20e3)
    log_of(tmp_path / "a.mcap", force)
    still = np.concatenate([np.repeat(force[:1], 700, axis=0), force, np.repeat(force[-1:], 400, axis=0)])
    way = np.clip(LENGTH * (np.arange(len(still)) * STEP - 0.7), 0.0, 4.0 * LENGTH)
    log_of(tmp_path / "b.mcap", still, travel=way)
    lives = [life_of(course_of(tmp_path, (f'"{name}.mcap"', 1, ""))) for name in "ab"]
    assert lives[1] == pytest.approx(lives[0], rel=1e-6)
    still[-300:] = 0.0  # all pins are released when it stands: of four cycles, one is from 80 kN to 0
    log_of(tmp_path / "c.mcap", still, travel=way)
    by_hand = 4.0 * one_cycle(20e3) / (3.0 * one_cycle(20e3) + one_cycle(40e3))
    assert life_of(course_of(tmp_path, ('"c.mcap"', 1, "")))[0] / lives[0][0] == pytest.approx(by_hand, rel=1e-3)


def test_seeds_and_halves_spread(tmp_path):
    """Logs of other seeds bound the life by their own; so do the halves of a run that gets rougher."""
    for name, size in (("a", 20e3), ("b", 23e3), ("c", 21e3)):
        log_of(tmp_path / f"{name}.mcap", waves(*[size] * 4))
    found = course_of(tmp_path, ('["a.mcap", "b.mcap", "c.mcap"]', 5, ""))
    alone = [1000.0 / LENGTH * one_cycle(size) for size in (20e3, 23e3, 21e3)]
    assert life_of(found)[0] == pytest.approx(1.0 / np.mean(alone), rel=1e-4), "the mean of damages, not of lives"
    assert life_of(found, SEEDS) == pytest.approx((1.0 / alone[1], 1.0 / alone[0]), rel=1e-4)
    assert np.isnan(life_of(course_of(tmp_path, ('"a.mcap"', 5, "")), SEEDS)).all()
    both = course_of(tmp_path, ('"a.mcap"', 5, ""), ('["b.mcap", "c.mcap"]', 15, ""))
    assert both.table().records()[SEEDS]["known of runs"] == 1
    bounds = [1.0 / (0.25 * alone[0] + 0.75 * each) for each in alone[1:]]
    assert life_of(both, SEEDS) == pytest.approx(bounds, rel=1e-4)
    log_of(tmp_path / "rough.mcap", waves(*[20e3] * 4, growth=lambda t: 1.0 + 0.1 * (t > 2.0)))
    least, most = life_of(course_of(tmp_path, ('"rough.mcap"', 5, "")), HALVES)
    assert most == pytest.approx(1.0 / alone[0], rel=0.01)
    assert most / least == pytest.approx(one_cycle(22e3) / one_cycle(20e3), rel=0.05)


def test_logs_of_one_run_are_of_one_scene(runs, monkeypatch):
    """A list holds logs that differ in the seed; another setting is named."""
    begin, other = RunData.__init__, {"ground": {"rough": {"seed": 2}}}

    def changed(run, log):
        begin(run, log)
        run.scene = {**run.scene, **(other if "odd" in str(log.path) else {"ground": {"rough": {"seed": 1}}})}

    monkeypatch.setattr(RunData, "__init__", changed)
    course_of(runs, ('["even.mcap", "odd.mcap"]', 1, ""))
    other["drive"] = {"speed": 12.0}
    with pytest.raises(Missing, match=r"odd\.mcap: drive is not as in even\.mcap: logs of one run differ in the seed"):
        course_of(runs, ('["even.mcap", "odd.mcap"]', 1, ""))
    with pytest.raises(Missing, match=r"even\.mcap: drive is not as in odd\.mcap"):
        course_of(runs, ('["odd.mcap", "even.mcap"]', 1, ""))
    course_of(runs, ('"even.mcap"', 1, ""), ('"odd.mcap"', 1, ""))


def test_error_and_records_spread(tmp_path):
    """An estimated error of 2 % of the forces bounds the life by the slope; so does what every second record misses."""
    force = waves(*[20e3] * 4)
    force[501::1000, 0] += 5e3  # at the tops of one pin, in odd records
    log_of(tmp_path / "a.mcap", force, error=0.02)
    found = course_of(tmp_path, ('"a.mcap"', 5, ""))
    (life_km, _), (least, most) = life_of(found), life_of(found, ERROR)
    slope = 9.0 if PER_NEWTON * 26e3 < 200e6 else 5.0
    assert slope == 9.0, "all cycles are below the knee"
    assert (life_km / least, life_km / most) == pytest.approx((1.02**9, 0.98**9), rel=1e-9)
    least, most = life_of(found, RECORDS)
    without, spiked = one_cycle(20e3), one_cycle(22.5e3)
    assert most == life_km
    assert life_km / least == pytest.approx(2.0 - without / (0.75 * without + 0.25 * spiked), rel=1e-4)
    assert np.isnan(life_of(course_of(tmp_path, (f'"{log_of(tmp_path / "b.mcap", force).name}"', 5, "")), ERROR)).all()


def test_km_are_the_mean_way_of_the_chains(tmp_path):
    """In a turn the outer chain goes round three times as often: a km is that of the middle."""
    force = waves(*[20e3] * 4)
    t = np.arange(len(force)) * STEP
    travel = {"left_track": 0.5 * LENGTH * t, "right_track": 1.5 * LENGTH * t}
    log_of(tmp_path / "a.mcap", force, travel=travel, tracks=("left_track", "right_track"))
    found = course_of(tmp_path, ('"a.mcap"', 5, ""))
    assert found.circuits == (2,)
    left, right = (found.damage(side)[0, ALL, 0, 0] for side in ("left_track", "right_track"))
    assert (left, right) == pytest.approx([1000.0 / LENGTH * one_cycle(20e3)] * 2, rel=1e-4)
    assert {row["track"] for row in found.table(every=True).records()} == {"left_track", "right_track"}


def test_no_damage_is_a_life_without_end(tmp_path):
    log_of(tmp_path / "a.mcap", np.full((3001, 4), 20e3))
    found = course_of(tmp_path, ('"a.mcap"', 5, ""))
    assert life_of(found) == (np.inf, np.inf)
    assert "inf" in str(found.table())
    assert np.isnan(found.runs().records()[0]["of it"])


def test_the_command_prints_tables_and_writes_them(runs, cotrack):
    found = course_of(runs, ('"even.mcap"', 30, ""), ('"odd.mcap"', 10, ""))
    out = cotrack.done("life", runs / "course.toml", "-o", runs / "new" / "folder")
    assert out.splitlines()[:-1] == f"{found.table()}\n\n{found.runs()}".splitlines()
    assert (runs / "new" / "folder" / "life.csv").read_text() == found.table(every=True).csv()
    assert (runs / "new" / "folder" / "runs.csv").read_text() == found.runs().csv()


def test_damage_below_the_knee_is_told(tmp_path):
    """The knee of a pin that bends is at 200 MPa: of one run no cycle reaches it, of the other all go beyond."""
    knee = 200e6 / PER_NEWTON
    for name, size in (("below", 0.9), ("above", 1.1)):
        log_of(tmp_path / f"{name}.mcap", waves(*[size * knee] * 4))
    below, above = (1000.0 / LENGTH * one_cycle(size * knee) for size in (0.9, 1.1))
    for km, told in ((1000, f"{100.0 * below / (below + 1e-3 * above):.3g} %"), (1e-3, "")):
        notes = course_of(tmp_path, ('"below.mcap"', km, ""), ('"above.mcap"', 1, "")).table().notes
        assert [note.partition(" of the damage")[0] for note in notes] == [told] * bool(told)


def test_an_unknown_key_of_a_course_has_its_suggestion(runs):
    for more, told in (("too = 3", "unknown key 'run[1].too': did you mean 'to'?"), ("[corse]", "unknown key 'corse'")):
        with pytest.raises(BadInput, match=re.escape(told)):
            course_of(runs, ('"even.mcap"', 1, more))
