"""Life of pins and links: stresses by hand, rules of mean stress, Miner's sum, and a log with known cycles."""

import numpy as np
import pytest
from made_logs import STEP, made
from scipy.integrate import quad

from fmus.vehicles.life_tables import FatigueTable, LifeTable
from fmus.vehicles.tables import BadInput
from fmus.vehicles.vehicle import read_table, vehicle
from orchestrator.log.reader import Log
from orchestrator.results.analyses import life
from orchestrator.results.run_data import Missing, RunData, Window

LINE = FatigueTable(stress=200e6, cycles=1e6, slope=5.0, mean_stress="none")
TABLE = LifeTable(
    pin_diameter=0.03, lugs=2, inner_lug=0.07, outer_lug=0.05, gap=1e-3, body_area=2e-3, pin_factor=1.2,
    body_factor=2.5, pin=LINE, body=LINE.model_copy(update={"slope": 4.0, "stress": 100e6}),
)  # fmt: skip


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


def log_of(path, forces, table=TABLE):
    """Log of a chain of two links of 0.1 m that goes round in a second, with these forces (m, 2) in its pins, N."""
    topics = {
        "/track/links": [(f"joint[{i}].force.{axis}", "N") for axis in "xyz" for i in (1, 2)],
        "/track/out": [("travel", "m")],
    }
    t = np.arange(len(forces)) * STEP
    values = np.concatenate([0.6 * forces, 0.0 * forces, 0.8 * forces], axis=1)
    scene = {"vehicle": {"track": {"pitch": 0.1}, "life": table.model_dump()}, "track": {"model": "rigid"}}
    return made(path, topics, {"/track/links": (t, values), "/track/out": (t, 0.2 * t[:, None])}, scene)


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
