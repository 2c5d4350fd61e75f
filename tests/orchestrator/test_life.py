"""Life of pins and links: stresses by hand, rules of mean stress, Miner's sum, and a log with known cycles."""

from contextlib import nullcontext

import numpy as np
import pytest
from analysis_logs import driven_log
from life_logs import LINE, TABLE, log_of
from made_logs import STEP
from scipy.integrate import quad

from fmus.vehicles.tables import BadInput
from fmus.vehicles.vehicle import read_table, vehicle
from orchestrator.log.notices import LogNotice
from orchestrator.log.reader import Log
from orchestrator.results.analyses import catalogue, life
from orchestrator.results.run_data import Missing, RunData, Window

driven = pytest.fixture(scope="module")(driven_log)


def test_the_stresses_of_a_pin_by_hand():
    """A tension of 40 kN: 20 kN a lug, half of it on either side, in bending and shear; bearing; net section."""
    found = {name: 40e3 * each for name, each in life.stresses(TABLE.model_dump()).items()}
    moment = 10e3 * (0.025 + 0.001 + 0.0175)  # N m: from the middle of the outer lug to a quarter of the inner one
    assert moment == pytest.approx(435.0)
    assert found["pin bending"] == pytest.approx(1.2 * moment * 0.015 / (np.pi * 0.015**4 / 4.0), rel=1e-12)
    area = np.pi * 0.015**2
    assert found["pin shear"] == pytest.approx(np.sqrt(3.0) * 4.0 / 3.0 * 10e3 / area, rel=1e-12)
    assert found["body"] == pytest.approx(2.5 * 40e3 / 2e-3, rel=1e-12)
    assert found["inner lug"] == pytest.approx(20e3 / (0.07 * 0.03), rel=1e-12)
    assert found["outer lug"] == pytest.approx(10e3 / (0.05 * 0.03), rel=1e-12)


def test_the_bending_is_that_of_a_beam_under_spread_loads():
    """The largest moment of a pin with one inner lug, loads spread evenly along the lugs, by integration."""
    one = {**TABLE.model_dump(), "lugs": 1, "pin_factor": 1.0}
    a, g, b, force = 0.05, 1e-3, 0.07, 40e3
    middle = a + g + 0.5 * b  # from the outer face of an outer lug
    moment = quad(lambda x: 0.5 * force / a * (middle - x), 0.0, a)[0]
    moment -= quad(lambda x: force / b * (middle - x), a + g, middle)[0]
    assert life.stresses(one)["pin bending"] * force == pytest.approx(32.0 * moment / (np.pi * 0.03**3), rel=1e-9)


def test_the_life_of_a_run_that_failed_says_so(tmp_path):
    for status, said in (("failed", [f"{tmp_path / 'failed.mcap'}: its run failed: it fell over"]), ("ok", [])):
        path = log_of(tmp_path / f"{status}.mcap", np.full((3000, 4), 2e4), status=status, message="it fell over")
        with pytest.warns(LogNotice) if said else nullcontext():
            found = catalogue.analyse(path, "life")
        assert [note for note in found.table().notes if "failed" in note] == said


@pytest.mark.parametrize(
    ("rule", "given", "amplitude"),
    [
        ("none", {}, 80.0),
        ("goodman", {"ultimate": 400.0}, 80.0 / (1.0 - 100.0 / 400.0)),
        ("morrow", {"fracture": 500.0}, 80.0 / (1.0 - 100.0 / 500.0)),
        ("walker", {"exponent": 0.65}, 180.0**0.35 * 80.0**0.65),
        ("swt", {}, np.sqrt(180.0 * 80.0)),
    ],
)
def test_each_rule_of_mean_stress_by_hand(rule, given, amplitude):
    """Amplitude 80, mean 100; a mean of 0 or a pressure changes nothing."""
    line = {"mean_stress": rule, "exponent": 0.65, **given}
    found = life.equivalent_amplitude(np.full(3, 80.0), np.array([100.0, 0.0, -50.0]), line)
    np.testing.assert_allclose(found, [amplitude, 80.0, 80.0], rtol=1e-12)
    if rule in ("goodman", "morrow"):
        assert np.isinf(life.equivalent_amplitude(np.array([1.0]), np.array([600.0]), line)).all()


def test_the_line_has_a_knee():
    line = LINE.model_dump()
    np.testing.assert_allclose(
        1.0 / life.damage_of(np.array([400e6, 200e6, 100e6]), line), [1e6 / 2.0**5, 1e6, 1e6 * 2.0**9], rtol=1e-12
    )
    own = {**line, "slope_beyond": 20.0}
    assert 1.0 / life.damage_of(np.array([100e6]), own)[0] == pytest.approx(1e6 * 2.0**20, rel=1e-12)


def test_the_life_of_a_pin_by_hand(tmp_path):
    """Ten cycles of 0 to 60 kN in the second pin, none in the first: km by Miner's sum of its worst detail."""
    t = np.arange(0.0, 10.0 + 0.5 * STEP, STEP)
    force = np.stack([np.full_like(t, 20e3), 30e3 * (1.0 - np.cos(2.0 * np.pi * t))], axis=1)
    with Log(log_of(tmp_path / "a.mcap", force)) as log:
        found = life.of(RunData(log)).tracks[0]
        assert "went round" in " ".join(life.of(RunData(log), window=Window(0.0, 2.5)).notes())
    assert found.circuits == pytest.approx(10.0)
    per_newton = life.stresses(TABLE.model_dump())
    bending, body = 30e3 * per_newton["pin bending"], 30e3 * per_newton["body"]
    by_hand = 10.0 * (bending / 200e6) ** (5.0 if bending > 200e6 else 9.0) / 1e6
    assert found.damage[0].tolist() == [0.0, 0.0, 0.0]
    assert found.damage[1, 0] == pytest.approx(by_hand, rel=1e-6)
    assert found.damage[1, 2] == pytest.approx(10.0 * (body / 100e6) ** (4.0 if body > 100e6 else 7.0) / 1e6, rel=1e-6)
    assert found.worst == (1, 0)
    assert found.life == pytest.approx(0.2 * 10.0 / by_hand, rel=1e-6)
    assert found.safe_life == pytest.approx(found.life / np.sqrt(3.0))
    assert found.most.tolist() == pytest.approx([20e3, 60e3])
    twin = log_of(tmp_path / "b.mcap", 1.02 * force)
    with Log(twin) as log:
        assert life.of(RunData(log)).tracks[0].life != pytest.approx(found.life, rel=0.05)
        table = life.of(RunData(log)).table()
    assert table.records()[0]["pin"] == 2


def test_what_is_missing_is_said(tmp_path):
    path = log_of(tmp_path / "a.mcap", np.zeros((20, 2)))
    with Log(path) as log:
        assert "no pin of track is damaged" in life.of(RunData(log)).notes()
        run = RunData(log)
        run.scene["vehicle"].pop("life")
        with pytest.raises(Missing, match="the vehicle has no table life"):
            life.of(run)
    table, where = read_table("m113")
    table = {**table, "life": {**table["life"], "pin": {"stress": 1e8, "mean_stress": "morrow"}}}
    with pytest.raises(BadInput, match=r'life.pin.fracture: is missing; mean_stress = "morrow" needs it'):
        vehicle(table, where)


def turning(n, m, turns):
    """Pins (m, n, 3) of a round chain that turns in the numbering of its links."""
    angle = -2.0 * np.pi * (np.arange(n) / n + np.linspace(0.0, turns, m)[:, None])
    return np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=2)


def test_damage_is_booked_where_and_when_the_force_is_largest(tmp_path):
    """Every pin has its largest force at one place; a single pin a larger one at another, once."""
    n, m = 20, 2001
    pins = turning(n, m, 3.3)
    place = -np.arctan2(pins[..., 2], pins[..., 0]) / (2.0 * np.pi) % 1.0
    force = 20e3 + 20e3 * np.exp(-(((place - 0.625) / 0.05) ** 2))
    k = int(np.argmin(np.abs(place[:1200, 7] - 0.225)))
    force[k, 7] = 60e3
    path = log_of(tmp_path / "a.mcap", force, positions=pins)
    with Log(path) as log:
        found = life.of(RunData(log), by="place")
        table, series = found.table(), found.series().records()
    whole = found.tracks[0].damage.sum(axis=0)
    np.testing.assert_allclose(sum(each for _, each in found.tracks[0].booked), whole, rtol=1e-12)
    columns = [f"{name}" for name in life.DETAILS]
    assert [sum(row[name] for row in series) for name in columns] == pytest.approx([100.0] * 3, rel=1e-12)
    share = {int(row["place"] / (2.0 * np.pi / n)): row["pin bending"] for row in series}
    one = life.cycle_damages(force[:, 7], life.stresses(TABLE.model_dump()), TABLE.model_dump())[0][:, 0].max()
    assert share[4] == pytest.approx(100.0 * 2.0 * one / whole[0], rel=1e-3), "two halves of the largest cycle"
    assert share[12] > 0.98 * (100.0 - share[4]), "the one place of all the others"
    assert table.records()[0]["part"] == "", "a chain without wheels has no parts"
    with Log(path) as log, pytest.raises(Missing, match="no phases without the motion of a hull"):
        life.of(RunData(log), by="phase")
    with Log(path) as log, pytest.raises(BadInput, match="by = tooth: must be one of place, phase"):
        life.of(RunData(log), by="tooth")


def test_damage_is_booked_in_the_phase_of_the_largest_force(tmp_path):
    """Three cycles at speed and one larger one in the acceleration before: its peak is there, its lowest point not."""
    t = np.arange(0.0, 8.0, STEP)
    speed = np.interp(t, (1.0, 3.0), (0.0, 4.0))
    force = np.full((len(t), 2), 20e3)
    for moment, most in ((2.0, 60e3), (4.0, 50e3), (5.0, 50e3), (6.0, 50e3)):
        force[:, 1] += (most - 20e3) * np.exp(-(((t - moment) / 0.05) ** 2))
    force[:, 1] -= 10e3 * np.exp(-(((t - 7.0) / 0.05) ** 2))
    with Log(log_of(tmp_path / "a.mcap", force, speed=speed)) as log:
        found = life.of(RunData(log), by="phase")
    rows = {row["phase"]: row for row in found.table().records()}
    assert [*rows] == ["rest", "acceleration", "steady"]
    per_newton = life.stresses(TABLE.model_dump())
    large, small = (
        float(life.damage_of(np.array([half * per_newton["pin bending"]]), LINE.model_dump())[0])
        for half in (25e3, 15e3)  # from the lowest point of all, 10 kN; from 20 kN
    )
    by_hand = 100.0 * large / (large + 3.0 * small)
    assert rows["acceleration"]["pin bending"] == pytest.approx(by_hand, rel=1e-4)
    assert rows["steady"]["pin bending"] == pytest.approx(100.0 - by_hand, rel=1e-3)
    assert rows["rest"]["pin bending"] == pytest.approx(0.0, abs=1e-12)
    whole = found.tracks[0].damage.sum(axis=0)
    np.testing.assert_allclose(sum(each for _, each in found.tracks[0].booked), whole, rtol=1e-12)


def test_the_shares_of_a_vehicle_sum_to_all(driven):
    """Shares by part of a short run of a vehicle, in all the parts of its circuit."""
    with Log(driven) as log:
        found = life.of(RunData(log), by="place")
    rows = found.table().records()
    assert {row["part"] for row in rows} == {
        "sprocket", "front run", "ground run", "rear run", "idler", "upper run",
    }  # fmt: skip
    for name in life.DETAILS:
        assert sum(row[name] for row in rows) == pytest.approx(100.0, rel=1e-12)
