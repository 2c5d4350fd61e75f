"""Closing record of a log: status, results and warnings of the run, count and sha256 of each topic.

A log without it was cut off. MCAP metadata hold texts only: ``encode`` encodes the record, ``decode`` decodes it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.log import seal
from orchestrator.log.message_records import MOST_STEPS

NAME = "closing"  # of the metadata record
_WARNED = {"component": str, "text": str, "time": float, "count": int}  # ``ComponentWarning``


def encode(
    status: str,
    message: str,
    steps: int,
    topics: Mapping[str, tuple[int, str]],
    results: Mapping[str, str],
    warnings: Sequence[Mapping[str, object]],
    contents: Mapping[str, str],
) -> dict[str, str]:
    """Return the record as texts; ``topics``: topic -> (number of messages, sha256). A seal must follow it.

    ``contents``: digests by name (``content_digest``).
    """
    record = {"status": status, "message": message, "steps": str(steps)}
    for topic, (messages, sha256) in topics.items():
        record |= {f"messages:{topic}": str(messages), f"sha256:{topic}": sha256}
    record |= {f"result:{name}": text for name, text in results.items()}
    record |= {f"content:{name}": digest for name, digest in contents.items()}
    return record | {"warnings": json.dumps(list(warnings)), "seal": seal.ALGORITHM}


def decode(record: Mapping[str, str]) -> dict[str, Any]:
    """Decode a closing record: numbers as int, and one dict by topic for messages, sha256 and results.

    Raises ValueError, RecursionError.
    """
    by_topic = {
        kind: {key.partition(":")[2]: value for key, value in record.items() if key.startswith(f"{kind}:")}
        for kind in ("messages", "sha256", "result", "content")
    }
    return {
        "status": record.get("status", ""),
        "message": record.get("message", ""),
        "steps": int(record.get("steps", 0)),
        "messages": {topic: int(value) for topic, value in by_topic["messages"].items()},
        "sha256": by_topic["sha256"],
        "results": by_topic["result"],
        "contents": by_topic["content"],
        "warnings": _warnings(record.get("warnings", "[]")),
        "seal": record.get("seal", ""),
    }


def _warnings(text: str) -> list[dict[str, Any]]:
    entries = json.loads(text)
    if not isinstance(entries, list):
        raise ValueError("warnings are no list")
    for entry in entries:
        if not isinstance(entry, dict) or {key: type(value) for key, value in entry.items()} != _WARNED:
            raise ValueError("a warning does not consist of component, text, time and count")
        if not 0 < entry["count"] <= MOST_STEPS:
            raise ValueError("the count of a warning is out of range")
        f"{entry['component']}{entry['text']}".encode()  # ValueError for half a surrogate pair, which JSON allows
    return entries
