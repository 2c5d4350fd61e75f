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
Maker = Callable[[Path, Path], Path]  # small log, file -> file


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


class Added(ContainerWriter):
    """Writer of a log with further bytes before its channels: ``chunks`` are listed in its index, ``records`` not."""

    chunks: Iterator[bytes] = iter(())
    records = b""

    def channel(self, *about: object, **more: object) -> None:
        """Write the further bytes, then the channel."""
        for one in self.chunks:
            offset, size = self.size, int.from_bytes(one[25:33], "little")
            self._append(one)
            index = ChunkIndex(len(one), offset, "zstd", len(one), 10**9, 0, {}, 0, size)
            self._indexed[Opcode.CHUNK_INDEX].append(index)
        self._append(type(self).records)
        type(self).records = b""
        super().channel(*about, **more)


def log_with(small: Path, path: Path, *chunks: bytes, records: bytes = b"") -> Path:
    """Write the log ``small`` again with further chunks, and records that no index lists."""
    return Content(small).write(path, writer=type("Written", (Added,), {"chunks": iter(chunks), "records": records}))


def listed(make: Callable[[], list[bytes]]) -> Maker:
    return lambda small, path: log_with(small, path, *make())


def unlisted(make: Callable[[], bytes]) -> Maker:
    return lambda small, path: log_with(small, path, records=make())


def edited(change: Callable[[Content], object]) -> Maker:
    """A log with another content, which ``change`` alters."""

    def make(small: Path, path: Path) -> Path:
        content = Content(small)
        change(content)
        return content.write(path)

    return make


def attachments() -> bytes:
    body = bytes(16) + text("a") + text("b") + bytes(8)
    return record(Opcode.ATTACHMENT, body + struct.pack("<I", crc32(body))) * 300_000


def channels() -> bytes:
    """200,000 channels of 60,000 numbers."""
    heads = (struct.pack("<HH", 1000 + number % 60_000, 0) + text(f"/t{number}/out") for number in range(200_000))
    return b"".join(record(Opcode.CHANNEL, head + text("protobuf") + bytes(4)) for head in heads)


def rename(content: Content) -> None:
    """Let each channel have 300,000 variables."""
    numbers = range(300_000)
    names, places = json.dumps([f"x{k}" for k in numbers]), json.dumps([[f"x{k}"] for k in numbers])
    for _, _, about in content.channels.values():
        about.update({"names": names, "units": json.dumps(["m"] * len(numbers)), "places": places})


def lie() -> list[bytes]:
    """A chunk that declares 64 bytes and unpacks to 1 GB."""
    one = chunk(bytes(ZEROS), 1000)
    return [one[:25] + struct.pack("<Q", 64) + one[33:]]


def sparse(path: Path, head: bytes = b"", size: int = 100 << 30) -> Path:
    """A file of 100 GB, all of it a hole behind its ``head``."""
    with path.open("wb") as stream:
        stream.write(head)
        stream.truncate(size)
    return path


HEAD = MCAP0_MAGIC + struct.pack("<BQII", Opcode.HEADER, 8, 0, 0)


def sparse_attachment(small: Path, path: Path) -> Path:
    """A log of 100 GB with one attachment, a hole."""
    return sparse(path, HEAD + struct.pack("<BQ", Opcode.ATTACHMENT, (100 << 30) - 1000))


def damaged_index(small: Path, path: Path) -> Path:
    """A log of 20,000 records of an unknown kind, each listed in the summary."""
    offsets = range(len(HEAD), len(HEAD) + 9 * 20_000, 9)
    indexes = b"".join(struct.pack("<BQQQI", Opcode.METADATA_INDEX, 20, at, 9, 0) for at in offsets)
    data = HEAD + EMPTY * 20_000 + struct.pack("<BQI", Opcode.DATA_END, 4, 0)
    footer = struct.pack("<BQQQI", Opcode.FOOTER, 20, len(data), 0, 0)
    path.write_bytes(data + indexes + footer + MCAP0_MAGIC)
    return path


many_metadata = unlisted(lambda: record(Opcode.METADATA, text("x") + bytes(4)) * 400_000)
many_attachments, many_channels = unlisted(attachments), unlisted(channels)
many_schemas = unlisted(lambda: record(Opcode.SCHEMA, b"\7\0" + text("a") + text("b") + bytes(4)) * 400_000)
indexed_metadata = edited(lambda content: content.metadata.update({f"m{k}": {"a": "b"} for k in range(200_000)}))
many_names = edited(rename)
empty_records = listed(lambda: [chunk(EMPTY * 100_000, 1000)])  # 1e8 in a chunk
OTHER = MESSAGE.replace(struct.pack("<H", 999), struct.pack("<H", 998))
lone_messages = listed(lambda: [chunk((MESSAGE + OTHER) * 25_000, 100)])  # 5e6, each of another channel than the last
many_large_chunks = listed(lambda: [chunk(bytes(ZEROS), 60)] * 300)  # each is allowed, not all of them
DEEP = b'{"a":' * 100_000 + b"1" + b"}" * 100_000
LARGE = b'{"a":[' + b"[]," * 10_000_000 + b"[]]}"

LOGS: tuple[Maker, ...] = (
    empty_records, lone_messages, listed(lambda: [chunk(bytes(ZEROS), 1000)]), many_large_chunks, listed(lie),
    listed(lambda: [chunk(EMPTY, 1) * 50_000]), sparse_attachment, damaged_index,
    edited(lambda content: content.attachments.update({"scene.json": DEEP})),
    edited(lambda content: content.attachments.update({"scene.json": LARGE})),
    many_metadata, many_attachments, many_schemas, many_channels, indexed_metadata, many_names,
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


TEXTS: dict[str, Callable[[], str]] = {
    "many rows": lambda: "\n".join(f"{i},1" for i in range(1_000_000)),
    "as many rows as allowed": lambda: "\n".join(f"{i},1" for i in range(50_000)),
    "long row": lambda: ",".join(["1"] * 5_000_000),
    "open quote": lambda: '0,1\n"' + "1\n" * 5_000_000,
    "as many lines as measured": lambda: "\n".join(f"{i},{i % 2}" for i in range(250_000)),
}
TABLES = tuple(TEXTS)[:-1]


def table(path: Path, kind: str) -> Path:
    """Write a hostile CSV file."""
    path.write_text(TEXTS[kind]())
    return path


DESCRIBED = {"large description": 900_000, "as large a description as allowed": 120_000}  # variables
RESOURCES = {"large file": (1, 1000), "many files": (60_000, 0), "many large files": (100, 40)}  # number, MB
FMUS = (*RESOURCES, *DESCRIBED, "entities")


def fmu(path: Path, kind: str) -> Path:
    """Write a hostile FMU."""
    number, size = RESOURCES.get(kind, (0, 0))
    told = "<fmiModelDescription/>"
    if kind in DESCRIBED:
        told = description('<ScalarVariable name="x" valueReference="1"><Real/></ScalarVariable>' * DESCRIBED[kind])
    elif kind == "entities":
        entities = "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 10))
        told = f'<!DOCTYPE fmiModelDescription [<!ENTITY a0 "{"a" * 100}">{entities}]>' + description("&a9;")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", told)
        for k in range(number):
            with archive.open(f"resources/{k}", "w", force_zip64=True) as stream:
                for _ in range(size):
                    stream.write(bytes(ZEROS))
    return path


def description(variables: str) -> str:
    return (
        '<fmiModelDescription fmiVersion="2.0" modelName="Toy" guid="1"><CoSimulation modelIdentifier="Toy"/>'
        f"<ModelVariables>{variables}</ModelVariables><ModelStructure/></fmiModelDescription>"
    )


def pipe(path: Path) -> Path:
    """Make a pipe that nobody writes into."""
    os.mkfifo(path)
    return path
