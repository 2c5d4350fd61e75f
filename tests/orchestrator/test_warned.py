"""Warnings of components in summary, JSON and log: each kind once, with time and count."""

import json
import logging
import sys
from contextlib import ExitStack
from dataclasses import asdict

import numpy as np
import pytest
from built_toy import build_toy
from conftest import messages
from logged import logged

from fmus.fmi.build import build_all
from orchestrator.cli import main
from orchestrator.cosim.component import Component
from orchestrator.cosim.coupling import scheme
from orchestrator.cosim.coupling.iterative import Coupling as Iterative
from orchestrator.cosim.graph import Connection, Instance, System, connect
from orchestrator.cosim.initialisation import load_components
from orchestrator.cosim.messages import ComponentWarning, WarningList
from orchestrator.cosim.program import Program
from orchestrator.execution import loading, prepared_run, replay_model
from orchestrator.files.messages import RUN
from orchestrator.fmi.slave import ComponentFailed
from orchestrator.log.reader import Log
from orchestrator.log.tools import WHOLE, recover, verify
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load

H = 1e-3
CREAKS = "the spring creaks at 5 % of its load"


@pytest.fixture
def cotrack(capsys, monkeypatch, tmp_path):
    """Return a function that calls the command: exit code, stdout, lines on stderr."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["cotrack", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        said = capsys.readouterr()
        return ended.value.code or 0, said.out, messages(said.err).replace("cotrack: ", "").splitlines()

    return call


@pytest.fixture
def creaking(monkeypatch, toy):
    """Make the component of every chain scene a spring that warns at every step."""
    graph = System((Instance("chain", toy, {"trouble": "warn"}, 0),), ())
    monkeypatch.setattr(loading, "system", lambda assembly, native: graph)


def entries(out):
    return json.loads(out.splitlines()[-1])["warnings"]


# ------------------------------------------------------------------ counting


def test_texts_that_differ_in_numbers_only_are_one():
    warnings = WarningList("track")
    first = [
        warnings.add("link 3 is\n  hot: -1.5e+03 K at t = 0.25 s", 0.25),
        warnings.add("link 12 is hot: 7 K at t = 0.5 s", 0.5),
        warnings.add("link 3 is cold: -1.5e+03 K at t = 0.25 s", 0.75),
    ]
    assert first == [True, False, True]
    assert warnings.entries() == [
        ComponentWarning("track", "link 3 is hot: -1.5e+03 K at t = 0.25 s", 0.25, 2),
        ComponentWarning("track", "link 3 is cold: -1.5e+03 K at t = 0.25 s", 0.75, 1),
    ]


def test_steps_taken_back_take_their_warnings_with_them_but_for_what_is_said_once():
    warnings = WarningList("track")
    warnings.add("hot", 0.0)
    before = warnings.save()
    for _ in range(2):  # the same step twice; the first one is rejected
        warnings.restore(before)
        assert not warnings.add("hot", 0.1)
        warnings.add("cold", 0.1)
    assert warnings.entries() == [ComponentWarning("track", "hot", 0.0, 2), ComponentWarning("track", "cold", 0.1, 1)]
    warnings.restore(before)
    assert warnings.entries() == [ComponentWarning("track", "hot", 0.0, 1), ComponentWarning("track", "cold", 0.1, 1)]
    warnings.add("cold", 0.3)
    assert warnings.entries()[1] == ComponentWarning("track", "cold", 0.3, 1), (
        "the time is that of the first accepted step with it"
    )


def test_a_component_that_warns_at_every_step_is_heard_once(toy):
    with logged() as heard, Component(toy, "toy") as component:
        component.initialise({"trouble": "warn"}, start=0.1)
        assert component.warnings == []
        for k in range(5):
            component.step(k * H, H)
        saved = component.save()
        component.step(5 * H, H)
        component.restore(saved)
        assert component.warnings == [ComponentWarning("toy", CREAKS, 0.0, 5)]
        assert heard == [f"toy: {CREAKS}"]
        component.initialise({"trouble": "none"})
        component.step(0.0, H)
        assert component.warnings == [], "a new start clears the warnings"


# ------------------------------------------------------------------ runs

SHORT = ("run", "hanging_chain", "--stop", "0.02")


VARIABLE = ("--set", "run.variable.tolerance=0.5", "--set", "run.variable.longest=1 ms")


@pytest.mark.parametrize("settings", [(), ("--no-estimate",), VARIABLE])
def test_what_comes_at_every_step_is_one_entry_with_a_count(cotrack, creaking, settings):
    """A warning at every step is one entry with a count.

    Warm-up steps, rejected steps and the coarser companion runs do not count.
    """
    status, out, err = cotrack(*SHORT, *settings, "--json")
    assert entries(out) == [{"component": "chain", "text": CREAKS, "time": 0.0, "count": 20}]
    assert status == 1, "a spring fails the checks of a chain"
    assert err == [f"chain: {CREAKS}"]


def test_sweeps_of_an_iteration_count_once(toy):
    """Iterations of a step count once: two springs on one another, each step repeated until both agree."""
    instances = tuple(Instance(name, toy, {"trouble": "warn"}, stage) for stage, name in enumerate(("one", "two")))
    wires = tuple(Connection(a, ("x",), b, ("force",)) for a, b in (("one", "two"), ("two", "one")))
    graph = System(instances, wires)
    with ExitStack() as stack:
        components = load_components(graph, (0.0, 1.0), stack)
        with Iterative(connect(graph, components), tolerance=1e-9) as scheme:
            for k in range(5):
                scheme.advance(k * H, H)
            assert scheme.sweeps > 5
        assert prepared_run.component_warnings(components) == [
            asdict(ComponentWarning(name, CREAKS, 0.0, 5)) for name in ("one", "two")
        ]


def test_warnings_stand_in_summary_and_log(cotrack, creaking, tmp_path):
    _, out, err = cotrack(*SHORT, "--log", "a.mcap")
    line = f"! warning: chain at 0 s, 20 times: {CREAKS}\n"
    assert line in out
    assert err == [f"chain: {CREAKS}"]
    assert line.replace("!", " ") in cotrack("log", "info", "a.mcap")[1]
    with Log(tmp_path / "a.mcap") as log:
        closing = log.closing
        assert closing["warnings"] == [{"component": "chain", "text": CREAKS, "time": 0.0, "count": 20}]
    (tmp_path / "cut.mcap").write_bytes((tmp_path / "a.mcap").read_bytes()[:-20])
    assert recover(tmp_path / "cut.mcap", tmp_path / "saved.mcap").code == WHOLE
    with Log(tmp_path / "saved.mcap") as log:
        assert (log.closing["warnings"], log.closing["results"]) == (closing["warnings"], closing["results"])


def test_a_run_that_is_quiet_has_none(cotrack):
    status, out, err = cotrack(*SHORT, "--json", "--log", "a.mcap")
    assert (status, entries(out), err) == (0, [], [])


def test_a_failed_run_tells_its_warnings(cotrack, creaking, monkeypatch):
    run = Program.run

    def failing(self, t, h):
        run(self, t, h)
        if t > 0.0105:
            raise ComponentFailed("chain: the spring broke")

    monkeypatch.setattr(Program, "run", failing)
    monkeypatch.setattr(scheme, "LONGEST_BATCH", 0.0)  # one by one
    status, out, _ = cotrack(*SHORT, "--json")
    assert status == 1
    assert entries(out) == [{"component": "chain", "text": CREAKS, "time": 0.0, "count": 12}]


def test_the_implausible_is_said_everywhere(cotrack):
    changes = ("--set", "drive.speed=250", "--set", "drive.ramp_start=5", "--stop", "10 ms", "--log", "a.mcap")
    status, out, err = cotrack("run", "settle", "--track", "rigid", "--no-estimate", "--json", *changes)
    (warning,) = (each for each in entries(out) if each["component"] == "scene")
    assert (status, warning["count"]) == (0, 1)
    text = "settle.toml: drive.speed = 250 rad/s: plausible is -200 to 200 rad/s (a sprocket of 0.25 m"
    assert warning["text"].startswith(text)
    assert any(text in line for line in err)
    with Log("a.mcap") as log:
        assert warning in log.closing["warnings"]


# ------------------------------------------------------------------ tracks

ONE_SIDED = ("run", "settle", "--set", 'tracks=["left"]', "--stop", "0.12", "--log", "a.mcap")


@pytest.mark.long
def test_a_vehicle_that_rolls_takes_its_cables_out_of_their_plane(cotrack):
    """A vehicle that rolls takes its cables out of their plane: a warning at 0.2 degrees."""
    status, out, err = cotrack(*ONE_SIDED, "--set", "track.axes=fixed", "--json")
    assert status == 0, err
    (warning,) = entries(out)
    assert (warning["component"], warning["count"]) == ("left_track", 1)
    assert warning["text"].startswith("a wheel's axis is 0.2")
    assert 0.05 < warning["time"] < 0.12
    assert f"at t = {warning['time']:.4g} s" in warning["text"]
    assert err == [f"left_track: {warning['text']}"]
    assert verify("a.mcap").code == WHOLE
    with Log("a.mcap") as log:
        assert log.closing["warnings"] == [warning]
    with replay_model.open_replay("a.mcap", "left_track", None) as again:
        assert again.verify().difference is None
        assert [asdict(one) for one in again.component.warnings] == [warning]
        again.record(again.log.path.with_name("b.mcap"))
    with Log("b.mcap") as log:
        assert log.closing["warnings"] == [warning]
    for more in ((), ("--track", "rigid")):
        status, out, _ = cotrack(*ONE_SIDED, *more, "--json")
        assert entries(out) == [], "turning cables and rigid links follow the vehicle"


@pytest.mark.long
def test_what_a_track_has_said_is_part_of_its_state():
    """Warnings of a track are part of its state: they repeat after a restored state or a new start only."""
    scene = placed(load("rig", "flexible"))
    part = next(part for part in assemble(scene).parts if part.name == "track")
    (file,) = build_all([(part.kind, part.config, None)])
    with logged() as heard, Component(file, "track") as track:

        def step(t, turn):
            """Step with a drive that is turned about x, rad."""
            track.u[3:5] = np.cos(turn), np.sin(turn)
            track.write()
            track.step(t, H)

        for _ in range(2):
            track.u[1::13] = 0.0
            track.u[4] = 0.0
            track.initialise(part.parameters)
            upright = track.save()
            for turn in (0.0019, 0.0017):  # 0.22 and 0.19 degrees
                for _ in range(2):
                    track.restore(upright)
                    step(0.0, turn)
                    track.step(H, H)
            (entry,) = track.warnings
            assert (entry.time, entry.count) == (0.0, 1)
            assert entry.text.startswith("a wheel's axis is 0.22 degrees off the pin axis at t = 0 s")
            track.restore(upright)
            step(0.0, 0.0)
            step(H, 0.0019)
            track.read_counters()
            assert track.counters[track.integers.index("status")] == 1
            assert [(one.time, one.count) for one in track.warnings] == [(H, 1)]
    assert len(heard) == 2


@pytest.mark.long
def test_a_step_that_fails_tells_what_it_warned_of(toy, caplog):
    caplog.set_level(logging.DEBUG, RUN.name)
    with Component(build_toy(creaks=True), "toy") as component:
        component.initialise({"trouble": "raise"}, start=0.01)
        with pytest.raises(ComponentFailed, match="the spring broke"):
            component.step(0.0, H)
        assert [one.text for one in component.warnings] == [CREAKS]
    assert [record.levelname for record in caplog.records] == ["WARNING", "DEBUG", "DEBUG"]
