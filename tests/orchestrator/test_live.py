"""A live view of a running log shows what a view of the whole log shows."""

import threading
import time

import numpy as np
import pytest

from fmus.vehicles.tables import BadInput
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.results.views import rerun_scene
from orchestrator.scene.scene import load

SETTINGS = ("run.stop=0.3", "run.step=1 ms", "run.links=5", "expect={}", "drive.ramp_start=0", "run.checkpoints=false")


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    path = tmp_path_factory.mktemp("live") / "rig.mcap"
    simulate(load("rig", "rigid", SETTINGS), path)
    return path


def again(source, path, pause, end=None):
    """Write the log of a run again up to ``end``, with a pause after every 100 rows."""
    with Log(source) as log:
        topics = {topic: list(zip(about.names, about.units, strict=True)) for topic, about in log.topics.items()}
        every = {topic: about.every for topic, about in log.topics.items()}
        attachments = {name: log.attachment(name) for name in log.attachments}
        rows = []
        for topic in topics:
            series = log.read(topic)
            numbers = (int(k) for k in log.sequence(topic))
            rows += zip(series.t, [topic] * len(series.t), numbers, series.h, series.values.tolist(), strict=True)
        rows.sort()
    with Recorder(path, topics, attachments, {}, every=every, flush=0.02) as recorder:
        for number, (t, topic, k, h, values) in enumerate(rows):
            if end is not None and t > end:
                raise RuntimeError("the run is killed")
            recorder.write(topic, k, t, h, np.array(values))
            if number % 100 == 99:
                time.sleep(pause)
        recorder.close("ok", "", len(rows))


def held(file):
    """Times and centres of links, and all values of the chain's speed, in a Rerun file."""
    chunk = pytest.importorskip("rerun.chunk")
    links, curve = [], []
    for piece in chunk.RrdReader(file).stream():
        batch = piece.to_record_batch()
        if piece.entity_path == "/world/links/track" and not piece.is_static:
            times = batch["time"].cast("int64").to_pylist()
            links += zip(times, batch["Boxes3D:centers"].to_pylist(), strict=True)
        if "tension.mean" in piece.entity_path and not piece.is_static:
            curve += zip(batch["time"].cast("int64").to_pylist(), batch["Scalars:scalars"].to_pylist(), strict=True)
    return sorted(links), sorted(curve)


@pytest.mark.long
def test_a_run_that_will_replace_an_older_log_is_shown_as_far_as_it_came(rig, tmp_path, monkeypatch):
    monkeypatch.setattr(rerun_scene, "PERIOD", 0.05)
    monkeypatch.setattr(rerun_scene, "RATE", 1e4)
    path, reads, grown = tmp_path / "run.mcap", [], rerun_scene.reopened
    path.write_bytes(rig.read_bytes())
    rerun_scene.show(rig, tmp_path / "first.rrd")  # imports take longer than this run

    def noted(path):
        for log, end in grown(path):
            reads.append((log.path.name, end))
            yield log, end

    monkeypatch.setattr(rerun_scene, "reopened", noted)
    writer = threading.Thread(target=again, args=(rig, path, 0.1))
    writer.start()
    while rerun_scene.growing_log(path) == path:
        time.sleep(0.001)
    rerun_scene.follow(path, tmp_path / "live.rrd")
    writer.join()
    rerun_scene.show(path, tmp_path / "whole.rrd")
    assert len({end for name, end in reads if name == "run.running.mcap" and end > 0.0}) > 2, "it did not grow"
    assert reads[-1][1] == np.inf
    links, curve = held(tmp_path / "live.rrd")
    assert (links, curve) == held(tmp_path / "whole.rrd")
    assert len(curve) == 301
    assert not list(tmp_path.glob("*.running.mcap"))


def test_steps_between_two_records_of_links_wait(rig, tmp_path, monkeypatch):
    """With short windows nothing is lost or repeated."""
    monkeypatch.setattr(rerun_scene, "RATE", 1e4)
    rerun_scene.show(rig, tmp_path / "whole.rrd")

    def grown(path):
        for end in (0.0, 0.011, 0.013, 0.0141, 0.2, 0.203, np.inf):
            with Log(path) as log:
                log.being_written = end < np.inf
                yield log, end

    monkeypatch.setattr(rerun_scene, "reopened", grown)
    rerun_scene.follow(rig, tmp_path / "live.rrd")
    assert held(tmp_path / "live.rrd") == held(tmp_path / "whole.rrd")


def test_a_killed_run_ends_the_view(rig, tmp_path, monkeypatch):
    monkeypatch.setattr(rerun_scene, "PERIOD", 0.05)
    with pytest.raises(RuntimeError):
        again(rig, tmp_path / "run.mcap", 0.0, end=0.2)
    rerun_scene.follow(tmp_path / "run.mcap", tmp_path / "live.rrd")
    links, _ = held(tmp_path / "live.rrd")
    assert links[-1][0] == pytest.approx(0.2e9, abs=6e6)


def test_where_nothing_comes_it_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(rerun_scene, "PERIOD", 0.01)
    monkeypatch.setattr(rerun_scene, "PATIENCE", 0.05)
    with pytest.raises(BadInput, match="no run has written a record there"):
        rerun_scene.follow(tmp_path / "none.mcap", tmp_path / "live.rrd")
    assert not list(tmp_path.iterdir()), "a half-written file is left"
