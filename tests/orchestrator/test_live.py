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
        rows = sorted(
            (t, topic, int(k), h, values)
            for topic in topics
            for k, (t, h, values) in zip(
                log.sequence(topic),
                zip(*log.read(topic)[:2], log.read(topic).values.tolist(), strict=True),
                strict=True,
            )
        )
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
def test_a_run_that_goes_on_is_shown_as_far_as_it_came(rig, tmp_path, monkeypatch):
    monkeypatch.setattr(rerun_scene, "PERIOD", 0.05)
    monkeypatch.setattr(rerun_scene, "RATE", 1e4)
    rerun_scene.show(rig, tmp_path / "first.rrd")  # imports take longer than this run
    ends, grown = [], rerun_scene.reopened

    def noted(path):
        for log, end in grown(path):
            ends.append(end)
            yield log, end

    monkeypatch.setattr(rerun_scene, "reopened", noted)
    writer = threading.Thread(target=again, args=(rig, tmp_path / "run.mcap", 0.04))
    writer.start()
    rerun_scene.follow(tmp_path / "run.mcap", tmp_path / "live.rrd")
    writer.join()
    rerun_scene.show(tmp_path / "run.mcap", tmp_path / "whole.rrd")
    assert len({end for end in ends if 0.0 < end < 0.3}) > 2, "the log did not grow between the reads"
    (links, curve), (all_links, all_of_it) = held(tmp_path / "live.rrd"), held(tmp_path / "whole.rrd")
    assert [t for t, _ in links] == [t for t, _ in all_links]
    assert links == all_links
    assert curve == all_of_it
    assert len(curve) == 301


@pytest.mark.long
def test_steps_between_two_records_of_links_wait(rig, tmp_path, monkeypatch):
    """Steps between two records of links wait: with short windows nothing is lost or repeated."""
    monkeypatch.setattr(rerun_scene, "RATE", 1e4)
    rerun_scene.show(rig, tmp_path / "whole.rrd")
    ends = [0.0, 0.011, 0.013, 0.0141, 0.2, 0.203, np.inf]

    def grown(path):
        for end in ends:
            with Log(path) as log:
                log.being_written = end < np.inf
                yield log, end

    monkeypatch.setattr(rerun_scene, "reopened", grown)
    rerun_scene.follow(rig, tmp_path / "live.rrd")
    (links, curve), (all_links, all_of_it) = held(tmp_path / "live.rrd"), held(tmp_path / "whole.rrd")
    assert links == all_links
    assert curve == all_of_it


def test_a_killed_run_ends_the_view(rig, tmp_path, monkeypatch):
    monkeypatch.setattr(rerun_scene, "PERIOD", 0.05)

    def killed():
        with pytest.raises(RuntimeError):
            again(rig, tmp_path / "run.mcap", 0.0, end=0.2)

    killed()
    rerun_scene.follow(tmp_path / "run.mcap", tmp_path / "live.rrd")
    links, _ = held(tmp_path / "live.rrd")
    assert links[-1][0] == pytest.approx(0.2e9, abs=6e6)


@pytest.mark.long
def test_a_run_that_will_replace_an_older_log_is_followed(rig, tmp_path, monkeypatch):
    monkeypatch.setattr(rerun_scene, "PERIOD", 0.02)
    path, files = tmp_path / "run.mcap", []
    path.write_bytes(rig.read_bytes())
    writer = threading.Thread(target=again, args=(rig, path, 0.04))
    writer.start()
    while rerun_scene.growing_log(path) == path:
        time.sleep(0.001)
    for log, end in rerun_scene.reopened(path):
        files.append((log.path.name, end))
    writer.join()
    assert len({end for name, end in files if name == "run.running.mcap"}) > 2
    assert files[-1][1] == np.inf
    assert [file.name for file in tmp_path.iterdir()] == ["run.mcap"]


def test_where_nothing_comes_it_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(rerun_scene, "PERIOD", 0.01)
    monkeypatch.setattr(rerun_scene, "PATIENCE", 0.05)
    with pytest.raises(BadInput, match="no run has written a record there"):
        rerun_scene.follow(tmp_path / "none.mcap", tmp_path / "live.rrd")
    assert not list(tmp_path.iterdir()), "a half-written file is left"
