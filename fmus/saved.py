"""Saved state of a slave (fmi2FMUstate), and its serialisation: a JSON head, the arrays, a checksum."""

from __future__ import annotations

import json
import zlib
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class SlaveState(NamedTuple):
    """Everything that changes during a run; ``flaw``: why the bytes from which it was read are unusable."""

    guid: str  # of the FMU
    phase: str  # "instantiated", "initialising" or "running"
    flags: tuple[bool, bool]  # outputs stale (parameters changed), link outputs stale
    failure: str  # sentence of a failed call; empty if none failed
    strings: tuple[str, ...]  # String parameters
    values: NDArray[np.float64]  # all Reals, among them inputs and outputs
    integers: NDArray[np.int64]  # status, then the Integer parameters
    state: NDArray[np.float64]  # flat state of the model
    counters: NDArray[np.int64]  # of the model
    flaw: str = ""


def to_bytes(state: SlaveState) -> bytes:
    """Bytes of a state: length of the head (8 bytes, little-endian), head, arrays; or its flaw, if any."""
    if state.flaw:
        return state.flaw.encode()
    arrays = state[5:9]
    body = b"".join(a.tobytes() for a in arrays)
    head = json.dumps([*state[:5], [a.size for a in arrays], zlib.crc32(body)]).encode()
    return len(head).to_bytes(8, "little") + head + body


def from_bytes(content: bytes) -> SlaveState:
    """State from the bytes of `to_bytes`; a state with a ``flaw`` where they are damaged.

    Nothing is raised: pythonfmu would release references that are not its own (see ``fmus.slave``), and no instance is
    known here that could be given more of them.
    """
    try:
        end = 8 + int.from_bytes(content[:8], "little")
        guid, phase, flags, failure, strings, sizes, checksum = json.loads(content[8:end])
        if zlib.crc32(content[end:]) != checksum:
            raise ValueError("the checksum does not hold")
        arrays: list[Any] = []
        for size, kind in zip(sizes, (np.float64, np.int64, np.float64, np.int64), strict=True):
            arrays.append(np.frombuffer(content, dtype=kind, count=size, offset=end).copy())
            end += 8 * size
        return SlaveState(guid, phase, (flags[0], flags[1]), failure, tuple(strings), *arrays)
    except Exception as error:
        none = np.zeros(0)
        flaw = f"these bytes are not a saved state ({type(error).__name__}: {error})"
        return SlaveState("", "", (True, True), "", (), none, none.astype(int), none, none.astype(int), flaw)
