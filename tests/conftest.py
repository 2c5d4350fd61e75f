"""Fixtures for all tests.

Built FMUs and compiled kernels go into the ordinary content-addressed cache: workers share it, and a kernel is compiled
once, not in every run. Two workers that need a new kernel at the same time both compile it; the order of the modules
avoids that.
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

# the duration of an example depends on the machine, not on the code
settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")

HERE = Path(__file__).resolve().parent
TOY = HERE / "toy"
ROOT = HERE.parent


@pytest.hookimpl(trylast=True)  # after deselection
def pytest_collection_modifyitems(items):
    """Order the modules so that, with an empty cache, two workers compile different kernels.

    One compiles the kernels of vehicles while the other runs tests of physics. Tests of whole vehicles come later and
    find their kernels. Large modules come first, so that both workers end at the same time.
    """
    sizes = Counter(item.path for item in items)

    def place(item):
        family = 0 if item.path.stem == "test_sensitivity" else 1 if item.path.parent.name == "physics" else 2
        return family, -sizes[item.path], str(item.path)

    items.sort(key=place)


def build_toy(folder=None, name=None, **config):
    """FMU of a mass on a spring, with spare inputs and outputs as configured."""
    return build_shell(TOY / "toy_fmu.py", {"spare": 3, "start": 0.1, **config}, folder, name, packages=[TOY])


def messages(err):
    """Messages of a command on stderr, without its narration."""
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
    """Restore the interpreter's search path and modules after the test."""
    path, modules = list(sys.path), set(sys.modules)
    yield
    sys.path[:] = path
    for name in set(sys.modules) - modules:
        del sys.modules[name]


@pytest.fixture
def scaled(monkeypatch):
    """Function ``scaled(log, topic, name, factor)``: scales a variable when logs are read."""

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
    """Function ``call`` for the command ``cotrack``."""
    return partial(call, app)


@pytest.fixture
def call(capsys, monkeypatch, tmp_path):
    """Call a command line in an empty folder; return exit status, stdout, stderr without narration."""
    monkeypatch.chdir(tmp_path)

    def call(command, *arguments):
        monkeypatch.setattr(sys, "argv", ["cotrack", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main(command)
        said = capsys.readouterr()
        return ended.value.code or 0, said.out, messages(said.err)

    return call
