"""Largest forces of a run: where and when, their 99.9 %, and what a sweep records for them."""

import csv
import re

import numpy as np
import pytest
from made_logs import made

from fmus.track.link_outputs import STANDARD
from orchestrator.log.reader import Log
from orchestrator.results.largest_forces import FORCES, largest
from orchestrator.results.measures import NAMES, OBSERVABLES
from orchestrator.results.run_data import EVER, Missing, RunData, Window
from orchestrator.studies.wanted_figures import recording_settings, wanted_figures

BEARERS = 3


def log_of(path, values):
    """Log of a track whose pins, links and wheels bear vectors of the sizes ``values`` (m, 3)."""
    t = 0.01 * np.arange(len(values))
    vectors = np.concatenate([0.6 * values, 0.0 * values, -0.8 * values], axis=1)
    names = [one.signal for one in FORCES.values() if one.signal]
    topics = {
        "/left_track/links": [
            (f"{n.replace('*', str(i + 1))}.{a}", "N") for n in names for a in "xyz" for i in range(3)
        ],
        "/left_track/out": [
            ("travel", "m"),
            *((f"{wheel}.force.{a}", "N") for a in "xyz" for wheel in ("sprocket", "road_wheel[1]", "idler")),
            *((f"{wheel}.torque.{a}", "N.m") for wheel in ("sprocket", "road_wheel[1]", "idler") for a in "xyz"),
        ],
    }
    outputs = np.concatenate([np.zeros((len(t), 1)), vectors, np.zeros((len(t), 9))], axis=1)
    rows = {"/left_track/links": (t, np.tile(vectors, len(names))), "/left_track/out": (t, outputs)}
    return made(path, topics, rows, instances=("left_track",))


@pytest.mark.parametrize("name", FORCES)
def test_the_largest_force_has_its_bearer_place_and_time(tmp_path, name):
    values = np.zeros((1000, BEARERS))
    values[:, 1] = np.linspace(1.0, 1000.0, 1000)  # the others bear nothing, which counts for no share
    values[300, 2] = 4e3
    with Log(log_of(tmp_path / "a.mcap", values)) as log:
        run = RunData(log)
        found = largest(run, name)
        early = largest(run, name, "left", Window(0.0, 1.0))
        assert NAMES[name](run, "", EVER) == found.most == pytest.approx(4e3)
        assert NAMES[f"{name}_high"](run, "", EVER) == found.high
        assert OBSERVABLES[name].place(run) == found.place
    bearer = FORCES[name].place.format("idler" if name == "wheel_force" else "3")
    assert found.place == f"{bearer} of the left track at 3 s"
    assert found.high == pytest.approx(np.quantile(values[values > 0.0], 0.999))
    assert found.high != pytest.approx(np.quantile(values, 0.999), rel=1e-3)
    assert (early.most, early.t) == (pytest.approx(101.0), 1.0)


def test_what_no_wheel_touches_and_what_is_not_recorded_is_said(tmp_path):
    with Log(log_of(tmp_path / "a.mcap", np.zeros((10, BEARERS)))) as log:
        found = largest(RunData(log), "horn_force")
        assert (found.most, found.high, found.place) == (0.0, 0.0, "(none)")
    topics = {"/track/links": [("joint[1].force.x", "N")], "/track/out": [("travel", "m")]}
    t = np.array([0.0, 0.01])
    nothing = made(tmp_path / "b.mcap", topics, {"/track/links": (t, t[:, None]), "/track/out": (t, t[:, None])})
    with Log(nothing) as log:
        run = RunData(log)
        with pytest.raises(Missing, match=re.escape("holds no 'track.joint[*].tooth.force'; record it with the group")):
            largest(run, "tooth_force")
        with pytest.raises(Missing, match="'track' has no wheels"):
            largest(run, "wheel_force")
        with pytest.raises(Missing, match="the vehicle has no recoil"):
            NAMES["recoil_stroke"](run, "", EVER)


def test_a_sweep_records_what_its_figures_need():
    def recorded(*texts, **given):
        return recording_settings(wanted_figures(texts), given)

    assert recorded("pin_force", "wheel_force") == {}
    assert recorded("tooth_force_high,pin_moment") == {"track.link_outputs": [*STANDARD, "teeth", "moment"]}
    assert recorded("life") == {"run.links": 1}
    assert recorded("rim_force", **{"track.link_outputs": "all"}) == {"track.link_outputs": "all"}


def test_a_sweep_answers_with_the_figures_that_it_is_asked_for(cotrack, tmp_path):
    """Pins, teeth and life over the pull on a chain; the printed table has no other figures, the CSV has all."""
    short = ("--track", "rigid", "--set", "run.stop=0.3 s", "--set", "bench.links=24", "--no-estimate", "--workers", 1)
    pulls = ("--vary", "bench.upper=15,60 kN", "--for", "tooth_force,pin_force", "--for", "life")
    status, out, err = cotrack("sweep", "sprocket_bench", *short, *pulls, "-o", "found")
    assert status == 0, err
    head = out.splitlines()[0].strip("| ").split(" | ")
    assert head[:3] == ["bench.upper, kN", "status", "checks"]
    figures = ["pin_force, N", "pin_force_high, N", "tooth_force, N", "life pin", "life damage, 1/km"]
    assert [one for one in head if one in figures] == figures
    assert not {"speed, m/s", "tension_max, N"} & {*head}
    rows = list(csv.DictReader((tmp_path / "found" / "sweep.csv").open()))
    assert {*figures, "tension_max, N"} <= {*rows[0]}
    light, heavy = ({name: float(row[name]) for name in figures} for row in rows)
    assert 15e3 < light["pin_force, N"] < 16e3
    assert 60e3 < heavy["pin_force, N"] < 62e3
    for row in (light, heavy):
        assert 0.0 < row["tooth_force, N"] < row["pin_force, N"]
    assert heavy["life damage, 1/km"] > 1e3 * light["life damage, 1/km"]
