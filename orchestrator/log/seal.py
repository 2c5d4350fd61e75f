"""Seal of a log: digest of its closing record, which has a digest of every other content by name.

Names are "attachment:NAME", "metadata:NAME", "channel:TOPIC" and "messages:/events"; messages of all other topics have
their sha256. Places in the file do not count: a log that other software has sorted, compressed anew or merged has the
same contents. Damage is found by the checksums of MCAP. Logs made until 2026-11-29 have digests by name at
most, not the seal; the hash tree over bytes that they have instead is not read.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Set

import numpy as np
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from orchestrator.log.message_records import IDENTITY

SEAL = "seal"  # entry of the closing record
TREE = "RFC 6962, SHA-256"  # this entry in logs with a hash tree, and name of the record that holds it: SEAL
_WORDS = {
    "attachment": "the attachment '{}'", "metadata": "the record '{}'", "channel": "the description of {}",
    "messages": "the text of {}", "sha256": "the record of {}",
}  # fmt: skip


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


def sealed(closing: Mapping[str, str]) -> dict[str, str]:
    """Closing record with its seal."""
    return {**closing, SEAL: metadata_digest(closing)}


def holds(closing: Mapping[str, str]) -> bool:
    """Whether the closing record is as it was sealed; True without a seal."""
    rest = {key: value for key, value in closing.items() if key != SEAL}
    return closing.get(SEAL, TREE) in (TREE, metadata_digest(rest))


def changes(listed: Mapping[str, str], found: Mapping[str, str], unused: Set[str]) -> Iterator[str]:
    """Yield in words what of the digests ``listed`` in a closing record is not ``found``, and what is added.

    ``unused``: names that may be missing: descriptions of topics without messages.
    """
    for name in [*listed, *(found.keys() - listed.keys())]:
        if found.get(name) != listed.get(name) and not (name in unused and name not in found):
            kind, _, which = name.partition(":")
            what = "missing" if name not in found else "changed" if name in listed else "added"
            yield f"{_WORDS[kind].format(which[:80])} is {what}"
