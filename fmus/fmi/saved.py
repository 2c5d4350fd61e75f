"""Saved state of a slave (fmi2FMUstate), and its serialisation: a checksum, a JSON head, the arrays."""

from __future__ import annotations

import json
import zlib
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.fmi.phases import InstancePhase


class SlaveState(NamedTuple):
    """Everything that changes during a run; ``flaw``: why the bytes from which it was read are unusable."""

    guid: str  # of the FMU
    phase: int  # see ``phases.InstancePhase``
    now: float  # end of the last step, s; NaN: not known
    flags: tuple[bool, bool]  # outputs stale (parameters changed), link outputs stale
    strings: tuple[str, ...]  # String parameters
    values: NDArray[np.float64]  # all Reals, among them inputs and outputs
    integers: NDArray[np.int64]  # status, then the Integer parameters
    state: NDArray[np.float64]  # flat state of the model
    counters: NDArray[np.int64]  # of the model
    flaw: str = ""


def to_bytes(state: SlaveState) -> bytes:
    """Bytes of a state: checksum of the rest and length of the head (4 bytes each), head, arrays; or its flaw."""
    if state.flaw:
        return state.flaw.encode()
    arrays = state[5:9]
    head = json.dumps([*state[:5], [a.size for a in arrays]]).encode()
    content = len(head).to_bytes(4, "little") + head + b"".join(a.tobytes() for a in arrays)
    return zlib.crc32(content).to_bytes(4, "little") + content


def from_bytes(content: bytes) -> SlaveState:
    """State from the bytes of `to_bytes`; a state with a ``flaw`` where they are damaged.

    Nothing is raised: pythonfmu would release references that are not its own (see ``fmi.slave``), and no instance is
    known here that could be given more of them.
    """
    try:
        checksum, length = (int.from_bytes(content[at : at + 4], "little") for at in (0, 4))
        if zlib.crc32(content[4:]) != checksum:
            raise ValueError("the checksum does not hold")
        end = 8 + length
        guid, phase, now, (stale, links_stale), strings, sizes = json.loads(content[8:end])
        head = (guid, *strings), (phase,), (now,), (stale, links_stale)
        if not all(type(each) is kind for row, kind in zip(head, (str, int, float, bool), strict=True) for each in row):
            raise ValueError("a value has the wrong type")
        if stale and phase > InstancePhase.INITIALISING:
            raise ValueError("it runs without a start")
        arrays: list[Any] = []
        for size, kind in zip(sizes, (np.float64, np.int64, np.float64, np.int64), strict=True):
            arrays.append(np.frombuffer(content, dtype=kind, count=size, offset=end).copy())
            end += 8 * size
        return SlaveState(guid, InstancePhase(phase), now, (stale, links_stale), tuple(strings), *arrays)
    except Exception as error:
        none = np.zeros(0)
        flaw = f"these bytes are not a saved state ({type(error).__name__}: {error})"
        return SlaveState("", 0, 0.0, (True, True), (), none, none.astype(int), none, none.astype(int), flaw)
