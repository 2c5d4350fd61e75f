"""Every command answers logs with any damage by messages and exit codes only."""

import io
import random
import signal
import sys
from contextlib import contextmanager, redirect_stderr, redirect_stdout

import pytest
from mutated import Content, change_bytes, change_content

from fmus.fmi.build import BuildFailed
from orchestrator.cli import main
from orchestrator.execution import replay_model
from orchestrator.execution.simulate import simulate
from orchestrator.scene.scene import load

LONG = 1500  # characters; a longer text is not a message
HANG = 20  # s of CPU time
WRITTEN = {
    "mutant.mcap", "saved.mcap", "csv", "view.png", "view.rrd", "scene.mcap", "scene.layout.json", "plot.png",
    "page.html",
}  # fmt: skip


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A small log with links; its component has a description of one line."""
    folder = tmp_path_factory.mktemp("mutated")
    settings = ("run.stop=0.02", "chain.links=8", "run.links=7", "expect={}")
    simulate(load("hanging_chain", "flexible", settings), folder / "run.mcap")
    content = Content(folder / "run.mcap")
    content.attachments["chain.modelDescription.xml"] = b"<fmiModelDescription/>"
    return content.write(folder / "whole.mcap")


def commands(path, whole, drawn):
    yield "log", "info", path
    yield "log", "verify", path
    yield "log", "recover", path, "-o", "saved.mcap"
    yield "log", "export", path, "-o", "csv"
    yield "compare", path, whole
    yield "compare", whole, path, "--different"
    yield "replay", path, "--component", "chain"
    yield "replay", path, "--component", "chain", "--with", "rigid", "-o", "answer.mcap"
    yield "analyse", path, "joints"
    if drawn:
        yield "analyse", path, "events"
        yield "analyse", path, "spectrum", "--signal", "chain.tension.*"
        yield "view", path, "-o", "view.png"
        yield "view", path, "--rerun", "-o", "view.rrd"
        yield "view", path, "--foxglove", "-o", "scene.mcap"
        yield "plot", path, "chain.link[*].tension", "--waterfall", "-o", "plot.png"
        yield "report", path, "-o", "page.html"


def called(arguments, monkeypatch):
    """Exit code, stdout and stderr of a command; raises any exception that the command does not catch."""
    out, err = io.StringIO(), io.StringIO()
    monkeypatch.setattr(sys, "argv", ["cotrack", *map(str, arguments)])
    with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code or 0, out.getvalue(), err.getvalue()


@contextmanager
def ended_at(limit):
    """Raise RuntimeError after ``limit`` s of computing, where the system has such a timer."""
    if not hasattr(signal, "setitimer"):
        yield
        return

    def late(*_):
        raise RuntimeError(f"not done after {limit} s")

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, limit)  # CPU time of this process: the machine may be busy
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def survey(whole, seeds, drawn, monkeypatch, folder):
    """Call every command on every mutant; return the exit codes by command."""

    def not_built(*_):
        raise BuildFailed("not built here")  # the FMU does not matter here

    monkeypatch.setattr(replay_model, "build_parts", not_built)
    monkeypatch.chdir(folder)
    data, content = whole.read_bytes(), Content(whole)
    seen = {}
    for seed in seeds:
        chance, path = random.Random(seed), folder / "mutant.mcap"
        path.unlink(missing_ok=True)
        if seed % 2:
            path.write_bytes(change_bytes(data, chance))
        else:
            change_content(content, chance).write(path)
        for arguments in commands(path, whole, seed % drawn < 2):
            with ended_at(HANG):
                status, out, err = called(arguments, monkeypatch)
            where = f"seed {seed}: {' '.join(map(str, arguments))}: {status}\n{out[-500:]}\n{err[-500:]}"
            assert status in (0, 1, 2, 3), where
            assert out or err, where
            assert "internal error" not in err, where
            assert "Traceback" not in err, where
            assert "Warning" not in err, where
            assert all(line.startswith(("cotrack: ", "... ")) for line in err.splitlines()), where
            assert len(err) < LONG, where
            seen.setdefault(arguments[0] if arguments[0] != "log" else arguments[1], set()).add(status)
    assert not {file.name for file in folder.iterdir()} - WRITTEN
    return seen


@pytest.mark.long
def test_a_mutated_log_ends_in_a_sentence(whole, monkeypatch, tmp_path):
    seen = survey(whole, range(28), 14, monkeypatch, tmp_path)
    assert seen["verify"] == {0, 1}, "there are no mutants of both kinds"
    assert seen["recover"] >= {0, 3}
    assert seen["compare"] == seen["view"] == {0, 2}
    assert seen["replay"] == {2}


@pytest.mark.study
def test_many_mutated_logs_end_in_sentences(whole, monkeypatch, tmp_path):
    seen = survey(whole, range(1000, 3000), 4, monkeypatch, tmp_path)
    assert seen["verify"] == {0, 1}
    assert seen["recover"] >= {0, 3}


def test_the_survey_sees_a_traceback(whole, monkeypatch, tmp_path):
    """The survey fails on an exception behind the command line."""
    from orchestrator.log import tools

    def broken(path):
        raise AttributeError("no such thing")

    monkeypatch.setattr(tools, "verify", broken)
    with pytest.raises(AssertionError, match="internal error: AttributeError: no such thing; run 'cotrack --debug"):
        survey(whole, range(1), 1, monkeypatch, tmp_path)
