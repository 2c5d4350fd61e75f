"""Hostile files: small on the disk, large when they are unpacked, parsed or read; and things that are no files."""

import json
import os
import struct
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import zstandard
from isal.isal_zlib import crc32
from mcap.opcode import Opcode
from mcap.records import ChunkIndex
from mcap.writer import MCAP0_MAGIC
from mutated import Content

from orchestrator.log.container_writer import ContainerWriter

EMPTY = struct.pack("<BQ", 0x80, 0)  # a record without content, of a private kind
MESSAGE = struct.pack("<BQHIQQ", Opcode.MESSAGE, 22, 999, 0, 0, 0)  # of a channel that no log has
ZEROS = 1 << 20


def record(kind: int, body: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(body)) + body


def text(content: str) -> bytes:
    return struct.pack("<I", len(content)) + content.encode()


def frames(piece: bytes, count: int) -> bytes:
    """Return one zstd frame that unpacks to ``piece``, ``count`` times, made piece by piece."""
    packer = zstandard.ZstdCompressor(3).compressobj(size=len(piece) * count)
    return b"".join([packer.compress(piece) for _ in range(count)] + [packer.flush()])


def checksum(piece: bytes, count: int) -> int:
    crc = 0
    for _ in range(count):
        crc = crc32(piece, crc)
    return crc


def chunk(piece: bytes, count: int) -> bytes:
    """Return a chunk record with a right checksum whose content is ``piece``, ``count`` times."""
    packed = frames(piece, count)
    body = struct.pack("<QQQII", 0, 10**9, len(piece) * count, checksum(piece, count), 4) + b"zstd"
    body += struct.pack("<Q", len(packed)) + packed
    return record(Opcode.CHUNK, body)


class With(ContainerWriter):
    """Writer of a log with further records behind its attachments."""

    extra: Iterator[bytes] = iter(())

    def channel(self, *about: object, **more: object) -> None:
        """Write the further records, then the channel."""
        for record in self.extra:
            offset, size = self.size, int.from_bytes(record[25:33], "little")
            self._append(record)
            index = ChunkIndex(len(record), offset, "zstd", len(record), 10**9, 0, {}, 0, size)
            self._indexed[Opcode.CHUNK_INDEX].append(index)
        super().channel(*about, **more)


def log_with(small: Path, path: Path, *records: bytes) -> Path:
    """Write the log ``small`` again with further records."""
    content = Content(small)
    return content.write(path, writer=type("Written", (With,), {"extra": iter(records)}))


class Before(ContainerWriter):
    """Writer of a log with further bytes before its channels, which no index lists."""

    extra = b""

    def channel(self, *about: object, **more: object) -> None:
        """Write the further bytes, then the channel."""
        self._append(self.extra)
        type(self).extra = b""
        super().channel(*about, **more)


def log_with_records(small: Path, path: Path, records: bytes) -> Path:
    return Content(small).write(path, writer=type("Written", (Before,), {"extra": records}))


def many_metadata(small: Path, path: Path) -> Path:
    """400,000 metadata records without entries."""
    return log_with_records(small, path, record(Opcode.METADATA, text("x") + bytes(4)) * 400_000)


def many_attachments(small: Path, path: Path) -> Path:
    """300,000 empty attachments."""
    body = bytes(16) + text("a") + text("b") + bytes(8)
    return log_with_records(small, path, record(Opcode.ATTACHMENT, body + struct.pack("<I", crc32(body))) * 300_000)


def many_schemas(small: Path, path: Path) -> Path:
    """400,000 schemas of one number."""
    body = struct.pack("<H", 7) + text("a") + text("b") + bytes(4)
    return log_with_records(small, path, record(Opcode.SCHEMA, body) * 400_000)


def many_channels(small: Path, path: Path) -> Path:
    """200,000 channels of 60,000 numbers."""
    heads = (struct.pack("<HH", 1000 + number % 60_000, 0) + text(f"/t{number}/out") for number in range(200_000))
    records = (record(Opcode.CHANNEL, head + text("protobuf") + bytes(4)) for head in heads)
    return log_with_records(small, path, b"".join(records))


def indexed_metadata(small: Path, path: Path) -> Path:
    """200,000 metadata records that the summary lists."""
    content = Content(small)
    content.metadata.update({f"m{number}": {"a": "b"} for number in range(200_000)})
    return content.write(path)


def many_names(small: Path, path: Path) -> Path:
    """Channels of 300,000 variables each."""
    content, numbers = Content(small), range(300_000)
    names, places = json.dumps([f"x{k}" for k in numbers]), json.dumps([[f"x{k}"] for k in numbers])
    for _, _, about in content.channels.values():
        about.update({"names": names, "units": json.dumps(["m"] * len(numbers)), "places": places})
    return content.write(path)


def empty_records(small: Path, path: Path) -> Path:
    """A chunk of 1e8 empty records."""
    return log_with(small, path, chunk(EMPTY * 100_000, 1000))


def lone_messages(small: Path, path: Path) -> Path:
    """A chunk of 5e6 messages, each of another channel than the one before it."""
    pair = MESSAGE + MESSAGE.replace(struct.pack("<H", 999), struct.pack("<H", 998))
    return log_with(small, path, chunk(pair * 25_000, 100))


def large_chunk(small: Path, path: Path) -> Path:
    """A chunk of 1 GB of zeros."""
    return log_with(small, path, chunk(bytes(ZEROS), 1000))


def many_large_chunks(small: Path, path: Path) -> Path:
    """300 chunks of 60 MB: each is allowed, not all of them."""
    return log_with(small, path, *[chunk(bytes(ZEROS), 60)] * 300)


def lying_chunk(small: Path, path: Path) -> Path:
    """A chunk that declares 64 bytes and unpacks to 1 GB."""
    record = bytearray(chunk(bytes(ZEROS), 1000))
    record[25:33] = struct.pack("<Q", 64)
    return log_with(small, path, bytes(record))


def many_chunks(small: Path, path: Path) -> Path:
    """50,000 chunks of a few bytes."""
    return log_with(small, path, chunk(EMPTY, 1) * 50_000)


def sparse(path: Path, head: bytes = b"", size: int = 100 << 30) -> Path:
    """A file of 100 GB, all of it a hole behind its ``head``."""
    with path.open("wb") as stream:
        stream.write(head)
        stream.truncate(size)
    return path


def sparse_attachment(small: Path, path: Path) -> Path:
    """A log of 100 GB with one attachment, a hole."""
    head = MCAP0_MAGIC + struct.pack("<BQII", Opcode.HEADER, 8, 0, 0)
    return sparse(path, head + struct.pack("<BQ", Opcode.ATTACHMENT, (100 << 30) - 1000))


def damaged_index(small: Path, path: Path) -> Path:
    """A log of 20,000 records of an unknown kind, each listed in the summary."""
    head = MCAP0_MAGIC + struct.pack("<BQII", Opcode.HEADER, 8, 0, 0)
    offsets = range(len(head), len(head) + 9 * 20_000, 9)
    entry = "<BQ" + "QQI"
    indexes = b"".join(struct.pack(entry, Opcode.METADATA_INDEX, 20, at, 9, 0) for at in offsets)
    data = head + EMPTY * 20_000
    end = struct.pack("<BQI", Opcode.DATA_END, 4, 0)
    footer = struct.pack("<BQQQI", Opcode.FOOTER, 20, len(data) + len(end), 0, 0)
    path.write_bytes(data + end + indexes + footer + MCAP0_MAGIC)
    return path


def deep_json(small: Path, path: Path) -> Path:
    """A log whose scene is nested 100,000 deep."""
    content = Content(small)
    content.attachments["scene.json"] = b'{"a":' * 100_000 + b"1" + b"}" * 100_000
    return content.write(path)


def large_json(small: Path, path: Path) -> Path:
    """A log whose scene has ten million lists."""
    content = Content(small)
    content.attachments["scene.json"] = b'{"a":[' + b"[]," * 10_000_000 + b"[]]}"
    return content.write(path)


LOGS: tuple[Callable[[Path, Path], Path], ...] = (
    empty_records, lone_messages, large_chunk, many_large_chunks, lying_chunk, many_chunks, sparse_attachment,
    damaged_index, deep_json, large_json, many_metadata, many_attachments, many_schemas, many_channels,
    indexed_metadata, many_names,
)  # fmt: skip


def scene(kind: str, base: str) -> str:
    """Return a hostile TOML text; ``base``: the text of a valid file, which it follows."""
    return {
        "deep arrays": base + "\n[deep]\na = " + "[" * 100_000 + "]" * 100_000,
        "deep tables": base + "\n[deep]\na = " + "{b=" * 100_000 + "1" + "}" * 100_000,
        "long key": base + "\n[" + ".".join(["a"] * 100_000) + "]\nb = 1\n",
        "spaced key": base + "\n[" + " . ".join(["a"] * 100_000) + "]\nb = 1\n",
        "quoted key": base + "\n" + ".".join(['"a b"'] * 60_000) + " = 1\n",
        "escaped quotes": base + '\n"' + '\\"' * 250_000 + '" = 1\n',
        "as many keys as allowed": "\n".join(f"k{i}=1" for i in range(50_000)) + "\n" + base,
        "many keys": base + "\n[many]\n" + "\n".join(f"k{i}={i}" for i in range(1_000_000)),
    }[kind]


SCENES = (
    "deep arrays", "deep tables", "long key", "spaced key", "quoted key", "many keys", "escaped quotes",
    "as many keys as allowed",
)  # fmt: skip


def table(path: Path, kind: str) -> Path:
    """Write a hostile CSV file."""
    if kind == "many rows":
        path.write_text("\n".join(f"{i},1" for i in range(1_000_000)))
    elif kind == "as many rows as allowed":
        path.write_text("\n".join(f"{i},1" for i in range(50_000)))
    elif kind == "as many lines as measured":
        path.write_text("\n".join(f"{i},{i % 2}" for i in range(250_000)))
    elif kind == "long row":
        path.write_text(",".join(["1"] * 5_000_000))
    elif kind == "open quote":
        path.write_text('0,1\n"' + "1\n" * 5_000_000)
    return path


TABLES = ("many rows", "as many rows as allowed", "long row", "open quote")


DESCRIBED = {"large description": 900_000, "as large a description as allowed": 120_000}  # variables


def fmu(path: Path, kind: str) -> Path:
    """Write a hostile FMU."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription/>")
        if kind == "large file":
            with archive.open("resources/zeros", "w", force_zip64=True) as stream:
                for _ in range(1000):
                    stream.write(bytes(ZEROS))
        elif kind == "many files":
            for number in range(60_000):
                archive.writestr(f"resources/{number}", b"")
        elif kind == "many large files":
            for number in range(100):
                archive.writestr(f"resources/{number}", bytes(40 * ZEROS))
    if kind in DESCRIBED:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            entry = '<ScalarVariable name="x" valueReference="1"><Real/></ScalarVariable>' * DESCRIBED[kind]
            archive.writestr("modelDescription.xml", description(entry))
    if kind == "entities":
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            entities = "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 10))
            doctype = f'<!DOCTYPE fmiModelDescription [<!ENTITY a0 "{"a" * 100}">{entities}]>'
            archive.writestr("modelDescription.xml", doctype + description("&a9;"))
    return path


def description(variables: str) -> str:
    return (
        '<fmiModelDescription fmiVersion="2.0" modelName="Toy" guid="1"><CoSimulation modelIdentifier="Toy"/>'
        f"<ModelVariables>{variables}</ModelVariables><ModelStructure/></fmiModelDescription>"
    )


FMUS = ("large file", "many files", "many large files", *DESCRIBED, "entities")


def pipe(path: Path) -> Path:
    """Make a pipe that nobody writes into."""
    os.mkfifo(path)
    return path
