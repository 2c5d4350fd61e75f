"""The study of mobility: theory beside numbers of terrain theory and statics, limits, files and page, trials."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from fmus.ground.soils import law_of
from orchestrator.studies import Row, mobility
from orchestrator.studies.mobility import limit_trials, soil_trials, theory
from orchestrator.studies.mobility.limit_trials import STEP_AND_GAP
from orchestrator.studies.mobility.ride_trials import HALF_ROUNDS
from orchestrator.studies.mobility.soil_trials import DRAWBAR
from orchestrator.studies.mobility.trial import bisect, first_crossing, limit_speed, run_up, trial_scene, vehicle_of


@pytest.fixture(scope="module")
def m113():
    return vehicle_of("straight")


def soil(name, vehicle):
    track = vehicle.table.track
    return law_of(name, track.pitch, track.width)


# --- theory ---


@pytest.mark.parametrize(("slip", "length", "modulus"), [(0.05, 2.667, 0.025), (0.9, 0.1524, 0.012)])
def test_shear_under_a_track_is_its_mean(slip, length, modulus):
    mean = quad(lambda x: -math.expm1(-slip * x / modulus), 0.0, length)[0] / length
    assert theory.shear_fraction(slip, length, modulus) == pytest.approx(mean, rel=1e-10)
    assert theory.shear_fraction(1.03 * slip, length, modulus) != pytest.approx(mean, rel=1e-3)


# Wong's integral and Bekker's resistance by hand, uniform pressure, both tracks: pull in kN at a slip
PULLS = [("dry_sand", 0.05, 67.29), ("dry_sand", 0.2, 79.16), ("dry_sand", 1.0, 82.35), ("sandy_loam_15", 0.2, 85.19)]


@pytest.mark.parametrize(("name", "slip", "pull"), PULLS)
def test_pull_under_uniform_pressure(m113, name, slip, pull):
    assert theory.drawbar(m113.table, soil(name, m113), m113.weight, slip).high == pytest.approx(1e3 * pull, rel=2e-4)
    assert theory.drawbar(m113.table, soil(name, m113), 1.03 * m113.weight, slip).high > 1.01e3 * pull


def test_resistance_of_a_link_under_each_wheel(m113):
    law, table = soil("dry_sand", m113), m113.table
    lengths = m113.length, 5.0 * table.track.pitch
    uniform, single = (m113.weight / (2.0 * table.track.width * part) for part in lengths)
    assert theory.compaction_resistance(law, uniform) == pytest.approx(922.0, rel=2e-3)
    assert theory.compaction_resistance(law, single) == pytest.approx(10079.0, rel=2e-3)


@pytest.mark.parametrize("radius", [0.0, 0.305])
def test_a_step_that_the_centre_of_mass_passes(m113, radius):
    """On hind wheels whose tread is on the chain's line: a sin(t) - h (1/cos(t) - cos(t)) + r (1 - cos(t)) at most."""
    wheels = m113.table.road_wheel.model_copy(update={"radius": radius})
    idler = m113.table.idler.model_copy(update={"radius": radius})  # the road wheels stay the lowest ones
    table = m113.table.model_copy(update={"road_wheel": wheels, "idler": idler})
    (x, z), r, t = theory.centre_of_mass(table), radius + 2.0 * table.track.face, np.linspace(0.0, 1.2, 5000)
    a, h, c = x - min(wheels.x), z - wheels.z + r, np.cos(t)
    height = (a * np.sin(t) - h * (1.0 / c - c) + r * (1.0 - c)).max()
    assert theory.passed_step(table, (min(wheels.x), wheels.z, radius)) == pytest.approx(height, rel=1e-5)
    assert theory.passed_step(table, (min(wheels.x) - 0.05, wheels.z, radius)) > 1.02 * height


def test_steps_and_gaps_of_the_m113(m113):
    """The road wheels' limits are those that are published of the vehicle, 0.61 and 1.68 m, to 2 % and within.

    The centre of mass is that of all bodies of a run at its start.
    """
    assert theory.centre_of_mass(m113.table) == pytest.approx((-1.9924, 0.0303), abs=0.006)
    step, gap = theory.largest_step(m113.table), theory.largest_gap(m113.table)
    assert step.low == pytest.approx(0.61, rel=0.02)
    assert gap.low < 1.68 < gap.high
    assert gap == pytest.approx((1.333, 1.988), abs=1e-3)


def test_the_steepest_slope_of_a_soil(m113):
    """The pull at full slip is the weight's component."""
    law, weight = soil("dry_sand", m113), m113.weight

    def surplus(a):
        return theory.drawbar(m113.table, law, weight * math.cos(a), 1.0).high - weight * math.sin(a)

    angle = brentq(surplus, 0.0, 1.0)
    assert limit_trials.slopes(m113, "dry_sand").high == pytest.approx(math.tan(angle), rel=1e-9)
    assert math.tan(angle) < law.tan


# --- limits ---


def test_bisection_closes_in_on_a_limit():
    limit = bisect(lambda x: "too much" if x > 0.637 else "", 0.0, 1.0, 10)
    assert limit.passed <= 0.637 < limit.failed
    assert limit.failed - limit.passed == pytest.approx(2.0**-10)
    assert (limit.runs, limit.reason) == (12, "too much")
    assert bisect(lambda x: "", 0.0, 1.0, 10).passed == 1.0
    assert math.isnan(bisect(lambda x: "no", 0.0, 1.0, 10).passed)
    assert first_crossing([1, 2, 3], [0.0, 2.0, 6.0], 3.0) == pytest.approx(2.25)
    assert first_crossing([1, 2], [5.0, 2.0], 3.0) == 1
    assert limit_speed("v", [1, 2], [0.0, 1.0], 3.0).note == "not up to 2 m/s"


# --- scenes ---


def test_trials_are_of_the_scenes_vehicle(m113):
    cases = mobility.cases(True)
    assert {case.item for case in cases} == {trial.name for trial in mobility.TRIALS}
    assert len(cases) < len(mobility.cases(False)) / 2
    scene = trial_scene(m113, "a trial", 1.0003, friction=0.7, ground={"grade": 0.1}, drive={"mode": "speed"})
    assert scene.vehicle.contact.ground.friction == 0.7
    assert scene.vehicle.track == m113.table.track
    assert scene.symmetric
    assert scene.run.stop == pytest.approx(1.00125)
    robot = vehicle_of("robot")
    assert robot.pace < 0.5 * m113.pace
    ramp, speed = run_up(m113, 10.0), 10.0
    assert 0.5 * math.pi * speed / ramp == pytest.approx(0.2 * 9.81)


# --- files ---

PULL = {
    "soil": "dry_sand", "low": -6.0, "high": 70.0, "resistance": 14.0, "length": 0.3, "efficiency": 0.4,
    "settlement": 0.1, "weight": 150.0,
}  # fmt: skip
ROWS = [
    Row(DRAWBAR.name, "dry_sand, slip 0.1", {**PULL, "slip": 0.1, "pull": 20.0}, True),
    Row(DRAWBAR.name, "dry_sand, slip 0.4", {**PULL, "slip": 0.4, "pull": 50.0}, True),
    Row(DRAWBAR.name, "dry_sand, slip 0.9", {}, False, "took longer than <1800> s"),
    Row(STEP_AND_GAP.name, "step", {"passed": 0.9, "failed": 0.92, "low": 0.6, "high": 1.0, "runs": 7}, True, "stands"),
]


def test_files_and_page(tmp_path):
    """A trial whose runs failed has a table and no picture; the summary interpolates."""
    written = {path.name: path for path in mobility.write(tmp_path, "mobility", ROWS[2:], mobility.TITLE)}
    assert {"mobility.md", "mobility.html", "mobility-drawbar.csv", "mobility-step_and_gap.png"} <= set(written)
    assert "mobility-drawbar.png" not in written
    text = written["mobility.html"].read_text()
    assert (text.count("<section"), text.count('src="data:image/png;base64,'), text.count("<script")) == (2, 1, 0)
    assert "longer than &lt;1800&gt; s" in text
    table = {row["measure"]: row for row in mobility.table(ROWS).records()}
    pull = table["pull at slip 0.2, dry_sand"]
    assert (pull["value"], pull["note"]) == (pytest.approx(30.0), "0.20 of the weight")
    assert table["largest step"]["value"] == 0.9


def test_speed_limits_are_those_of_each_ground():
    """Rows in any order; those without a figure, of runs that failed, count as not there."""
    rows = [
        Row(HALF_ROUNDS.name, "", {"radius": radius, "speed": speed, "peak": radius * speed * 10.0})
        for radius in (0.2, 0.1)
        for speed in (4.0, 1.0, 2.0)
    ]
    rows.append(Row(HALF_ROUNDS.name, "", {"radius": 0.1, "speed": 3.0}, note="the chain jumps"))
    found = {finding.measure[-6:]: finding.value for finding in HALF_ROUNDS.find(rows)}
    assert found == {"200 mm": pytest.approx(1.25), "100 mm": pytest.approx(2.5)}


# --- trials ---


@pytest.mark.study
def test_trials_on_soil():
    """Pull inside its bracket and from shear that begins anew under each wheel; wheels carry the weight."""
    (row,) = soil_trials.pull("straight", "dry_sand", 0.05)
    assert row.ok
    assert row["slip"] == pytest.approx(0.06, abs=0.01)
    assert 0.25 < row["length"] < 0.45
    assert not soil_trials.pull("straight", "clayey_soil_38", 0.9)[0]["pull"] > row["high"]
    (under,) = soil_trials.maxima("straight", "dry_sand")
    assert under.ok
    assert under["peak"] > under["mean_maximum"] > 1.5 * under["nominal"]


@pytest.mark.study
def test_trials_of_limits():
    (row,) = limit_trials.on_hard_ground("straight", 0.3, 3)
    assert row.ok
    assert 28.0 < row["climbed"] < 30.0
    (row,) = soil_trials.turn("straight", "dry_sand")
    assert row.ok
