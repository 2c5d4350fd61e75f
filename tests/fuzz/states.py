"""Altered saved states of an FMU, with their checksums made again: each is refused, or a step from it ends in order.

A state that no run has may be restored where its sizes, indices and flags are possible; a step from it may fail
(fmi2Discard). No step may leave an array, give numbers that are not finite, or harm the instance: after each altered
state the saved one is restored, and a step from it must give the bits that it gave at first.
"""

from __future__ import annotations

import math
import random
import struct
import sys
import zlib
from collections import Counter
from pathlib import Path

from tests.fuzz.driven import DISCARD, OK, Driven, Wrong, driven_instance

STEP = 1e-3  # s
WORDS = (
    *(struct.pack("<d", x) for x in (0.0, -0.0, 1.0, -1.0, 0.5, 63.0, 64.0, 1e9, -1e9, 1e19, 1e300, 4.94e-324)),
    *(struct.pack("<d", x) for x in (math.nan, math.inf, -math.inf)),
    *(struct.pack("<q", n) for n in (1, -1, 2, 64, 1 << 20, (1 << 31) - 1, 1 << 31, (1 << 63) - 1, -(1 << 63))),
)
NOT_FOUND = ("IndexError", "MemoryError", "SystemError", "ZeroDivisionError", "TypeError", "KeyError")
_FNV = 0xCBF29CE484222325, 0x100000001B3  # FNV-1a, 64 bits (Fowler, Noll, Vo), as in instance.h


def altered(content: bytes, draw: random.Random, python: bool) -> bytes:
    """Bytes of a saved state with one to four words or bytes changed and the checksum made again."""
    changed = bytearray(content)
    first = 4 if python else 8
    arrays = 8 + int.from_bytes(content[4:8], "little") if python else 64
    for _ in range(draw.randint(1, 4)):
        word = arrays + 8 * draw.randrange((len(content) - arrays) // 8)
        match draw.randrange(4):
            case 0:
                changed[word : word + 8] = draw.choice(WORDS)
            case 1:  # a number slightly off
                value = struct.unpack_from("<d", changed, word)[0]
                struct.pack_into("<d", changed, word, value * (1.0 + draw.choice((1e-12, 1e-6, 1e-3, 0.5))))
            case 2:  # the number of another place
                other = arrays + 8 * draw.randrange((len(content) - arrays) // 8)
                changed[word : word + 8] = content[other : other + 8]
            case _:
                changed[draw.randrange(first, len(content))] ^= 1 << draw.randrange(8)
    checksum = zlib.crc32(changed[4:]) if python else _fnv(changed[8:])
    changed[:first] = checksum.to_bytes(first, "little")
    return bytes(changed)


def _fnv(content: bytes | bytearray) -> int:
    value = _FNV[0]
    for byte in content:
        value = (value ^ byte) * _FNV[1] & 0xFFFFFFFFFFFFFFFF
    return value


def run(fmu: Path, seed: int, count: int) -> Counter[str]:
    """Restore altered states and step from each; number of refused, discarded and done ones. Raises Wrong."""
    draw, driven, outcomes = random.Random(seed), driven_instance(fmu), Counter[str]()
    try:
        times = None if driven.fmi == 2 else (0.0, math.nan)
        for name, argument in (("enter", times), ("exit", None), *(("step", (k * STEP, STEP)) for k in range(3))):
            if driven.do(name, argument) != OK:
                raise Wrong(f"{fmu.name}: {name} failed: {driven.messages}")
        driven.do("save", None)
        content = driven.serialised(0)
        first = _step(driven)
        for number in range(count):
            driven.messages.clear()
            outcomes[_attempt(driven, altered(content, draw, driven.python))] += 1
            broken = [text for text in driven.messages if text.startswith(NOT_FOUND)]
            if broken or driven.do("restore", 0) != OK or _step(driven) != first:
                what = broken or driven.messages[-1:] or "another step"
                raise Wrong(f"{fmu.name}, seed {seed}, state {number}: {what}")
    finally:
        driven.close()
    return outcomes


def _step(driven: Driven) -> bytes:
    """Outputs after a step from the saved time."""
    if driven.do("step", (3 * STEP, STEP)) != OK:
        raise Wrong(f"the step from the saved state failed: {driven.messages}")
    return driven.shown()


def _attempt(driven: Driven, content: bytes) -> str:
    status = driven.restore(content)
    if status != OK:
        if status != driven.refused or not driven.messages:
            raise Wrong(f"an altered state is refused with status {status}: {driven.messages}")
        return "refused"
    status = driven.do("step", (3 * STEP, STEP))
    if status == OK:
        driven.shown()
        return "done"
    return "discarded" if status == DISCARD else "step refused"


def main() -> None:
    """Run altered states of an FMU: ``python -m tests.fuzz.states FMU COUNT``."""
    print(dict(run(Path(sys.argv[1]), 2, int(sys.argv[2]))))


if __name__ == "__main__":
    main()
