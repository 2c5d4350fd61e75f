"""Fixtures of all tests.

Built FMUs and compiled kernels go into the ordinary cache, which is addressed by content: workers share it,
and a kernel is compiled once, not once a run. Two workers that need a new kernel at the same time both compile it:
hence the order of the modules.
"""

import os
import sys
from collections import Counter
from functools import partial
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from fmus.build import build_shell
from orchestrator.cli import app, main
from orchestrator.log.stream import Stream

# how long an example takes says something of the machine, not of the code
settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")

HERE = Path(__file__).resolve().parent
TOY = HERE / "toy"
ROOT = HERE.parent


@pytest.hookimpl(trylast=True)  # of those that are run
def pytest_collection_modifyitems(items):
    """With an empty cache one worker compiles the vehicles' kernels while the other is at the pieces of physics.

    What needs whole vehicles comes after them and finds its kernels. Large modules are first, for an even end.
    """
    sizes = Counter(item.path for item in items)

    def place(item):
        family = 0 if item.path.stem == "test_sensitivity" else 1 if item.path.parent.name == "physics" else 2
        return family, -sizes[item.path], str(item.path)

    items.sort(key=place)


def build_toy(folder=None, name=None, **config):
    """The FMU of a mass on a spring, with so many spare inputs and outputs."""
    return build_shell(TOY / "toy_fmu.py", {"spare": 3, "start": 0.1, **config}, folder, name, packages=[TOY])


def messages(err):
    """What a command wrote to stderr, without the lines in which it says what it is at."""
    return "".join(line for line in err.splitlines(True) if not line.startswith("... "))


@pytest.fixture(scope="session")
def toy():
    return build_toy()


@pytest.fixture(scope="session")
def environment():
    """Environment of a child process that sees the packages under test and the toy."""
    path = os.pathsep.join([str(ROOT), str(HERE), *filter(None, [os.environ.get("PYTHONPATH")])])
    return {**os.environ, "PYTHONPATH": path, "NUMBA_DISABLE_JIT": "0"}


@pytest.fixture
def fresh_cache(tmp_path, monkeypatch):
    """An empty cache folder for this test alone."""
    monkeypatch.setenv("COTRACK_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def clean_imports():
    """The interpreter's search path and modules are afterwards as they were."""
    path, modules = list(sys.path), set(sys.modules)
    yield
    sys.path[:] = path
    for name in set(sys.modules) - modules:
        del sys.modules[name]


@pytest.fixture
def scaled(monkeypatch):
    """``scaled(log, topic, name, factor)``: logs are read as if a variable were so many times as large."""

    def change(log, topic, name, factor):
        assert name in log.topics[topic].names
        add = Stream.add

        def changed(stream, piece):
            whole = add(stream, piece)
            if topic in whole and name in whole[topic].names:
                whole[topic].values[:, whole[topic].names.index(name)] *= factor
            return whole

        monkeypatch.setattr(Stream, "add", changed)

    return change


@pytest.fixture
def cotrack(call):
    """``call`` of the command ``cotrack``."""
    return partial(call, app)


@pytest.fixture
def call(capsys, monkeypatch, tmp_path):
    """Call a command line in an empty folder; exit status, stdout, stderr without the lines of its narration."""
    monkeypatch.chdir(tmp_path)

    def call(command, *arguments):
        monkeypatch.setattr(sys, "argv", ["cotrack", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main(command)
        said = capsys.readouterr()
        return ended.value.code or 0, said.out, messages(said.err)

    return call
