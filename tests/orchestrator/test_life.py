"""Life of pins and links by hand: stresses, rules of mean stress, Miner's sum, where it is booked; wear of pins.

Wear of a belt is in ``tests/fmus/test_bushing.py``.
"""

import numpy as np
import pytest
from life_logs import BUSHING, LINE, TABLE, log_of, worn
from made_logs import STEP
from scipy.integrate import quad

from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results.analyses import life, wear
from orchestrator.results.run_data import RunData, Window
from orchestrator.scene.scene import load


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


def test_the_life_of_a_pin_by_hand(tmp_path):
    """Ten cycles of 0 to 60 kN in the second pin, none in the first: km by Miner's sum of its worst detail."""
    t = np.arange(0.0, 10.0 + 0.5 * STEP, STEP)
    force = np.stack([np.full_like(t, 20e3), 30e3 * (1.0 - np.cos(2.0 * np.pi * t))], axis=1)
    with Log(log_of(tmp_path / "a.mcap", force)) as log:
        found = life.of(RunData(log)).tracks[0]
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
    with Log(log_of(tmp_path / "b.mcap", 1.02 * force)) as log:
        assert life.of(RunData(log)).tracks[0].life != pytest.approx(found.life, rel=0.05)
        table = life.of(RunData(log)).table()
    first = table.records()[0]
    assert first["pin"] == 2
    assert first["largest force"] == pytest.approx(1.02 * 60.0)  # kN
    assert first["largest body"] == pytest.approx(1.02e-6 * 60e3 * per_newton["body"])  # MPa
    pressure = 1.02e-6 * 60e3 * max(per_newton["inner lug"], per_newton["outer lug"])
    assert first["pressure in lugs"] == pytest.approx(pressure)


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
    assert [sum(row[name] for row in series) for name in life.DETAILS] == pytest.approx([100.0] * 3, rel=1e-12)
    share = {int(row["place"] / (2.0 * np.pi / n)): row["pin bending"] for row in series}
    one = life.damages_of(life.rainflow(force[:, 7]), life.stresses(TABLE.model_dump()), TABLE.model_dump())[:, 0].max()
    assert share[4] == pytest.approx(100.0 * 2.0 * one / whole[0], rel=1e-3), "two halves of the largest cycle"
    assert share[12] > 0.98 * (100.0 - share[4]), "the one place of all the others"
    assert table.records()[0]["part"] == "", "a chain without wheels has no parts"


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


# wear


def test_growth_of_the_pitch_by_hand(tmp_path):
    with Log(worn(tmp_path / "worn.mcap", BUSHING)) as log:
        found = wear.of(RunData(log), window=Window(2.0, 8.0))
    (track,) = found.tracks
    assert track.travel == pytest.approx(12.0, rel=1e-12)
    assert track.circuits == pytest.approx(60.0)
    assert track.rubbed == pytest.approx([18.0, 30.0])
    volume = 1e-13 * np.array([18.0, 30.0]) / 0.2  # m3
    growth = volume / (2.0 * 0.01 * 0.25) * 1e6 / 12.0
    assert track.growth == pytest.approx(growth, rel=1e-12)
    assert f"vehicle.track.pitch={0.1 + growth.mean():.7g} --set vehicle.sprocket.pitch=0.1" in found.notes()[-1]
    rows = found.table().rows
    assert rows[0][1:4] == pytest.approx((60.0, 3.0 / 60.0, 24.0 / 60.0))
    assert [row[1] for row in found.series().rows] == [1, 2]


@pytest.mark.long
def test_wear_of_straight_converges_in_the_step_and_is_the_loss_of_the_ledger(tmp_path):
    settings = ["vehicle.track.bushing={friction=0.15, radius=0.012, wear=1e-13, bearing=0.3}"]
    settings += ['track.link_outputs=["turned", "rubbed"]', "run.stop=4", "symmetric=true"]
    growths = []
    for h in (1.25e-3, 6.25e-4):
        path = tmp_path / f"{h}.mcap"
        simulate(load("straight", "rigid", [*settings, f"run.step={h}", f"track.step={h}"]), path)
        with Log(path) as log:
            run = RunData(log)
            growths.append([each.growth.mean() for each in wear.of(run, window=Window(2.5, 4.0)).tracks])
            for each in wear.of(run).tracks:
                _, lost = run.signal(f"{each.track}.energy.dissipated.pins", Window(0.0, 4.0))
                assert each.rubbed.sum() == pytest.approx(lost[-1] - lost[0], rel=1e-6)
    assert growths[0] == pytest.approx(growths[1], rel=0.02)
    assert growths[0] != pytest.approx(1.03 * np.array(growths[1]), rel=0.02)


def test_rainflow_cycles_and_their_matrix(tmp_path):
    """Of 20 to 80 kN with a dip from 60 to 40 on the way down: two cycles of a pin; a matrix has the same ones."""
    force = np.interp(np.arange(0.0, 1.0, STEP), np.linspace(0.0, 0.98, 5), (20e3, 80e3, 40e3, 60e3, 20e3))
    with Log(log_of(tmp_path / "a.mcap", np.stack([force, 0.5 * force], axis=1))) as log:
        cycles, matrix = (life.of(RunData(log), by=by) for by in ("cycle", "matrix"))
        whole = life.of(RunData(log)).tracks[0].damage
    rows = cycles.series().records()
    shown = [(row["pin"], row["range"], row["mean"], row["cycles"]) for row in rows]
    wanted = [(1, 20.0, 50.0, 1.0), (1, 60.0, 50.0, 1.0), (2, 10.0, 25.0, 1.0), (2, 30.0, 25.0, 1.0)]
    np.testing.assert_allclose(sorted(shown), wanted, atol=0.5)  # records beside the turning points
    largest = max(rows, key=lambda row: row["range"])
    assert largest["largest force at"] == pytest.approx(0.245, abs=2.0 * STEP)
    share = 100.0 * cycles.tracks[0].booked[[*cycles.tracks[0].booked].index(max(
        cycles.tracks[0].booked, key=lambda each: each[0][1]))][1] / whole.sum(axis=0)  # fmt: skip
    assert [largest[name] for name in life.DETAILS] == pytest.approx(share.tolist(), rel=1e-12)
    bins = matrix.series().records()
    assert sum(row["cycles"] for row in bins) == 4.0
    for _, size, mean, _ in shown:
        assert any(
            row["range from"] <= size <= row["range to"] and row["mean from"] <= mean <= row["mean to"] for row in bins
        )
    for found in (cycles, matrix):
        np.testing.assert_allclose(sum(each for _, each in found.tracks[0].booked), whole.sum(axis=0), rtol=1e-12)
    assert len(cycles.table().rows) == 4
