"""Damaged logs: bytes flipped, cut or inserted, and logs with valid checksums but altered content."""

import hashlib
import json
import random
import struct
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any, Self

import numpy as np
from mcap.reader import make_reader

from orchestrator.log.container_writer import ContainerWriter
from orchestrator.log.log_metadata import CLOSING as CLOSING
from orchestrator.log.message_records import PREFIX
from orchestrator.log.reader import Log
from orchestrator.log.seal import SEAL, sealed

DIGITS = int("9" * 400)
VALUES = (
    DIGITS, -DIGITS, -1, 0, 0.5, 1e308, -1e-308, float("nan"), float("inf"), 2**31, 2**64, None, True, False, "", "x",
    "\udcff", "\x00", "\x1b[2J", "../../evil", "/tmp/evil", "9" * 400, "y" * 70_000, [], {}, [[]], [1, "x"], {"a": {}},
)  # fmt: skip
WORDS = (bytes(8), b"\xff" * 8, struct.pack("<d", float("inf")), struct.pack("<d", -1.0), struct.pack("<d", 1e300))
TEXTS = (b"", b"{", b"[]", b"7", b"null", b"\xff\xfe", b'"x"', b"{}", b'{"a":' * 5000, b"[" * 100_000, b"9" * 5000)


class Content:
    """Content of a log, to be altered and written again with valid checksums."""

    def __init__(self, path: Path) -> None:
        with path.open("rb") as stream:
            reader = make_reader(stream)
            summary = reader.get_summary()
            self.attachments = {item.name: item.data for item in reader.iter_attachments()}
            self.metadata = {item.name: dict(item.metadata) for item in reader.iter_metadata()}
        with Log(path) as log:
            self.channels = {  # without channels for other tools
                number: (channel.topic, summary.schemas[channel.schema_id], dict(channel.metadata))
                for number, channel in summary.channels.items()
                if channel.topic not in log.others
            }
            pieces = [
                [(int.from_bytes(item.rows[0, 9:11], "little"), item.rows, item.log_time) for item in piece]
                for piece in log.chunks()
            ]
        self.chunks = [piece for piece in pieces if piece]

    def nudge(self, topic: str, place: int, step: int) -> None:
        """Change a number by one ULP: the 8 bytes from ``place`` on in a topic's message of a step."""
        for piece in self.chunks:
            for k, (number, rows, times) in enumerate(piece):
                row = np.flatnonzero(np.ascontiguousarray(rows[:, 11:15]).view("<u4")[:, 0] == step)
                if self.channels[number][0] == topic and len(row):
                    rows = rows.copy()
                    bits = rows[row[0], PREFIX + place : PREFIX + place + 8]
                    bits[:] = (bits.copy().view("<i8") + 1).view(np.uint8)
                    piece[k] = number, rows, times

    def hash_again(self) -> Self:
        """Make count and sha256 of each topic in the closing record again."""
        hashes = {topic: hashlib.sha256() for topic, _, _ in self.channels.values()}
        counts = dict.fromkeys(hashes, 0)
        for number, rows, _ in (item for piece in self.chunks for item in piece):
            hashes[self.channels[number][0]].update(np.ascontiguousarray(rows[:, 11:]).data)
            counts[self.channels[number][0]] += len(rows)
        kept = {
            key: value for key, value in self.metadata[CLOSING].items() if not key.startswith(("sha256:", "messages:"))
        }
        self.metadata[CLOSING] = kept | {f"sha256:{topic}": value.hexdigest() for topic, value in hashes.items()}
        self.metadata[CLOSING] |= {f"messages:{topic}": str(count) for topic, count in counts.items()}
        return self

    def write(self, path: Path, old_seal: bool = False, writer: type[ContainerWriter] = ContainerWriter) -> Path:
        """Write the content as a log; raises UnicodeEncodeError for text that no record can hold.

        The seal and the digests by name are made anew, or stay as they were (``old_seal``).
        """
        path.unlink(missing_ok=True)
        file = writer(path)
        try:
            for name, entries in self.metadata.items():
                if name != CLOSING:
                    file.metadata(name, entries)
            for name, content in self.attachments.items():
                file.attachment(name, content)
            for number, (topic, described, about) in self.channels.items():
                file.channel(number, topic, described.name, described.data, about)
            for piece in self.chunks:
                file.chunk(piece)
            if CLOSING in self.metadata:
                closing = self.metadata[CLOSING]
                if SEAL in closing and not old_seal:
                    kept = {key: value for key, value in closing.items() if not key.startswith(("content:", SEAL))}
                    closing = sealed(kept | {f"content:{name}": digest for name, digest in file.contents.items()})
                file.metadata(CLOSING, closing)
            file.finish()
        finally:
            file.close()
        return path


def change_bytes(data: bytes, chance: random.Random) -> bytes:
    """Data with a few bytes flipped, cut out, inserted or duplicated, or with its end cut off."""
    changed = bytearray(data)
    for _ in range(chance.choice((1, 1, 1, 3, 20))):
        start = chance.randrange(len(changed))
        length = min(chance.choice((1, 4, 8, 100, 5000)), len(changed) - start)
        match chance.randrange(6):
            case 0:
                changed[start] ^= 1 << chance.randrange(8)
            case 1:
                changed[start : start + length] = chance.randbytes(length)
            case 2:
                del changed[start : start + length]
            case 3:
                changed[start:start] = chance.randbytes(length)
            case 4:
                changed[start:start] = changed[start : start + length]
            case _ if len(changed) > 1000:
                del changed[start:]
        if not changed:
            changed += b"\x89"
    return bytes(changed)


def change_content(content: Content, chance: random.Random) -> Content:
    """Content with one or two changes: an attachment, metadata, the closing record, a channel, messages."""
    altered = deepcopy(content)
    for _ in range(chance.choice((1, 1, 2))):
        match chance.randrange(7):
            case 0 | 1:
                name = chance.choice([name for name in altered.attachments if name.endswith(".json")])
                altered.attachments[name] = _json(altered.attachments[name], chance)
            case 2:
                number = chance.choice(list(altered.channels))
                _, _, about = altered.channels[number]
                key = chance.choice(list(about))
                about[key] = _json(about[key].encode(), chance).decode("utf-8", "replace")
            case 3:
                number = chance.choice(list(altered.channels))
                topic = chance.choice(("", "/", "/../../evil/out", "x" * 5000, "/chain/out", "\x00", "/a/b/c"))
                altered.channels[number] = (topic, *altered.channels[number][1:])
            case 4:
                _, rows, _ = chance.choice(chance.choice(altered.chunks))
                rows.flags.writeable = True
                for row in rows[chance.randrange(len(rows)) :][: chance.choice((1, 1, 1000))]:
                    start = chance.choice((11, PREFIX + 1, PREFIX + 10, PREFIX + chance.randrange(len(row) - PREFIX)))
                    row[start : start + 8] = list(chance.choice(WORDS))[: len(row) - start]
            case _:
                entries = altered.metadata[chance.choice((CLOSING, CLOSING, chance.choice(list(altered.metadata))))]
                key = chance.choice(list(entries))
                if chance.randrange(4):
                    entries[key] = _text(chance)
                else:
                    del entries[key]
    if not chance.randrange(5):
        name = chance.choice(list(altered.attachments))
        altered.attachments[chance.choice(("../../evil", "/tmp/evil", ""))] = altered.attachments.pop(name)
    return altered


def _text(chance: random.Random) -> str:
    value = chance.choice(VALUES)
    text = value if isinstance(value, str) else json.dumps(value)
    return text.encode("utf-8", "replace").decode()[:60_000]


def _json(content: bytes, chance: random.Random) -> bytes:
    """A JSON text with one value replaced or left out, or invalid JSON."""
    if not chance.randrange(5):
        cut = chance.randrange(len(content)) if content else 0
        return chance.choice((*TEXTS, content[:cut], content[:cut] + b"\xff" + content[cut:]))
    try:
        table = json.loads(content)
    except ValueError:
        return chance.choice(TEXTS)
    places = list(_places(table))
    if not places:
        return chance.choice(TEXTS)
    holder, key = chance.choice(places)
    if chance.randrange(4):
        holder[key] = chance.choice(VALUES)
    else:
        del holder[key]
    return json.dumps(table).encode()


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Yield every (dict, key) and (list, index) within a JSON value."""
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in entries:
        yield value, key
        yield from _places(inner)
