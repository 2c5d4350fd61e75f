"""Logs that other software has rewritten: the same contents in another file are as good as the recorder's."""

import json

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer
from recorded import ATTACHMENTS, EVERY, METADATA, TOPICS, write_steps

from orchestrator.log import recorder as recorder_module
from orchestrator.log.message_records import Event
from orchestrator.log.reader import Log, LogUnreadable
from orchestrator.log.recorder import Recorder
from orchestrator.log.tools import BROKEN, WHOLE, recover, verify

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


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """Log of some ten chunks with an event."""
    file = tmp_path_factory.mktemp("source") / "run.mcap"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recorder_module, "CHUNK", 80_000)
        with Recorder(file, TOPICS, ATTACHMENTS, METADATA, every=EVERY, flush=60) as recorder:
            write_steps(recorder, 1500)
            recorder.write_remaining()
            recorder.write_events(
                [Event(0.1, "chassis", "lifted", "a wheel lifts off"), Event(0.2, "a", "lands", "it")]
            )
            recorder.close("ok", "", 1500)
    return file


def rewritten(source, target, order=None, change=None, keep=True, more=None, **options):
    """A log as MCAP's own library writes it; ``change`` maps kind, name and content of what it keeps."""
    change = change or (lambda kind, name, content: content)
    with source.open("rb") as stream, target.open("wb") as out:
        reader = make_reader(stream)
        messages = [*reader.iter_messages(log_time_order=False)]
        attachments, metadata = [*reader.iter_attachments()], [*reader.iter_metadata()]
        writer = Writer(out, **options)
        writer.start(profile="", library="other software")
        schemas, channels = {}, {}
        if more:
            more(writer)
        for schema, channel, message in sorted(messages, key=order) if order else messages:
            if channel.id not in channels:
                if schema.id not in schemas:
                    schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
                about = change("channel", channel.topic, channel.metadata)
                given = channel.topic, channel.message_encoding, schemas[schema.id], about
                channels[channel.id] = writer.register_channel(*given)
            data = change("message", channel.topic, message.data)
            times = message.log_time, data, message.publish_time, message.sequence
            if data is not None:
                writer.add_message(channels[channel.id], *times)
        for each in attachments if keep else ():
            data = change("attachment", each.name, each.data)
            if data is not None:
                writer.add_attachment(each.create_time, each.log_time, each.name, each.media_type, data)
        for each in metadata if keep else ():
            entries = change("metadata", each.name, each.metadata)
            if entries is not None:
                writer.add_metadata(each.name, entries)
        writer.finish()
    return target


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


def of(which, made):
    """A change of what has this kind and name."""
    return lambda kind, name, content: made(content) if (kind, name) == which else content


def flipped(data):
    return bytes([*data[:-3], data[-3] ^ 1, *data[-2:]])


@pytest.mark.parametrize(("change", "said"), [
    (of(("attachment", "scene.json"), lambda data: data.replace(b"small", b"large")),
     "the attachment 'scene.json' is changed"),
    (of(("attachment", "chassis.modelDescription.xml"), lambda data: None),
     "the attachment 'chassis.modelDescription.xml' is missing"),
    (of(("metadata", "run"), lambda entries: entries | {"step": "1"}), "the record 'run' is changed"),
    (of(("metadata", "versions"), lambda entries: None), "the record 'versions' is missing"),
    (of(("metadata", "closing"), lambda entries: entries | {"status": "perfect"}), "its closing record is changed"),
    (of(("message", "/chassis/out"), flipped), "the record of /chassis/out is changed"),
    (of(("message", "/events"), lambda data: data.replace(b"lifts", b"drops")),
     "the text of /events is changed"),
    (of(("channel", "/chassis/out"), lambda about: about | {"colour": "red"}),
     "the description of /chassis/out is changed"),
])  # fmt: skip
def test_a_rewrite_that_changes_a_content_is_found(source, tmp_path, change, said):
    file = rewritten(source, tmp_path / "other.mcap", change=change)
    with Log(file) as log, pytest.raises(LogUnreadable, match=said):
        log.check_seal()
    verdict = verify(file)
    assert verdict.code == BROKEN
    assert any(said in sentence for sentence in verdict.sentences)


def test_without_metadata_it_has_signals_alone(source, tmp_path):
    file = rewritten(source, tmp_path / "other.mcap", keep=False)
    said = "was rewritten by other software, which left out scene, status and results"
    with pytest.warns(match=said), Log(file) as log, Log(source) as first:
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


def test_a_recovered_log_keeps_what_a_rewritten_one_has(source, tmp_path):
    file = rewritten(source, tmp_path / "other.mcap", **WAYS["lz4"])
    assert recover(file, tmp_path / "saved.mcap").code == WHOLE
    with Log(tmp_path / "saved.mcap") as log, Log(source) as first:
        assert (log.attachments, log.digest()) == (first.attachments, first.digest())
        assert not log.seal_faults()
