"""Damaged logs: bytes flipped, cut or inserted; content of a log, to be changed and written with right checksums."""

import hashlib
import json
import random
from pathlib import Path
from typing import Self

import numpy as np
from mcap.reader import make_reader

from orchestrator.log.container_writer import ContainerWriter
from orchestrator.log.log_metadata import CLOSING
from orchestrator.log.message_records import PREFIX
from orchestrator.log.reader import Log
from orchestrator.log.seal import SEAL, sealed


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


def altered(log, path, change):
    """The log with another system.json and scene.json; all checksums are valid."""
    content = Content(log)
    tables = {name: json.loads(content.attachments[f"{name}.json"]) for name in ("system", "scene")}
    change(**tables)
    content.attachments |= {f"{name}.json": json.dumps(table).encode() for name, table in tables.items()}
    return content.write(path)
