"""The seal of a log: other software may write it anew, every edit of a content is told, anyone can compute it."""

import hashlib
import json

import numpy as np
import pytest
from logged import logged
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType
from mutated import Content
from rewritten_logs import SAVED, rewritten, sealed_log
from short_runs import SHORT

from orchestrator.execution import replay_model, resume
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.log.tools import BROKEN, RECOVERED, WHOLE, recover, verify
from orchestrator.results.page.trust import completeness

source = pytest.fixture(scope="module")(sealed_log)


WAYS = {
    "zstd": {"compression": CompressionType.ZSTD},
    "lz4": {"compression": CompressionType.LZ4},
    "plain": {"compression": CompressionType.NONE},
    "small chunks": {"compression": CompressionType.LZ4, "chunk_size": 3000},
    "unchunked": {"use_chunking": False},
    "by topic": {"order": lambda one: (one[1].topic, one[2].log_time)},
    "by time": {"order": lambda one: (one[2].log_time,)},
    "no checksums": {"enable_crcs": False},
    "no summary": {
        "use_summary_offsets": False, "use_statistics": False, "repeat_channels": False, "repeat_schemas": False,
        "index_types": IndexType.NONE,
    },
}  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_a_rewritten_log_is_whole_and_has_the_same_numbers(source, tmp_path, way):
    file = rewritten(source, tmp_path / "other.mcap", **WAYS[way])
    verdict = verify(file)
    assert (verdict.code, verdict.sentences[1:]) == (WHOLE, verify(source).sentences[1:])
    with Log(source) as first, Log(file) as second, Log(file, by_index=False) as walked:
        assert second.digest() == first.digest() == walked.digest()
        assert second.attachments == first.attachments
        assert all(second.attachment(name) == first.attachment(name) for name in first.attachments)
        for topic in first.topics:
            assert np.array_equal(second.read(topic).values, first.read(topic).values, equal_nan=True)
        assert second.faults == []
        second.check_seal()


def test_without_metadata_it_has_signals_alone(source, tmp_path):
    file = rewritten(source, tmp_path / "other.mcap", keep=False)
    said = "was rewritten by other software, which left out scene, status and results"
    with logged(said), Log(file) as log, Log(source) as first:
        assert log.hashes() == first.hashes()
    assert [sentence.split(": ")[-1] for sentence in verify(file).sentences] == ["it has signals alone"]


def test_channels_of_others_cost_no_message_of_ours(source, tmp_path):
    """Their messages differ in size, and are in the same chunks."""

    def more(writer):
        schema = writer.register_schema("note", "jsonschema", b"{}")
        channel = writer.register_channel("/notes", "json", schema)
        for k in range(50):
            writer.add_message(channel, 1000 * k, json.dumps({"text": "x" * k}).encode(), 1000 * k, k)

    for options in (WAYS["lz4"], WAYS["unchunked"], WAYS["no summary"]):
        file = rewritten(source, tmp_path / "other.mcap", more=more, **options)
        assert verify(file).code == WHOLE
        with Log(file) as log, Log(source) as first:
            assert log.others["/notes"] == "note, json"
            assert log.digest() == first.digest()


def seal_by_definition(path):
    """Seal of a log, from the page on the format alone."""
    with path.open("rb") as stream:
        (closing,) = (record.metadata for record in make_reader(stream).iter_metadata() if record.name == "closing")
    rest = {key: closing[key] for key in sorted(closing) if key != "seal"}
    return hashlib.sha256(json.dumps(rest).encode()).hexdigest()


def test_the_definition_gives_the_seal(source):
    with Log(source) as log:
        assert log.seal == seal_by_definition(source)
        assert {f"attachment:{name}" for name in log.attachments} < log.closing["contents"].keys()
    assert verify(source).sentences[-1] == f"seal {log.seal}"
    assert verify(source).code == WHOLE


def flipped(data):
    return bytes([*data[:-3], data[-3] ^ 1, *data[-2:]])


def about(key, before, after):
    return lambda entries: entries | {key: entries[key].replace(before, after, 1)}


EDITS = (  # kind and name of a content, its change
    ("attachment", "scene.json", lambda data: data.replace(b"small", b"large")),
    ("attachment", SAVED, lambda data: data.upper()),
    ("attachment", "chassis.modelDescription.xml", lambda data: None),
    ("attachment", "note.txt", lambda data: b"all is well"),
    ("metadata", "run", lambda entries: entries | {"step": "1"}),
    ("metadata", "provenance", lambda entries: entries | {"commit": "abd"}),
    ("metadata", "versions", lambda entries: None),
    ("metadata", "closing", lambda entries: entries | {"status": "failed"}),
    ("metadata", "closing", lambda entries: entries | {"warnings": "[] "}),
    ("metadata", "closing", lambda entries: {key: one for key, one in entries.items() if key != "seal"}),
    ("message", "/chassis/out", flipped),
    ("message", "/stats/chassis", lambda data: None),
    ("message", "/events", lambda data: data.replace(b"lifts", b"drops")),
    ("channel", "/chassis/out", lambda entries: entries | {"colour": "red"}),
    ("channel", "/chassis/out", about("units", '"rad"', '"deg"')),
    ("channel", "/chassis/out", about("names", "right.road_arm[5].angle", "right.road_arm[6].angle")),
    ("topic", "/events", lambda topic: "/eventz"),
    ("schema", "/events", lambda name: "foxglove.Fog"),
)


@pytest.mark.parametrize(("kind", "name", "made"), EDITS)
def test_an_edit_is_told_with_all_checksums_made_again(source, tmp_path, kind, name, made):
    def change(of, named, content):
        return made(content) if (of, named) == (kind, name) else content

    path = rewritten(source, tmp_path / "edited.mcap", change=change)
    assert verify(path).code == BROKEN
    with Log(path, unfinished=True) as log, pytest.raises(LogUnreadable):
        log.check_seal()
    with Log(path, unfinished=True) as log:
        assert completeness(log)[0] == "bad"
    assert recover(path, tmp_path / "saved.mcap").code in (WHOLE, RECOVERED)
    with Log(tmp_path / "saved.mcap", unfinished=True) as log:
        assert not log.seal_faults(), "a seal that is made again holds"


def test_another_order_of_contents_is_no_edit_and_one_of_messages_is(source, tmp_path):
    content = Content(Content(source).write(tmp_path / "same.mcap"))
    content.attachments, content.metadata = (
        dict(reversed(one.items())) for one in (content.attachments, content.metadata)
    )
    assert verify(content.write(tmp_path / "same.mcap", old_seal=True)).code == WHOLE
    content.chunks.reverse()
    assert verify(content.write(tmp_path / "same.mcap", old_seal=True)).code == BROKEN


def test_a_recovered_log_keeps_what_a_rewritten_one_has(source, tmp_path):
    file = rewritten(source, tmp_path / "other.mcap", **WAYS["lz4"])
    assert recover(file, tmp_path / "saved.mcap").code == WHOLE
    with Log(tmp_path / "saved.mcap") as log, Log(source) as first:
        assert (log.attachments, log.digest()) == (first.attachments, first.digest())
        assert not log.seal_faults()
        assert log.seal == seal_by_definition(tmp_path / "saved.mcap")


def test_a_log_that_was_cut_off_has_no_seal_and_is_sealed_anew(source, tmp_path):
    cut, saved = tmp_path / "cut.mcap", tmp_path / "saved.mcap"
    cut.write_bytes(source.read_bytes()[:60_000])
    with Log(cut, unfinished=True) as log:
        assert (log.seal, log.seal_faults()) == ("", [])
    assert recover(cut, saved).code == RECOVERED
    with Log(saved, unfinished=True) as log:
        assert log.seal == seal_by_definition(saved)
        assert log.metadata["recovered"] == {"of": "cut.mcap", "seal": "none"}


def test_replay_and_resume_ask_the_seal(source, tmp_path):
    content = Content(source)
    content.attachments["system.json"] = json.dumps({"instances": [], "connections": []}).encode()
    path = content.write(tmp_path / "edited.mcap", old_seal=True)
    for ask in (
        lambda: replay_model.open_replay(path, "chassis", None).__enter__(),
        lambda: resume.resume(path, tmp_path / "more.mcap"),
    ):
        with pytest.raises(LogUnreadable, match="is not as it was sealed"):
            ask()
    with Log(source) as log:
        assert completeness(log)[0] == "good"


def test_info_compare_and_report_say_that_a_seal_does_not_hold(cotrack, tmp_path):
    assert cotrack(*SHORT, "--log", "a.mcap")[0] == 0
    content = Content(Content(tmp_path / "a.mcap").write(tmp_path / "a.mcap"))
    content.metadata["run"]["scene"] = content.metadata["run"]["scene"][::-1]
    content.write(tmp_path / "b.mcap", old_seal=True)
    said = "b.mcap is not as it was sealed"
    assert cotrack.done("log", "info", "b.mcap").rstrip().endswith(", which does not hold")
    faults = json.loads(cotrack("log", "info", "b.mcap", "--json")[1])["seal_faults"]
    assert [said in fault for fault in faults] == [True]
    for command in (
        ("compare", "a.mcap", "b.mcap"), ("compare", "b.mcap", "a.mcap"), ("report", "b.mcap", "-o", "b.html"),
        ("log", "info", "a.mcap"), ("compare", "a.mcap", "a.mcap"), ("report", "a.mcap", "-o", "a.html"),
    ):  # fmt: skip
        status, out, err = cotrack(*command)
        assert (status, said in err, "does not hold" in out) == (0, "b.mcap" in command, False), command
