"""The saved state of a slave (fmi2FMUstate), and its bytes: a JSON head, then the arrays; a checksum guards them."""

from __future__ import annotations

import json
import zlib
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Saved(NamedTuple):
    """Everything that changes during a run; ``flaw`` tells why the bytes it was read from are unusable."""

    guid: str
    phase: str
    flags: tuple[bool, bool]  # outputs stale (parameters changed), link outputs stale
    failure: str
    strings: tuple[str, ...]
    values: NDArray[np.float64]  # all Reals, among them inputs and outputs
    integers: NDArray[np.int64]
    state: NDArray[np.float64]
    counters: NDArray[np.int64]
    flaw: str = ""


def to_bytes(state: Saved) -> bytes:
    """Length of the head (8 bytes, little-endian), head, arrays; of an unusable state its flaw."""
    if state.flaw:
        return state.flaw.encode()
    arrays = state[5:9]
    body = b"".join(a.tobytes() for a in arrays)
    head = json.dumps([*state[:5], [a.size for a in arrays], zlib.crc32(body)]).encode()
    return len(head).to_bytes(8, "little") + head + body


def from_bytes(content: bytes) -> Saved:
    """The state of `to_bytes`. Nothing is raised, because no instance could be pinned here: see ``Saved.flaw``."""
    try:
        end = 8 + int.from_bytes(content[:8], "little")
        guid, phase, flags, failure, strings, sizes, checksum = json.loads(content[8:end])
        if zlib.crc32(content[end:]) != checksum:
            raise ValueError("the checksum does not hold")
        arrays: list[Any] = []
        for size, kind in zip(sizes, (np.float64, np.int64, np.float64, np.int64), strict=True):
            arrays.append(np.frombuffer(content, dtype=kind, count=size, offset=end).copy())
            end += 8 * size
        return Saved(guid, phase, (flags[0], flags[1]), failure, tuple(strings), *arrays)
    except Exception as error:
        none = np.zeros(0)
        flaw = f"these bytes are not a saved state ({type(error).__name__}: {error})"
        return Saved("", "", (True, True), "", (), none, none.astype(int), none, none.astype(int), flaw)
