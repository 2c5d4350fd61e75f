"""Digests of the contents of a log apart from their places in the file: what other software may keep in a rewrite.

The closing record has them by name: "attachment:NAME", "metadata:NAME", "channel:TOPIC", and "messages:/events" beside
the digests of all other topics. A file that has been sorted, compressed anew or merged has other bytes, and the same
contents.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping

import numpy as np
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from orchestrator.log.message_records import IDENTITY


def of_attachment(content: bytes) -> str:
    """Digest of an attached file."""
    return hashlib.sha256(content).hexdigest()


def of_metadata(entries: Mapping[str, str]) -> str:
    """Digest of a metadata record, in whatever order its entries are."""
    return hashlib.sha256(json.dumps(entries, sort_keys=True).encode()).hexdigest()


def of_messages(parts: Iterable[NDArray[np.uint8]]) -> str:
    """Digest of message records (m, bytes) of one topic, whatever the number of its channel is."""
    digest = hashlib.sha256()
    for rows in parts:
        digest.update(np.ascontiguousarray(rows[:, IDENTITY:]).data)
    return digest.hexdigest()


def of_channel(channel: Channel, schema: Schema | None) -> str:
    """Digest of the description of a topic, whatever its number in the file is."""
    kind = [] if schema is None else [schema.name, schema.encoding, schema.data.hex()]
    about = [channel.topic, channel.message_encoding, sorted(channel.metadata.items()), kind]
    return hashlib.sha256(json.dumps(about).encode()).hexdigest()
