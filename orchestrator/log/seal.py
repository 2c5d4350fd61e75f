"""Seal of a log: root of a hash tree over every byte before the seal record (RFC 6962, section 2.1, with SHA-256).

A leaf is a record with its opcode and length; message indexes belong to the leaf of their chunk, and the magic bytes at
the beginning of the file to the first leaf. The seal record, metadata ``seal``, is the last record of the data and
holds the root and, so that a part can be checked alone, offset and hash of every leaf.

Digests of contents apart from their places in the file are in the closing record by name: "attachment:NAME",
"metadata:NAME", "channel:TOPIC", and "messages:/events" beside the digests of all other topics. A file that other
software has sorted, compressed anew or merged has other bytes, and the same contents.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from orchestrator.log.message_records import IDENTITY

NAME = "seal"  # of the metadata record
ALGORITHM = "RFC 6962, SHA-256"  # in the closing record: the log must have a seal
_LEAF, _NODE = b"\0", b"\1"  # so that no inner node passes for a leaf


class Seal(NamedTuple):
    """Root of the tree, and offset and hash of each leaf."""

    root: str
    offsets: tuple[int, ...]
    leaves: tuple[bytes, ...]


def leaf_hash(parts: Iterable[bytes | bytearray | memoryview]) -> bytes:
    """Return the hash of a leaf that consists of ``parts``."""
    digest = hashlib.sha256(_LEAF)
    for part in parts:
        digest.update(part)
    return digest.digest()


def root_of(leaves: Sequence[bytes]) -> str:
    """Return the root of a tree of at least one leaf."""
    level = list(leaves)
    while len(level) > 1:
        pairs = zip(level[::2], level[1::2], strict=False)
        level = [hashlib.sha256(_NODE + left + right).digest() for left, right in pairs] + level[len(level) & ~1 :]
    return level[0].hex()


def encode(offsets: Sequence[int], leaves: Sequence[bytes]) -> dict[str, str]:
    """Return the seal record as texts: the root, and a line of offset and hash for each leaf."""
    lines = (f"{offset} {leaf.hex()}" for offset, leaf in zip(offsets, leaves, strict=True))
    return {"root": root_of(leaves), "leaves": "\n".join(lines)}


def decode(record: Mapping[str, str], most: int) -> Seal:
    """Decode a seal record of ``most`` leaves at most; raises LookupError, ValueError."""
    if record["leaves"].count("\n") >= most:
        raise ValueError(f"the seal has more than {most} leaves")
    lines = [line.split(" ") for line in record["leaves"].split("\n")]
    offsets, leaves = tuple(int(line[0]) for line in lines), tuple(bytes.fromhex(line[1]) for line in lines)
    if offsets[0] != 0 or any(after <= before for before, after in pairwise(offsets)):
        raise ValueError("the leaves of the seal are not in order")
    if root_of(leaves) != record["root"]:
        raise ValueError("the leaves of the seal do not give its root")
    return Seal(record["root"], offsets, leaves)


def attachment_digest(content: bytes) -> str:
    """Digest of an attached file."""
    return hashlib.sha256(content).hexdigest()


def metadata_digest(entries: Mapping[str, str]) -> str:
    """Digest of a metadata record, in whatever order its entries are."""
    return hashlib.sha256(json.dumps(entries, sort_keys=True).encode()).hexdigest()


def messages_digest(parts: Iterable[NDArray[np.uint8]]) -> str:
    """Digest of message records (m, bytes) of one topic, whatever the number of its channel is."""
    digest = hashlib.sha256()
    for rows in parts:
        digest.update(np.ascontiguousarray(rows[:, IDENTITY:]).data)
    return digest.hexdigest()


def channel_digest(channel: Channel, schema: Schema | None) -> str:
    """Digest of the description of a topic, whatever its number in the file is."""
    kind = [] if schema is None else [schema.name, schema.encoding, schema.data.hex()]
    about = [channel.topic, channel.message_encoding, sorted(channel.metadata.items()), kind]
    return hashlib.sha256(json.dumps(about).encode()).hexdigest()
