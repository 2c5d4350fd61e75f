"""The memory of a run does not grow with its duration."""

import pytest

from orchestrator.execution.simulate import simulate
from orchestrator.log import container
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.results.difference import differences
from orchestrator.results.run_data import RunData
from orchestrator.scene.scene import load
from tests.benchmarks.process import isolated

HALF = ["symmetric=true", "planar=true", "run.step=2 ms"]  # the fast form of a vehicle


@pytest.mark.long
def test_a_long_run_needs_no_more_memory_than_a_short_one():
    """A run of 24 s needs no more memory than one of 3 s; its whole log would take 100 MB more."""
    options = {"scene": "straight", "track": "flexible", "settings": HALF}
    short, long = (isolated("memory_run", stop=stop, **options) for stop in (3.0, 24.0))
    assert long < short + 30.0


@pytest.mark.long
def test_what_is_read_for_a_summary_or_a_difference_is_not_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(container, "SMALL", 0)  # the log is none of those that are kept whole
    path = tmp_path / "log.mcap"
    assert simulate(load("straight", "rigid", ["run.stop=0.1 s", "run.links=1", "expect={}"]), path)["status"] == "ok"
    with Log(path) as log, Log(path) as other:
        errors = differences(RunData(log), RunData(other))
        assert max(one.relative for one in errors.values()) == pytest.approx(0.0, abs=1e-12)
        with path.open("r+b") as stream:
            stream.write(bytes(path.stat().st_size))  # what is read again is not there
        with pytest.raises(LogUnreadable):
            log.read("/chassis/out")
