"""Regression command: it accepts equal bits and finds a difference in one last digit."""

import shutil
from pathlib import Path
from typing import Literal, get_args, get_origin

import pytest

from orchestrator.scene.scene import load, scene_names
from orchestrator.scene.track_table import TrackModelTable
from tests.regression import __main__ as command
from tests.regression.runs import RUNS, Run

HANGING = Run("hanging_chain", "rigid", (), 0.02)


def test_runs_are_of_all_scenes_and_have_names_of_their_own():
    assert len({str(run) for run in RUNS}) == len(RUNS)
    assert {run.scene for run in RUNS} == set(scene_names())
    for run in RUNS:
        assert load(run.scene, run.track, run.settings).run.stop >= run.stop


def test_runs_have_every_choice_of_a_track():
    tracks = [load(run.scene, run.track, run.settings).track.choices() for run in RUNS]
    for key, about in TrackModelTable.fmu_parameters().items():
        asked = get_args(TrackModelTable.model_fields[key].annotation)
        choices = next((get_args(one) for one in asked if get_origin(one) is Literal), ())
        unset = {"rest"} if key == "start" else set()  # the default of most scenes
        assert {*choices} - unset <= {track.get(about.name) for track in tracks}, key


@pytest.mark.long
def test_equal_bits_are_equal_and_one_last_digit_is_found(tmp_path, monkeypatch):
    heavier = HANGING._replace(settings=("vehicle.gravity=9.810000000000002",))
    for run, name in ((HANGING, "own"), (heavier, "heavier")):
        assert command.recorded(command.ROOT, run, tmp_path / name) == ""

    def copied(root, run, log):
        shutil.copy(tmp_path / ("own" if log.stem == "here" else root), log)
        return ""

    monkeypatch.setattr(command, "recorded", copied)
    same, other = (command.compared(HANGING, Path(name), tmp_path) for name in ("own", "heavier"))
    assert same.ok
    assert same["digest"] == other["digest"]
    assert other.ok is False
    assert "ULP apart" in other.note
    monkeypatch.setattr(command, "recorded", lambda root, run, log: "no such scene")
    assert command.compared(HANGING, None, tmp_path).note == "no such scene"


@pytest.mark.parametrize(
    ("arguments", "says"), [(("--only", "moon"), "--only moon: no run"), (("--against", "x"), "there is no checkout")]
)
def test_what_is_refused(call, arguments, says):
    status, _, err = call(command.app, *arguments)
    assert status == 2
    assert says in err
