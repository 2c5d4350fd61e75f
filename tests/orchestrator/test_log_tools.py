import json
import re
import shutil
import struct
import tempfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from mutated import Content
from recorded import ATTACHMENTS, STEP, TOPICS, chunked_log, small_log

from orchestrator.log import recorder as module
from orchestrator.log.container import LogUnreadable
from orchestrator.log.measured_formats import read_samples
from orchestrator.log.message_records import PREFIX
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.log.tools import BROKEN, RECOVERED, WHOLE, info, recover, verify

small = pytest.fixture(scope="module")(small_log)
chunked = pytest.fixture(scope="module")(chunked_log)


def without_digests(closing):
    """A closing record apart from the digests of metadata, which say of what a log was recovered."""
    return {key: value for key, value in closing.items() if key not in ("contents", "seal")}


def records(data):
    """(opcode, offset, end) of all records."""
    offset = 8
    while offset < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, offset)
        yield opcode, offset, offset + 9 + length
        offset += 9 + length


def chunk_spans(data):
    """(start of the chunk, end of its message indexes) of all chunks."""
    spans = []
    for opcode, start, end in records(data):
        if opcode == 0x06:
            spans.append([start, end])
        elif opcode == 0x07:
            spans[-1][1] = end
    return spans


def test_a_whole_log(small):
    verdict = verify(small)
    assert verdict.code == WHOLE
    assert verdict.sentences == [
        f"{small} is whole: 5 topics, 425 messages, 100 steps",
        "the run ended with status ok",
        f"seal {Log(small).seal}",
    ]


def test_a_log_of_a_failed_run_is_whole(tmp_path):
    with Recorder(tmp_path / "a.mcap", TOPICS, {}, {}) as recorder:
        recorder.close("failed", "Newton did not converge at t = 0.3 s", 0)
    verdict = verify(tmp_path / "a.mcap")
    assert verdict.code == WHOLE
    assert verdict.sentences[1] == "the run ended with status failed: Newton did not converge at t = 0.3 s"


@settings(max_examples=150)
@given(st.floats(0.0, 1.0, exclude_max=True), st.integers(0, 7))
@example(0.0, 0)
def test_a_flipped_bit_is_found_wherever_it_is(small, fraction, bit):
    data = bytearray(small.read_bytes())
    data[int(fraction * len(data))] ^= 1 << bit
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flipped.mcap"
        path.write_bytes(data)
        verdict = verify(path)
        assert verdict.code == BROKEN
        assert all("\n" not in sentence for sentence in verdict.sentences)
        data[int(fraction * len(data))] ^= 1 << bit
        path.write_bytes(data)
        assert verify(path).code == WHOLE


def test_the_sentences_name_the_damage(chunked, tmp_path):
    data = chunked.read_bytes()
    start, _ = chunk_spans(data)[1]
    path = tmp_path / "a.mcap"

    def sentences(content):
        path.write_bytes(content)
        verdict = verify(path)
        assert verdict.code == BROKEN
        return "\n".join(verdict.sentences)

    flipped = bytearray(data)
    flipped[start + 100] ^= 4
    assert f"the chunk at byte {start} is damaged" in sentences(flipped)
    attached = bytearray(data)
    at = data.index(b"<fmiModelDescription/>")
    attached[at] ^= 4
    assert "the attachment 'chassis.modelDescription.xml'" in sentences(attached)
    assert "the checksum over all data does not hold" in sentences(data.replace(b"small", b"smell", 1))
    assert "no closing record: the run was cut off after t = " in sentences(data[: len(data) // 2])
    assert "the log was cut off" in sentences(data[: len(data) // 2])


def test_a_missing_chunk_is_a_gap(chunked, tmp_path):
    data = chunked.read_bytes()
    start, end = chunk_spans(data)[1]
    (tmp_path / "a.mcap").write_bytes(data[:start] + data[end:])
    sentences = "\n".join(verify(tmp_path / "a.mcap").sentences)
    assert "/chassis/out: step " in sentences
    assert "1501 were recorded" in sentences


def test_a_step_that_was_never_written_is_a_gap(tmp_path):
    def run(steps):
        with Recorder(
            tmp_path / "a.mcap", {"/a/out": [("x", "m")], "/stats/a": [("wall_time", "s")]}, {}, {}
        ) as recorder:
            for k in steps:
                recorder.write("/a/out", k, k * STEP, STEP, np.zeros(1))
                if k % 3 == 0:
                    recorder.write("/stats/a", k, k * STEP, STEP, np.zeros(1))
            recorder.close("ok", "", 9)
        return verify(tmp_path / "a.mcap")

    assert run(range(10)).code == WHOLE
    broken = run([0, 1, 2, 4, 5, 6, 7, 8, 9])
    assert broken == (BROKEN, ["/a/out: step 4 follows step 2"])
    assert run(range(9)) == (BROKEN, [f"{tmp_path / 'a.mcap'} ends with step 8 of 9"])


def test_no_log_at_all(tmp_path):
    (tmp_path / "a.mcap").write_text("hello")
    for tool in (
        verify(tmp_path / "a.mcap"),
        verify(tmp_path / "b.mcap"),
        recover(tmp_path / "a.mcap", tmp_path / "c.mcap"),
    ):
        assert tool.code == BROKEN
    with pytest.raises(LogUnreadable):
        info(tmp_path / "b.mcap")


@pytest.mark.parametrize("kept", [1.0, 0.6])
def test_a_bag_of_other_software_is_told_as_what_it_is(kept, tmp_path):
    """Whole and cut off, in all ways to a log; logs of cotrack that other software rewrote are none of these."""
    file = tmp_path / "bag.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream, chunk_size=500)
        writer.start(profile="ros2", library="libmcap 1.2")
        for k in range(7):
            schema = writer.register_schema("std_msgs/msg/Float64", "ros2msg", b"float64 data")
            channel = writer.register_channel(f"/wheel{k}/speed", "cdr", schema)
            for t in range(0, 10**9, 10**7):
                writer.add_message(channel, t, struct.pack("<Id", 256, 1.0), t)
        writer.finish()
    file.write_bytes(file.read_bytes()[: int(kept * file.stat().st_size)])
    told = "is an MCAP file of other software, no log of cotrack, and its numbers are not read: profile 'ros2', library"
    told += r" 'libmcap 1\.2', topics /wheel0/speed \(std_msgs/msg/Float64, cdr\), "
    for read in (Log, info, lambda path: read_samples(path, list)):
        with pytest.raises(LogUnreadable, match=told):
            read(file)
    for verdict in (verify(file), recover(file, tmp_path / "saved.mcap")):
        assert verdict.code == BROKEN
        assert re.search(told, verdict.sentences[0])
    assert not (tmp_path / "saved.mcap").exists()
    if kept == 1.0:
        assert verdict.sentences[0].endswith(" ...")


def test_recovering_a_whole_log_copies_it(small, tmp_path):
    assert recover(small, tmp_path / "copy.mcap").code == WHOLE
    assert verify(tmp_path / "copy.mcap").code == WHOLE
    with Log(small) as ours, Log(tmp_path / "copy.mcap") as theirs:
        assert theirs.hashes() == ours.hashes()
        assert theirs.metadata.pop("recovered") == {"of": "small.mcap", "seal": ours.seal}
        assert theirs.metadata == ours.metadata
        assert without_digests(theirs.closing) == without_digests(ours.closing)
        assert {name: theirs.attachment(name) for name in theirs.attachments} == ATTACHMENTS


@settings(max_examples=25)
@given(st.floats(0.05, 0.99))
def test_recovering_a_cut_log_saves_its_beginning(chunked, fraction):
    data = chunked.read_bytes()
    end = int(fraction * chunk_spans(data)[-1][1])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "cut.mcap").write_bytes(data[:end])
        verdict = recover(folder / "cut.mcap", folder / "saved.mcap")
        assert verdict.code == RECOVERED
        assert verify(folder / "saved.mcap").code == WHOLE
        whole_chunks = sum(stop <= end for _, stop in chunk_spans(data))
        with Log(chunked) as whole, Log(folder / "saved.mcap") as saved:
            series = saved.read("/chassis/out")
            assert np.array_equal(series.values, whole.read("/chassis/out").values[: len(series.t)])
            assert (len(series.t) > 0) >= (whole_chunks > 0)
            assert saved.closing["status"] == "failed"
            assert "recovered" in saved.closing["message"]


STRIDES = {"/a/in": 1, "/a/out": 3, "/a/links": 7, "/b/in": 1, "/b/out": 1, "/stats/a": 1}


def ragged(path, steps=60, results=None):
    """Write a log as a run does, topic after topic, in chunks that end anywhere in a step."""
    topics = {topic: [("x", "m"), ("y", "m")] for topic in STRIDES}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "CHUNK", 500)
        with Recorder(path, topics, ATTACHMENTS, {}, every=STRIDES, flush=60) as recorder:
            for k in range(steps + 1):
                for name in ("a", "b"):
                    if k:
                        recorder.write(f"/{name}/in", k - 1, (k - 1) * STEP, STEP, np.array([k, 0.0]))
                    recorder.write(f"/{name}/out", k, k * STEP, STEP, np.array([k, 1.0]))
                recorder.write("/a/links", k, k * STEP, STEP, np.array([k, 2.0]))
                if k % 10 == 0:
                    recorder.write("/stats/a", k, k * STEP, STEP, np.array([k, 3.0]))
            recorder.close("ok", "done", steps, results)
    return path


@pytest.mark.long
def test_a_recovered_log_ends_with_a_step_that_all_topics_have(tmp_path):
    """A log that was cut anywhere ends, recovered, with a step that all topics have."""
    data = ragged(tmp_path / "whole.mcap").read_bytes()
    spans = chunk_spans(data)
    assert len(spans) > 20
    cuts = {*np.linspace(spans[0][0], len(data) - 1, 40).astype(int).tolist(), *(end for _, end in spans)}
    ends = set()
    for cut in sorted(cuts):
        (tmp_path / "cut.mcap").write_bytes(data[:cut])
        assert recover(tmp_path / "cut.mcap", tmp_path / "saved.mcap").code == RECOVERED or cut > spans[-1][1]
        assert verify(tmp_path / "saved.mcap").code == WHOLE
        with Log(tmp_path / "saved.mcap") as saved, Log(tmp_path / "cut.mcap") as left:
            n = saved.closing["steps"]
            ends.add(n)
            assert not saved.faults
            for topic, every in STRIDES.items():
                steps = saved.sequence(topic).tolist()
                stop = n if topic.endswith("/in") else n + 1
                if topic.startswith("/stats/"):
                    assert steps == [k for k in left.sequence(topic).tolist() if k <= n]
                elif len(left.sequence("/b/out")):
                    assert steps == list(range(0, stop, every)), (cut, topic)
            lasts = [len(left.sequence(topic)) for topic in ("/a/in", "/b/in")]
            assert n >= min(lasts) - 1, "more than the cut step is lost"
    assert len(ends) > 15


def test_a_topic_that_was_never_recorded_takes_nothing_with_it(tmp_path):
    topics = {"/a/out": [("x", "m")], "/b/out": [("x", "m")]}
    with Recorder(tmp_path / "a.mcap", topics, {}, {}) as recorder:
        for k in range(5):
            recorder.write("/a/out", k, k * STEP, STEP, np.zeros(1))
        recorder.write_remaining()
        data = (tmp_path / "a.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data)
    assert recover(tmp_path / "cut.mcap", tmp_path / "saved.mcap").code == RECOVERED
    with Log(tmp_path / "saved.mcap") as saved:
        assert len(saved.sequence("/a/out")) == 5


def test_results_of_the_closing_record_are_kept(tmp_path):
    results = {"wall_time": "1.5", "error": '{"total": 0.01}', "energy_residual": "-0.002"}
    data = bytearray(ragged(tmp_path / "whole.mcap", results=results).read_bytes())
    with Log(tmp_path / "whole.mcap") as log:
        closing = log.closing
        assert closing["results"] == results
        indexes = log._file.data_end + 13 + 20
    for change in (lambda data: data[:indexes], lambda data: data[:indexes] + b"\xff" * 9 + data[indexes + 9 :]):
        (tmp_path / "bad.mcap").write_bytes(change(data))
        assert verify(tmp_path / "bad.mcap").code == BROKEN
        assert recover(tmp_path / "bad.mcap", tmp_path / "saved.mcap").code == WHOLE
        with Log(tmp_path / "saved.mcap") as saved:
            assert without_digests(saved.closing) == without_digests(closing)
    start, _ = chunk_spans(data)[3]
    data[start + 100] ^= 4
    (tmp_path / "bad.mcap").write_bytes(data)
    assert recover(tmp_path / "bad.mcap", tmp_path / "saved.mcap").code == RECOVERED
    with Log(tmp_path / "saved.mcap") as saved:
        assert saved.closing["results"] == results
        assert (saved.closing["status"], saved.closing["steps"]) == ("failed", 60)
        assert "; the run ended with status ok" in saved.closing["message"]
        inputs, outputs = saved.sequence("/a/in"), saved.sequence("/b/out")
        assert 40 < len(inputs) < 60
        assert np.array_equal(inputs + 1, outputs[1:]), "steps beside the gap are incomplete"


WARNED = {"component": "a", "text": "x", "time": 0.0, "count": 1}


@pytest.mark.parametrize(
    "warnings",
    [7, {}, [7], [{}], ["x"], "[" * 5000, "9" * 5000, "", [WARNED | {"count": -1}], [WARNED | {"count": 10**400}],
     [WARNED | {"time": None}], [WARNED | {"text": "\udcff"}], [WARNED | {"component": []}], [WARNED | {"more": 1}]],
)  # fmt: skip
def test_warnings_that_are_none_damage_their_record(small, tmp_path, warnings):
    content = Content(small)
    content.metadata["closing"]["warnings"] = json.dumps([WARNED])
    with Log(content.write(tmp_path / "good.mcap")) as log:
        assert log.closing["warnings"] == [WARNED]
    content.metadata["closing"]["warnings"] = warnings if isinstance(warnings, str) else json.dumps(warnings)
    path = content.write(tmp_path / "bad.mcap")
    assert "is cut off or damaged" in verify(path).sentences[0]
    assert info(path).log.closing is None
    assert recover(path, tmp_path / "saved.mcap").code == RECOVERED


def test_a_recovery_that_fails_leaves_what_was_there(small, tmp_path):
    content = Content(small)
    content.chunks[0] = [(number, rows.copy(), times) for number, rows, times in content.chunks[0]]
    content.chunks[0][0][1][0, PREFIX + 1 : PREFIX + 9] = list(np.float64(-1.0).tobytes())  # the time t
    del content.metadata["closing"]
    strange = content.write(tmp_path / "strange.mcap")
    saved = Path(shutil.copy(small, tmp_path / "saved.mcap"))
    verdict = recover(strange, saved)
    assert verdict.code == BROKEN
    assert "cannot be recorded at t = -1" in verdict.sentences[0]
    assert saved.read_bytes() == small.read_bytes()
    assert {file.name for file in tmp_path.iterdir()} == {"strange.mcap", "saved.mcap"}


def test_a_log_without_its_beginning_is_broken(tmp_path):
    with Recorder(tmp_path / "a.mcap", {"/a/out": [("x", "m")]}, {}, {}, every={"/a/out": 2}) as recorder:
        for k in range(4, 10):
            recorder.write("/a/out", k, k * STEP, STEP, np.zeros(1))
        recorder.close("ok", "", 9)
    assert verify(tmp_path / "a.mcap") == (BROKEN, ["/a/out: begins with step 4"])


def test_recovering_leaves_out_a_damaged_chunk_only(chunked, tmp_path):
    data = bytearray(chunked.read_bytes())
    start, _ = chunk_spans(data)[1]
    for offset in (start + 100, start + 3):  # in its content; in its length, so that the next record cannot be found
        damaged = data.copy()
        damaged[offset] ^= 0x40
        (tmp_path / "bad.mcap").write_bytes(damaged)
        assert recover(tmp_path / "bad.mcap", tmp_path / "saved.mcap").code == RECOVERED
        assert "step" in verify(tmp_path / "saved.mcap").sentences[0]  # the gap remains
        with Log(chunked) as whole, Log(tmp_path / "saved.mcap") as saved:
            kept = saved.sequence("/chassis/out")
            assert 300 < len(kept) < 1501
            assert (kept[0], kept[-1]) == (0, 1500)
            assert np.array_equal(saved.read("/chassis/out").values, whole.read("/chassis/out").values[kept])


def test_recovering_from_damaged_indexes_loses_nothing(small, tmp_path):
    data = bytearray(small.read_bytes())
    data_end = next(end for opcode, _, end in records(data) if opcode == 0x0F)
    data[data_end + 20] ^= 1
    (tmp_path / "bad.mcap").write_bytes(data)
    assert verify(tmp_path / "bad.mcap").code == BROKEN
    assert recover(tmp_path / "bad.mcap", tmp_path / "saved.mcap").code == WHOLE
    assert verify(tmp_path / "saved.mcap").code == WHOLE


def test_recovering_does_not_vouch_for_damaged_metadata(small, tmp_path):
    (tmp_path / "bad.mcap").write_bytes(small.read_bytes().replace(b"small", b"smell", 1))
    verdict = recover(tmp_path / "bad.mcap", tmp_path / "saved.mcap")
    assert verdict.code == RECOVERED
    assert "holds all 425 messages, but names or metadata may be damaged" in verdict.sentences[0]


def test_a_damaged_channel_is_read_from_its_copy_at_the_end(small, tmp_path):
    data = small.read_bytes()
    (tmp_path / "bad.mcap").write_bytes(data.replace(b'["speed"', b'["spee"d', 1))
    assert verify(tmp_path / "bad.mcap").code == BROKEN
    with Log(tmp_path / "bad.mcap", by_index=False) as walked, Log(tmp_path / "bad.mcap") as log:
        assert walked.faults
        assert walked.topics == log.topics
        assert {
            topic: list(zip(about.names, about.units, strict=True)) for topic, about in log.topics.items()
        } == TOPICS


def test_recovering_does_not_overwrite_the_log(small):
    before = small.read_bytes()
    assert recover(small, small).code == BROKEN
    assert small.read_bytes() == before


def test_info(small):
    about = info(small)
    assert (about.log.complete, about.log.closing["steps"], about.start, about.end) == (True, 100, 0.0, 0.1)
    assert about.log.size == small.stat().st_size
    links = about.topics["/left_track/links"]
    assert (links.messages, links.last) == (21, 0.1)
    assert about.attachments == {name: len(content) for name, content in ATTACHMENTS.items()}
    with Log(small) as log:
        assert about.digest == log.digest()


def test_info_of_a_cut_log(chunked, tmp_path):
    (tmp_path / "cut.mcap").write_bytes(chunked.read_bytes()[:200_000])
    about = info(tmp_path / "cut.mcap")
    assert (about.log.complete, about.log.closing) == (False, None)
    assert about.log.faults


def with_summary(data, summary):
    """A file with another summary and its checksum; no offsets of groups."""
    start = int.from_bytes(data[-28:-20], "little")
    footer = bytes([0x02]) + (20).to_bytes(8, "little") + start.to_bytes(8, "little") + bytes(8)
    crc = zlib.crc32(footer, zlib.crc32(summary))
    return data[:start] + summary + footer + crc.to_bytes(4, "little") + data[-8:]


def test_a_summary_that_is_damaged_or_lacks_a_record_is_not_used(small, tmp_path):
    data, path = small.read_bytes(), tmp_path / "summary.mcap"
    start = int.from_bytes(data[-28:-20], "little")
    kept = [(opcode, data[begin:end]) for opcode, begin, end in records(data) if begin >= start and opcode < 0x0E]
    whole = b"".join(record for _, record in kept)
    with Log(small) as log:
        topics, hashes = log.topics, log.hashes()
    path.write_bytes(with_summary(data, whole))
    with Log(path) as log:
        assert (log.complete, log.topics) == (True, topics)
    path.write_bytes(with_summary(data, whole.replace(b'"rad"', b'"deg"', 1))[:-12] + data[-12:])
    with Log(path) as log:
        assert log.topics == topics
    path.write_bytes(with_summary(data, whole.replace(b'"rad"', b'"deg"', 1)))
    with Log(path) as log:
        assert log.topics != topics, "a summary that is changed with its checksum is used"
    said = r"summary\.mcap is not as it was sealed: the description of /\w+/\w+ is changed"
    assert any(re.search(said, sentence) for sentence in verify(path).sentences)
    for missing in {opcode for opcode, _ in kept} - {0x0B}:
        first = next(k for k, (opcode, _) in enumerate(kept) if opcode == missing)
        path.write_bytes(with_summary(data, b"".join(record for k, (_, record) in enumerate(kept) if k != first)))
        with Log(path) as log:
            assert (log.topics, log.hashes(), log.attachments) == (topics, hashes, tuple(ATTACHMENTS)), missing


def test_an_attachment_is_checked_by_its_checksum_where_no_digest_is(small, tmp_path):
    content = Content(small)
    del content.metadata["closing"]
    data = bytearray(content.write(tmp_path / "cut.mcap").read_bytes())
    data[data.index(ATTACHMENTS["scene.json"]) + 3] ^= 1
    (tmp_path / "cut.mcap").write_bytes(data)
    with (
        Log(tmp_path / "cut.mcap", unfinished=True) as log,
        pytest.raises(LogUnreadable, match=r"at byte \d+ is damaged"),
    ):
        log.attachment("scene.json")


def test_a_message_that_comes_twice_is_told(small, tmp_path):
    content = Content(small)
    number, rows, times = content.chunks[0][0]
    content.chunks[0][0] = number, np.repeat(rows, 2, axis=0), np.repeat(times, 2)
    twice = content.hash_again().write(tmp_path / "twice.mcap")
    with Log(twice) as log, pytest.raises(LogUnreadable, match="are not in order of time"):
        log.read(content.channels[number][0])


def test_an_attachment_is_checked_by_its_digest_when_it_is_read(small, tmp_path):
    content = Content(small)
    content.attachments["scene.json"] = b'{"name": "smell"}'
    said = r"is not as it was sealed: the attachment 'scene\.json' is changed"
    edited = content.write(tmp_path / "edited.mcap", old_seal=True)
    with Log(edited) as log, pytest.raises(LogUnreadable, match=said):
        log.attachment("scene.json")


def test_messages_of_another_size_are_damage(small, tmp_path):
    content = Content(small)
    number, rows, times = content.chunks[0][0]
    shorter = rows[:, :-1].copy()
    shorter[:, 1:9] = np.frombuffer((rows.shape[1] - 10).to_bytes(8, "little"), np.uint8)
    content.chunks[0][0] = number, shorter, times
    topic, shorter_log = content.channels[number][0], content.write(tmp_path / "shorter.mcap")
    said = rf"a message of {topic} does not have {rows.shape[1]} bytes"
    with Log(shorter_log) as log, pytest.raises(LogUnreadable, match=said):
        log.read(topic)
