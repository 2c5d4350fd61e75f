"""A sealed log, and logs as other software writes them."""

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from recorded import ATTACHMENTS, EVERY, METADATA, TOPICS, write_steps

from orchestrator.log import recorder as module
from orchestrator.log.log_metadata import CHECKPOINT
from orchestrator.log.message_records import Event
from orchestrator.log.recorder import Recorder

STEPS = 300
SAVED = f"{CHECKPOINT}{STEPS}"


def sealed_log(tmp_path_factory):
    """Log of some ten chunks with a checkpoint, provenance and events."""
    path = tmp_path_factory.mktemp("source") / "run.mcap"
    metadata = METADATA | {"provenance": {"created": "2026-01-01", "commit": "abc"}}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "CHUNK", 16_000)
        with Recorder(path, TOPICS, ATTACHMENTS, metadata, every=EVERY, flush=60) as recorder:
            write_steps(recorder, STEPS)
            recorder.attach(SAVED, b"state" * 100)
            recorder.write_remaining()
            recorder.write_events(
                [Event(0.1, "chassis", "lifted", "a wheel lifts off"), Event(0.2, "a", "lands", "it")]
            )
            recorder.close("ok", "", STEPS)
    return path


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
                    name = change("schema", channel.topic, schema.name)
                    schemas[schema.id] = writer.register_schema(name, schema.encoding, schema.data)
                about = change("channel", channel.topic, channel.metadata)
                topic = change("topic", channel.topic, channel.topic)
                given = topic, channel.message_encoding, schemas[schema.id], about
                channels[channel.id] = writer.register_channel(*given)
            data = change("message", channel.topic, message.data)
            times = message.log_time, data, message.publish_time, message.sequence
            if data is not None:
                writer.add_message(channels[channel.id], *times)
        for each in attachments if keep else ():
            if (data := change("attachment", each.name, each.data)) is not None:
                writer.add_attachment(each.create_time, each.log_time, each.name, each.media_type, data)
        if (data := change("attachment", "note.txt", None)) is not None:
            writer.add_attachment(0, 0, "note.txt", "text/plain", data)
        for each in metadata if keep else ():
            if (entries := change("metadata", each.name, each.metadata)) is not None:
                writer.add_metadata(each.name, entries)
        writer.finish()
    return target
