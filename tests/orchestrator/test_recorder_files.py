"""The recorder's file: a killed run, a full disk, a folder or a file that cannot be written, two runs, an older log."""

import os
import signal
import struct
import subprocess
import sys
import textwrap
import threading
import time
from contextlib import suppress

import numpy as np
import pytest
from logged import logged
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader
from recorded import STEP, TOPICS, disk, record, values, write_steps

from orchestrator.log.container_writer import ContainerWriter
from orchestrator.log.log_file import LogFailed, check_writable, growing_log, left_behind
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.log.tools import BROKEN, RECOVERED, WHOLE, recover, verify


def test_a_killed_run_loses_less_than_a_second(tmp_path):
    script = textwrap.dedent(f"""
        import time
        import numpy as np
        from orchestrator.log.recorder import Recorder
        topics = {{"/a/out": [("clock", "s"), ("step", "1")]}}
        with Recorder({str(tmp_path / "killed.mcap")!r}, topics, {{}}, {{}}) as recorder:
            for k in range(10**9):
                recorder.write("/a/out", k, k * 1e-3, 1e-3, np.array([time.monotonic(), k]))
                if k == 0:
                    print("begun", flush=True)
                time.sleep(1e-3)
    """)
    child = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE)
    assert child.stdout.readline() == b"begun\n"
    time.sleep(1.5)
    child.send_signal(signal.SIGKILL)
    killed = time.monotonic()
    assert child.wait() == -signal.SIGKILL
    child.stdout.close()

    with Log(tmp_path / "killed.mcap") as log:
        assert not log.complete
        assert log.closing is None
        clock, step = log.read("/a/out").values.T
    assert killed - 1.0 < clock[-1] < killed
    assert np.array_equal(step, np.arange(len(step)))  # complete from the start
    with (tmp_path / "killed.mcap").open("rb") as stream:  # MCAP's own reader sees the same
        messages = []
        with suppress(McapError, struct.error):
            messages.extend(NonSeekingReader(stream, validate_crcs=True).iter_messages(log_time_order=False))
    assert len(messages) == len(step)


@pytest.mark.parametrize("room", [3_000_000, 300_000], ids=["of some chunks", "of less than a chunk"])
def test_a_full_disk_is_one_sentence_and_leaves_all_that_fits(tmp_path, room):
    path, random = tmp_path / "full.mcap", np.random.default_rng(1)
    widths, written = {"/a/in": 3, "/a/out": 300, "/a/links": 100}, []
    topics = {topic: [(f"x{i}", "m") for i in range(width)] for topic, width in widths.items()}
    recorder = Recorder(path, topics, {}, {}, every={"/a/links": 5}, flush=60)
    together = recorder.join_topics(["/a/in"], ["/a/out"])

    def run():
        while True:
            written.append([random.normal(size=width) for width in widths.values()])
            k = len(written) - 1
            recorder.write(together, k, k * STEP, STEP, *written[k][:2])
            recorder.write("/a/links", k, k * STEP, STEP, written[k][2])

    with disk(room):
        with pytest.raises(LogFailed) as failure:
            run()
        k = len(written) - 1
        recorder.close("failed", str(failure.value), k)
    assert path.stat().st_size > room - 40_000, "the remaining space holds the end of a file and no step"
    with Log(path, unfinished=True) as log:
        given, shown, links = (log.read(topic).values for topic in topics)
        assert (log.closing["status"], log.closing["steps"]) == ("failed", k)
    last = len(shown) - 1
    assert last > room / 5000  # a step takes 3400 bytes
    steps = range(last + 1)
    for rows, column, numbers in ((given, 0, steps[1:]), (shown, 1, steps), (links, 2, steps[::5])):
        assert np.array_equal(rows, [written[number][column] for number in numbers])
    assert verify(path) == (BROKEN, [f"{path} ends with step {last} of {k}"])
    assert recover(path, tmp_path / "saved.mcap").code == RECOVERED
    with Log(tmp_path / "saved.mcap", unfinished=True) as log:
        assert log.closing["steps"] == last
        assert np.array_equal(log.read("/a/out").values, shown)


def test_a_disk_that_fills_while_rows_are_written_leaves_their_memory(tmp_path, monkeypatch):
    """Kernels write rows into a block without Python's lock: until ``commit`` it must stay the page's."""
    recorder, reserved = Recorder(tmp_path / "a.mcap", TOPICS, {}, {}), threading.Event()
    write_steps(recorder, 5)
    recorder.flush()

    def full(*parts):
        reserved.wait()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(ContainerWriter, "attachment", full)
    recorder.attach("name", b"")
    topic = next(iter(TOPICS))
    (page,) = recorder.pages(topic)
    recorder.write(topic, 6, 6 * STEP, STEP, values(topic, 6))
    recorder.reserve()
    block = page.block
    reserved.set()
    time.sleep(0.3)
    assert page.block is block
    with pytest.raises(LogFailed):
        recorder.commit({topic: 1})
    recorder.close("failed", "", 5)
    with Log(tmp_path / "a.mcap", unfinished=True) as log:
        assert log.read(topic).t[-2:] == pytest.approx([5 * STEP, 6 * STEP]), "a row that was counted is lost"
        assert log.closing["status"] == "failed"


@pytest.mark.parametrize("older", [False, True])
def test_a_disk_that_fills_while_closing_keeps_what_was_written_and_an_older_log(tmp_path, older):
    path = tmp_path / "a.mcap"
    if older:
        record(path, steps=10)
    recorder = Recorder(path, TOPICS, {}, {})
    write_steps(recorder, 50)
    recorder.flush()
    with disk(recorder.file.stat().st_size), pytest.raises(LogFailed, match="a.running.mcap" if older else "a.mcap"):
        recorder.close("ok", "", 50)
    assert not older or verify(path).code == WHOLE
    with Log(tmp_path / ("a.running.mcap" if older else "a.mcap"), unfinished=True) as log:
        assert log.closing is None
        assert len(log.read("/chassis/out").t) == 51


def test_an_older_log_is_replaced_and_open_readers_keep_it(tmp_path):
    path = record(tmp_path / "a.mcap", steps=10)
    with Log(path) as old:
        record(path, steps=20)
        assert len(old.read("/chassis/out").t) == 11
    with Log(path) as new:
        assert np.array_equal(new.read("/chassis/out").values[20], values("/chassis/out", 20))
        assert new.read("/chassis/out").t[-1] == 20 * STEP


def test_an_older_log_stays_until_the_new_one_has_ended(tmp_path):
    path, running = record(tmp_path / "a.mcap", steps=10), tmp_path / "a.running.mcap"
    older = path.read_bytes()
    with Recorder(path, TOPICS, {}, {}) as recorder:
        assert recorder.file == running == growing_log(path)
        write_steps(recorder, 20)
        recorder.flush()
        assert path.read_bytes() == older
        with Log(running, unfinished=True) as log:
            assert log.being_written
            assert log.read("/chassis/out").t[-1] == 20 * STEP
        with pytest.raises(LogFailed, match="another run is writing it"):
            Recorder(path, TOPICS, {}, {})
        recorder.close("ok", "", 20)
        assert verify(path).code == WHOLE
    assert growing_log(path) == path == recorder.file
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap"]
    assert verify(path).sentences[0].endswith("20 steps")


def test_a_killed_run_leaves_the_older_log_and_its_own(tmp_path):
    path = record(tmp_path / "a.mcap", steps=10)
    script = textwrap.dedent(f"""
        import numpy as np, os
        from orchestrator.log.recorder import Recorder
        recorder = Recorder({str(path)!r}, {{"/a/out": [("x", "m")]}}, {{}}, {{}})
        recorder.write("/a/out", 0, 0.0, 1e-3, np.array([7.0]))
        recorder.flush()
        os.kill(os.getpid(), 9)
    """)
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == -signal.SIGKILL
    assert verify(path).code == WHOLE
    with Log(tmp_path / "a.running.mcap", unfinished=True) as log:
        assert log.read("/a/out").values.tolist() == [[7.0]]
    with logged(r"a\.running\.mcap was left by a run that was killed: 'cotrack resume'"):
        record(path, steps=20)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.mcap", "a.running.mcap"]
    assert verify(path).sentences[0].endswith("20 steps")


@pytest.mark.parametrize("exists", [False, True])
def test_a_link_stays_and_its_target_is_written(tmp_path, exists):
    """A log that grows beside the target is found through the link."""
    link, target = tmp_path / "link.mcap", tmp_path / "far" / "log.mcap"
    if exists:
        target.parent.mkdir()
        record(target, steps=10)
    link.symlink_to(target)
    with Recorder(link, TOPICS, {}, {}) as recorder:
        grows = target.with_name("log.running.mcap") if exists else target
        assert growing_log(target) == recorder.file == grows
        assert not exists or growing_log(link) == grows
        with pytest.raises(LogFailed):
            check_writable(link)
        write_steps(recorder, 20)
        recorder.close("ok", "", 20)
    assert link.is_symlink()
    assert verify(target).sentences[0].endswith("20 steps")
    assert [file.name for file in target.parent.iterdir()] == ["log.mcap"]


def test_a_pipe_with_the_name_of_a_growing_log_is_no_log(tmp_path):
    path = record(tmp_path / "a.mcap", steps=10)
    os.mkfifo(tmp_path / "a.running.mcap")
    assert growing_log(path) == path
    assert left_behind(path) == []
    record(path, steps=20)
    assert verify(path).sentences[0].endswith("20 steps")
