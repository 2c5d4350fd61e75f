"""A command that works says so: at once, and again before five seconds are over."""

import io
import logging
import subprocess
import sys
import threading
from contextlib import nullcontext

import pytest

from orchestrator.cosim import observers
from orchestrator.cosim.narration import FIRST, KERNELS, PATIENCE, PERIOD, Narration
from orchestrator.cosim.observers import ProgressBar
from orchestrator.execution.loading import OTHER_KERNELS
from orchestrator.execution.simulate import simulate
from orchestrator.files.command import command_scope
from orchestrator.scene.scene import load


class Watched:
    """A narration with a clock that the test moves, and the lines that it wrote."""

    def __init__(self):
        self.lines, self.time = [], 0.0
        self.narration = Narration(self.lines.append, lambda: self.time)

    def after(self, seconds):
        """Lines that a reminder adds so many seconds later."""
        self.time += seconds
        before = len(self.lines)
        self.narration.remind()
        return self.lines[before:]


@pytest.fixture
def watched():
    return Watched()


def test_a_task_is_announced_at_once_and_again_before_five_seconds(watched):
    watched.narration("chains are laid out")
    watched.narration.set_detail("3 of 4")
    assert watched.lines == ["chains are laid out"]
    assert watched.after(0.9 * PATIENCE) == []
    assert watched.after(0.2 * PATIENCE) == ["chains are laid out: 4 s so far, 3 of 4"]
    assert watched.after(0.9 * PATIENCE) == []
    assert watched.after(0.2 * PATIENCE) == ["chains are laid out: 9 s so far, 3 of 4"]
    assert PATIENCE + PERIOD < 5.0


@pytest.mark.parametrize(("settings", "reason"), [
    ({"drive.left.speed": 10}, "the sides are driven differently"), ({}, ""),
    ({"tracks": ["left"]}, "one side alone has a track"), ({"drive.left.speed": 10, "track.model": "rigid"}, ""),
])  # fmt: skip
def test_the_start_says_why_other_kernels_are_needed(tmp_path, settings, reason):
    """Cables of a vehicle that may leave its plane have turning axes."""
    lines = []

    def narrate(line):
        lines.append(line)
        if line.endswith("components are built and initialised"):
            raise InterruptedError

    with pytest.raises(InterruptedError):
        simulate(load("straight", None, settings | {"expect": {}}), tmp_path / "a.mcap", narration=narrate)
    assert lines[:-1] == ([f"straight: {reason}: {OTHER_KERNELS}"] if reason else [])


def test_a_long_start_says_what_it_does(tmp_path, watched, monkeypatch):
    """In its reminders: the part of the start that lasts, here each one."""
    set_detail, reminders = watched.narration.set_detail, []

    def lasts(detail):
        set_detail(detail)
        reminders.extend(watched.after(PATIENCE))

    monkeypatch.setattr(watched.narration, "set_detail", lasts)
    scene = load("hanging_chain", "rigid", {"run.stop": "5 ms", "expect": {}})
    simulate(scene, tmp_path / "a.mcap", narration=watched.narration)
    told = [line.partition(" so far, ")[2].partition(",")[0] for line in reminders]
    assert told[:4] == [
        "the places of idlers and hull are solved from static equilibrium", "FMUs are built or found: 1",
        "kernels are compiled in processes of their own", "components are initialised",
    ]  # fmt: skip


def test_what_is_quick_or_seen_elsewhere_needs_no_word(watched):
    """Patience begins with the work, not when the module was loaded."""
    watched.time = 10.0 * PATIENCE
    with watched.narration:
        watched.narration.set_task("scenes")
        assert watched.after(0.9 * PATIENCE) == []
        with watched.narration.suppressed():
            assert watched.after(2.0 * PATIENCE) == []
            logging.getLogger(KERNELS).info("seen in the bar")
        assert watched.after(0.9 * PATIENCE) == []
    assert watched.after(0.2 * PATIENCE) != []


def test_kernels_that_are_compiled_are_announced_and_counted(watched):
    with watched.narration:
        watched.narration("components start")
        for k in range(3):
            logging.getLogger(KERNELS).info("kernel %d", k)
        assert watched.lines == ["components start", FIRST]
        assert watched.after(PATIENCE) == ["components start: 4 s so far, 3 kernels compiled"]
        assert watched.after(PATIENCE) == ["components start: 8 s so far"]
    logging.getLogger(KERNELS).info("nobody listens any more")
    assert len(watched.lines) == 4


def test_a_run_that_nobody_watches_says_how_far_it_is(watched, monkeypatch):
    """A bar on a terminal, else a note for the next reminder."""
    monkeypatch.setattr(observers, "REFRESH", 0.0)
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with ProgressBar("rig", 2.0, watched.narration) as bar:
        watched.narration("2 s are simulated")
        bar(0, 0.0, 1e-3)
        bar(1, 0.5, 1e-3)
        assert "0.5 of 2 s simulated" in watched.after(PATIENCE)[0]


@pytest.mark.long
def test_a_run_speaks_before_it_works(environment, tmp_path):
    """The command as a process: lines on stderr, one object on stdout."""
    command = [sys.executable, "-m", "orchestrator", "run", "hanging_chain", "--stop", "0.1", "--json"]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
    assert done.stdout.count("\n") == 1
    assert done.stderr.startswith("... hanging_chain: the scene is read\n")
    assert "simulated" in done.stderr


@pytest.mark.parametrize("error", [None, KeyError("a fault of ours")])
def test_the_thread_of_a_narration_reminds_and_ends_the_command_if_it_dies(error):
    lines, told, times = [], threading.Event(), iter([0.0, 0.0])

    def write(line):
        lines.append(line)
        told.set()
        if error:
            raise error

    narration = Narration(write, lambda: next(times, 2.0 * PATIENCE))
    with pytest.raises(KeyError) if error else nullcontext(), command_scope(), narration:
        narration.set_task("scenes")
        assert told.wait(60.0)
    assert lines == ["scenes: 8 s so far"]
