"""A command that works says so: at once, and again before five seconds are over."""

import io
import logging
import subprocess
import sys
import threading
from contextlib import nullcontext

import pytest

from orchestrator.cosim import observers
from orchestrator.cosim.observers import TimeReached
from orchestrator.execution.loading import OTHER_KERNELS
from orchestrator.execution.simulate import simulate
from orchestrator.files.command import command_scope
from orchestrator.files.messages import PROGRESS, silent
from orchestrator.files.progress import FIRST, KERNELS, PATIENCE, PERIOD, Progress
from orchestrator.scene.scene import load


class Watched:
    """Progress with a clock that the test moves, and the lines that it wrote."""

    def __init__(self):
        self.lines, self.time = [], 10.0 * PATIENCE
        self.progress = Progress("scenes", self.lines.append, lambda: self.time)

    def after(self, seconds):
        """Lines that a reminder adds so many seconds later."""
        self.time += seconds
        before = len(self.lines)
        self.progress.remind()
        return self.lines[before:]


@pytest.fixture
def watched():
    watched = Watched()
    with watched.progress:
        yield watched


def test_a_task_is_announced_at_once_and_again_before_five_seconds(watched):
    PROGRESS.info("chains are laid out")
    PROGRESS.debug("%d of 4", 3)
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

    def write(line):
        lines.append(line)
        if line.endswith("components are built and initialised"):
            raise InterruptedError

    with pytest.raises(InterruptedError), Progress("run", write):
        simulate(load("straight", None, settings | {"expect": {}}), tmp_path / "a.mcap")
    assert lines[:-1] == ([f"straight: {reason}: {OTHER_KERNELS}"] if reason else [])


def test_a_long_start_says_what_it_does(tmp_path, watched, monkeypatch):
    """In its reminders: the part of the start that lasts, here each one."""
    emit, reminders = watched.progress.emit, []

    def lasts(record):
        emit(record)
        reminders.extend(watched.after(PATIENCE) if record.levelno == logging.DEBUG else [])

    monkeypatch.setattr(watched.progress, "emit", lasts)
    scene = load("hanging_chain", "rigid", {"run.stop": "5 ms", "expect": {}})
    simulate(scene, tmp_path / "a.mcap")
    told = [line.partition(" so far, ")[2].partition(",")[0] for line in reminders]
    assert told[:4] == [
        "the places of idlers and hull are solved from static equilibrium", "FMUs are built or found: 1",
        "kernels are compiled in processes of their own", "components are initialised",
    ]  # fmt: skip


def test_what_is_quick_needs_no_word(watched):
    """Patience begins with the work, not when the module was loaded."""
    assert watched.after(0.9 * PATIENCE) == []
    assert watched.after(0.2 * PATIENCE) == ["scenes: 4 s so far"]


def test_runs_of_a_study_say_nothing(watched):
    with silent():
        PROGRESS.info("components start")
        PROGRESS.debug("3 of 4")
    assert watched.lines == []
    assert watched.after(PATIENCE) == ["scenes: 4 s so far"]


def test_kernels_that_are_compiled_are_announced_and_counted(watched):
    PROGRESS.info("components start")
    for k in range(3):
        KERNELS.info("kernel %d", k)
    assert watched.lines == ["components start", FIRST]
    assert watched.after(PATIENCE) == ["components start: 4 s so far, 3 kernels compiled"]
    assert watched.after(PATIENCE) == ["components start: 8 s so far"]
    watched.progress.__exit__()
    KERNELS.info("nobody listens any more")
    assert len(watched.lines) == 4


def test_a_run_says_how_far_it_is(watched, monkeypatch):
    monkeypatch.setattr(observers, "REFRESH", 0.0)
    PROGRESS.info("2 s are simulated")
    reached = TimeReached(2.0)
    reached(0, 0.0, 1e-3)
    reached(1, 0.5, 1e-3)
    assert watched.after(PATIENCE)[0].startswith("2 s are simulated: 4 s so far, 0.5 of 2 s simulated, ")


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize("level", [logging.DEBUG, logging.INFO])
def test_on_a_terminal_a_bar_shows_what_is_counted(watched, monkeypatch, level):
    """Nothing is repeated meanwhile; at the end of the count, or of the task, it goes."""
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setenv("TERM", "xterm")
    PROGRESS.info("2 s are simulated")
    PROGRESS.log(level, "0.5 of 2 s", extra={"done": 0.5, "of": 2.0})
    assert watched.lines == ["2 s are simulated", "0.5 of 2 s"][: 1 + (level == logging.INFO)]
    assert all(
        words in sys.stderr.getvalue()
        for words in ("2 s are simulated", "\N{BOX DRAWINGS HEAVY HORIZONTAL}", "0.5 of 2 s")
    )
    assert watched.after(2.0 * PATIENCE) == []
    PROGRESS.debug("all", extra={"done": 2.0, "of": 2.0})
    assert watched.after(2.0 * PATIENCE) == ["2 s are simulated: 16 s so far, all"]


@pytest.mark.long
def test_a_run_speaks_before_it_works(environment, tmp_path):
    """The command as a process: lines on stderr, one object on stdout."""
    command = [sys.executable, "-m", "orchestrator", "run", "hanging_chain", "--stop", "0.1", "--json"]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
    assert done.stdout.count("\n") == 1
    assert done.stderr.startswith("... hanging_chain: the scene is read\n")
    assert "simulated" in done.stderr


@pytest.mark.parametrize("error", [None, KeyError("a fault of ours")])
def test_the_thread_of_progress_reminds_and_ends_the_command_if_it_dies(error):
    lines, told, times = [], threading.Event(), iter([0.0, 0.0])

    def write(line):
        lines.append(line)
        told.set()
        if error:
            raise error

    progress = Progress("scenes", write, lambda: next(times, 2.0 * PATIENCE))
    with pytest.raises(KeyError) if error else nullcontext(), command_scope(), progress:
        assert told.wait(60.0)
    assert lines == ["scenes: 8 s so far"]
