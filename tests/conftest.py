"""Fixtures shared by all tests.

Built FMUs and compiled kernels go into the ordinary cache, which is addressed by content. Workers share it, so a kernel
is compiled once and not once per run. Two workers that need a new kernel at the same time both compile it; the order of
the modules makes this rare.
"""

import os
import signal
import sys
import zipfile
from collections import Counter
from contextlib import suppress
from functools import cache, partial
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # two workers fill two cores: threads would wait for each other

import foreign_fmus
import psutil
import pytest
import typer
from built_toy import build_toy
from hypothesis import HealthCheck, settings

from orchestrator.cli import app, main
from orchestrator.log.stream import Stream

# the run time of an example depends on the machine, not on the code
settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent


def pytest_configure(config):
    """At SIGTERM, end with all workers and what they have started: pytest leaves them to end by themselves."""

    def end(number, _):
        for one in psutil.Process().children(recursive=True):
            with suppress(psutil.NoSuchProcess):
                one.kill()
        os._exit(128 + number)

    if not hasattr(config, "workerinput"):
        signal.signal(signal.SIGTERM, end)


@pytest.hookimpl(trylast=True)  # after the deselection of tests, so that only selected tests are counted
def pytest_collection_modifyitems(items):
    """Sort the tests so that two workers with an empty cache seldom compile the same kernels.

    One worker compiles the kernels of cables for `test_analyses.py` while the other runs the tests of physics; then one
    compiles those of rigid chains, the other those of rigid links on wheels. Among the long tests one worker compiles
    those of all kinds of links on vehicles for `test_sensitivity.py` while the other runs the tests of physics; few but
    slow ones follow. Of the later modules, the large ones come first, so that both workers end at about the same time.
    """
    sizes = Counter(item.path for item in items)
    first = ["test_analyses", "physics", "test_notices", "test_validity_of_chains", "test_validity"]
    if not any(path.stem == "test_house" for path in sizes):  # long tests alone
        first = ["test_sensitivity", *first, "test_pages", "fuzz"]

    def place(item):
        name = item.path.parent.name if item.path.parent.name in first else item.path.stem
        return first.index(name) if name in first else len(first), -sizes[item.path], str(item.path)

    items.sort(key=place)


@cache
def click_command(app):
    """Return the command of click that typer makes of an application at each call, made once."""
    return typer.main.get_command(app)


def messages(err):
    """Return the error text of a command without its progress lines."""
    return "".join(line for line in err.splitlines(True) if not line.startswith("... "))


@pytest.fixture(scope="session")
def toy():
    return build_toy()


@pytest.fixture(scope="session")
def xml(toy):
    with zipfile.ZipFile(toy) as archive:
        return archive.read("modelDescription.xml").decode()


@pytest.fixture(scope="session")
def drive(tmp_path_factory):
    """FMU of a drive that is not ours."""
    return foreign_fmus.build(tmp_path_factory.mktemp("foreign") / "MyDrive.fmu", "drive", foreign_fmus.DRIVE)


@pytest.fixture(scope="session")
def environment():
    """Environment of a child process in which the packages under test and the toy can be imported."""
    path = os.pathsep.join([str(ROOT), str(HERE), str(HERE / "support"), *filter(None, [os.environ.get("PYTHONPATH")])])
    return {**os.environ, "PYTHONPATH": path, "NUMBA_DISABLE_JIT": "0"}


@pytest.fixture
def fresh_cache(tmp_path, monkeypatch):
    """An empty cache folder for this test alone."""
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def clean_imports():
    """Restore the interpreter's search path and modules after the test."""
    path, modules = list(sys.path), set(sys.modules)
    yield
    sys.path[:] = path
    for name in set(sys.modules) - modules:
        del sys.modules[name]


@pytest.fixture
def scaled(monkeypatch):
    """Return ``scaled(log, topic, name, factor)``, which multiplies a variable when a log is read."""

    def change(log, topic, name, factor):
        assert name in log.topics[topic].names
        add = Stream.add

        def add_scaled(stream, piece):
            pieces = add(stream, piece)
            if topic in pieces and name in pieces[topic].names:
                pieces[topic].values[:, pieces[topic].names.index(name)] *= factor
            return pieces

        monkeypatch.setattr(Stream, "add", add_scaled)

    return change


class Command:
    """A command line in an empty folder: called, it returns its exit status, stdout, and stderr without progress."""

    def __init__(self, call):
        self._call = partial(call, app)

    def __call__(self, *arguments):
        return self._call(*arguments)

    def done(self, *arguments):
        """Return stdout of a call that succeeds."""
        status, out, err = self(*arguments)
        assert status == 0, err
        return out

    def refused(self, *arguments):
        """Return stderr of a call that is bad input."""
        status, _, err = self(*arguments)
        assert status == 2, err
        return err


@pytest.fixture
def cotrack(call):
    """The command ``cotrack``, a ``Command``."""
    return Command(call)


@pytest.fixture
def call(capsys, monkeypatch, tmp_path):
    """Return a function that calls a command line in an empty folder.

    It returns the exit status, stdout, and stderr without progress lines, which are in its ``progress``.
    """
    monkeypatch.chdir(tmp_path)

    def call(command, *arguments):
        monkeypatch.setattr(sys, "argv", ["cotrack", *map(str, arguments)])
        with pytest.raises(SystemExit) as exit_info:
            main(click_command(command))
        output = capsys.readouterr()
        call.progress = [line[4:] for line in output.err.splitlines() if line.startswith("... ")]
        return exit_info.value.code or 0, output.out, messages(output.err)

    return call
