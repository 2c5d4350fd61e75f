"""Savings by omitted parts: pairs of runs, measure of their difference, and table."""

import math

import numpy as np
import pytest

from fmus.vehicles.tables import BadInput
from orchestrator.log.reader import Log
from orchestrator.scene.scene import load
from orchestrator.studies import Row, leaving_out
from orchestrator.studies.leaving_out import KEYS, MOTION, PairedRun, cases, difference, run

BRIEF = ("run.stop=20 ms", "track.start=displaced", "chain.links=8")


def test_pairs_of_the_study():
    quick, full = cases(True), cases(False)
    assert [case[:2] for case in quick] == [case[:2] for case in full]
    assert {case.item for case in full} == {"straight", "settle", "rig", "hanging_chain"}
    assert {case.item for case in cases(True, "rig")} == {"rig"}
    for case in full:
        for side in case.arguments[1]:
            load(case.item, "flexible", side.settings)
    with pytest.raises(BadInput, match="must be one of straight, settle"):
        cases(True, "turn")


@pytest.mark.long
def test_what_is_added_in_vain_changes_nothing(tmp_path):
    bare, kept = tmp_path / "bare.mcap", []
    run("hanging_chain", PairedRun(BRIEF), bare)
    for added in ("chassis", "ground"):
        kept.append(tmp_path / f"{added}.mcap")
        cpu, wall = run("hanging_chain", PairedRun(BRIEF, added), kept[-1])
        assert 0.0 < cpu < 10.0 * wall
        assert difference(bare, kept[-1]) == (0.0, 0.0)
    with Log(kept[0]) as log:
        assert "/chassis/out" in log.topics
    heavier = tmp_path / "heavier.mcap"
    run("hanging_chain", PairedRun((*BRIEF, "vehicle.gravity=9.9")), heavier)
    assert min(difference(bare, heavier)) > 1e-6 > MOTION
    silent = tmp_path / "silent.mcap"
    run("hanging_chain", PairedRun((*BRIEF, "track.link_outputs=false", "run.outputs=4")), silent)
    with Log(silent) as log:
        assert set(log.topics) == {"/chain/in", "/chain/out", "/stats/chain"}
        assert len(log.read("/chain/out").t) == 6
    assert difference(bare, silent) == (0.0, 0.0)


@pytest.mark.long
def test_a_speed_that_is_hardly_shown_is_measured_by_the_motion(tmp_path):
    """A speed near zero is measured by the motion of the links.

    The halves of a chain swing against each other: its mean speed is rounding, but its links move. The growth of
    rounding on this machine is measured by a run with the next larger gravity.
    """
    ulp = f"vehicle.gravity={math.nextafter(9.81, 10.0)!r}"
    logs = [tmp_path / f"{name}.mcap" for name in ("whole", "planar", "ulp", "other")]
    for log, setting in zip(logs, ("planar=false", "planar=true", ulp, "vehicle.gravity=9.9"), strict=True):
        run("hanging_chain", PairedRun((*BRIEF, setting)), log)
    with Log(logs[0]) as log:
        speed = log.read("/chain/out")
        assert abs(speed.values[:, speed.names.index("speed")]).max() < leaving_out.SMALLEST_SCALE
        links = log.read("/chain/links")
        heights = links.values[:, [name.endswith("position.z") for name in links.names]]
        assert abs(np.diff(heights, axis=0) / np.diff(links.t)[:, None]).max() > 2.0 * leaving_out.SMALLEST_SCALE
    grown = difference(logs[0], logs[2])[0]
    assert 30.0 * grown < 1e-6
    assert difference(logs[0], logs[1])[0] <= 30.0 * grown < difference(logs[0], logs[3])[0]


def test_table_and_figure(tmp_path):
    one = (0.5, 0.45, 0.55)
    figures = (2.0, 1.0, *one, *one, 300.0, 200.0, 2.0, 1.0, 1e-12, 1e-10)
    row = Row("rig", "half", dict(zip(KEYS, figures, strict=True)), ok=True)
    lost = Row("rig", "other", ok=False, note="no reason")
    files = leaving_out.write(tmp_path, "leaving-out", [row, lost], "Title")
    assert [file.suffix for file in files] == [".csv", ".md", ".png", ".svg"]
    assert "| rig | half | 2.000 | 1.000 | 0.500 |" in files[1].read_text()
    assert math.isnan(lost["motion"])
    assert 20.0 < leaving_out.peak() < 20_000.0  # MB of a process
