"""A command that works says so: at once, and again before five seconds are over."""

import io
import logging
import subprocess
import sys
import time

from orchestrator.cosim import observers
from orchestrator.cosim.narration import FIRST, KERNELS, PATIENCE, Narration
from orchestrator.cosim.observers import ProgressBar


def told(work, patience=0.05):
    """Lines that were written while ``work(narration)`` was done, with their times."""
    lines = []
    began = time.monotonic()
    with Narration(lambda line: lines.append((time.monotonic() - began, line)), patience) as narration:
        work(narration)
    return lines


def test_it_speaks_at_once_and_again():
    def work(narration):
        narration("chains are laid out")
        narration.note("3 of 4")
        time.sleep(0.3)
        narration("done")

    lines = [line for _, line in told(work)]
    assert (lines[0], lines[-1]) == ("chains are laid out", "done")
    assert len(lines) > 3
    assert all(line == "chains are laid out: 0 s so far, 3 of 4" for line in lines[1:-1])
    assert PATIENCE + 0.25 < 5.0  # how often it looks is a quarter of a second


def test_what_is_quick_or_seen_elsewhere_needs_no_word():
    def work(narration):
        narration.begin("scenes")
        with narration.elsewhere():
            time.sleep(0.2)
            logging.getLogger(KERNELS).info("seen in the bar")

    assert told(work) == []
    assert [line for _, line in told(lambda n: (n.begin("scenes"), time.sleep(0.2)))] != []


def test_patience_begins_with_the_work():
    """Not when the module was loaded."""
    lines = []
    narration = Narration(lines.append, 0.3)
    time.sleep(0.4)
    with narration:
        narration.begin("scenes")
        time.sleep(0.15)
    assert lines == []


def test_kernels_that_are_compiled_are_announced_and_counted():
    def work(narration):
        narration("components start")
        for k in range(3):
            logging.getLogger(KERNELS).info("kernel %d", k)
        time.sleep(0.2)

    lines = [line for _, line in told(work)]
    assert lines[:2] == ["components start", FIRST]
    assert lines[2] == "components start: 0 s so far, 3 kernels compiled"
    assert "kernels" not in lines[3]
    logging.getLogger(KERNELS).info("nobody listens any more")


def test_a_run_that_nobody_watches_says_how_far_it_is(monkeypatch):
    """A bar on a terminal, else a note for the next reminder."""
    monkeypatch.setattr(observers, "REFRESH", 0.0)
    monkeypatch.setattr(sys, "stderr", io.StringIO())

    def work(narration):
        with ProgressBar("rig", 2.0, narration) as bar:
            narration("2 s are simulated")
            bar(0, 0.0, 1e-3)
            time.sleep(0.05)
            bar(1, 0.5, 1e-3)
            time.sleep(0.2)

    assert any("0.5 of 2 s simulated" in line for _, line in told(work))


def test_a_run_speaks_within_the_first_second(environment, tmp_path):
    """The command as a process: lines on stderr, one object on stdout."""
    command = [sys.executable, "-m", "orchestrator", "run", "hanging_chain", "--stop", "0.1", "--json"]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
    assert done.stdout.count("\n") == 1
    first, *rest = done.stderr.splitlines()
    assert first == "... hanging_chain: the scene is read"
    assert any("simulated" in line for line in rest)
