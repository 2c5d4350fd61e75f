"""File of the numbers of a native FMU, ``numbers.bin`` in its resources: start values, initial content of blocks.

Little-endian, each part a multiple of 8 bytes; read by ``numbers.h``:

| part | bytes |
| --- | --- |
| MAGIC, VERSION, length of all behind the head, its CRC-32 | 8 each |
| digest of the shape, in hexadecimal, with zeros up to | 72 |
| start values of all Reals, indices of the chosen texts of all Strings | 8 each |
| blocks x, n, k, z (``freeze``), the last one with zeros up to 8 | 8 each, 1 of z |
| number of pieces of the block f | 8 |
| of each piece: first float, number of floats, these floats; all other floats are 0 | 8 each |
| texts of the Strings without choices in UTF-8, a zero behind each; then zeros up to | 8 |

Scratch arrays, nine tenths of the block f of a track, are 0 and so are left out.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fmus.interface.ports import Port
from fmus.native.freeze import Frozen

FILE, MAGIC, VERSION = "numbers.bin", b"COTRACKN", 2
HEAD = struct.Struct("<8sQQQ72s")
TEXTS = 1 << 20  # most bytes of texts
GAP = 4  # zeros between two pieces that are worth a piece of their own: its head has two numbers


def encode(shape: str, variables: Sequence[Port], frozen: Frozen, blocks: Mapping[str, NDArray[np.generic]]) -> bytes:
    """Content of the file. ``shape``: digest; ``variables``: with their start values; ``blocks``: x and n."""
    starts = [float(port.start) for port in variables if isinstance(port.start, float)]
    choices = [_choice(port) for port in variables if isinstance(port.start, str)]
    parts = [np.array(starts), np.array(choices, dtype=np.int64), blocks["x"], blocks["n"], frozen.block("k")]
    truths = frozen.block("z").tobytes()
    row = (*(part.tobytes() for part in parts), truths, bytes(-len(truths) % 8), _pieces(frozen.block("f")))
    texts = b"".join(
        f"{port.start}\0".encode() for port in variables if isinstance(port.start, str) and not port.choices
    )
    content = b"".join((*row, texts, bytes(-len(texts) % 8)))
    return HEAD.pack(MAGIC, VERSION, len(content), zlib.crc32(content), shape.encode()) + content


def checksum(content: bytes) -> int:
    """CRC-32 of the content of a file of numbers."""
    return int(HEAD.unpack(content[: HEAD.size])[3])


def shape_of(file: Path) -> str:
    """Digest of the shape to which a file of numbers belongs; raises OSError."""
    with file.open("rb") as stream:
        return str(HEAD.unpack(stream.read(HEAD.size))[-1].rstrip(b"\0").decode())


def starts(file: Path) -> list[float]:
    """Start values of all Reals, and what else is behind them, in a file of numbers; raises OSError."""
    content = file.read_bytes()
    values: list[float] = np.frombuffer(content, "<f8", (len(content) - HEAD.size) // 8, HEAD.size).tolist()
    return values


def longest(sizes: Mapping[str, int], reals: int, strings: int) -> int:
    """Most bytes behind the head, from the lengths of the blocks."""
    pieces = sizes["f"] // GAP + 1
    return 8 * (reals + strings + sum(sizes.values()) + 2 * pieces + 2) + TEXTS


def _choice(port: Port) -> int:
    """Index of the chosen text; a constant has one."""
    free = port.causality == "parameter" and port.choices
    return port.choices.index(str(port.start)) if free else 0


def _pieces(block: NDArray[np.generic]) -> bytes:
    """Encode an array without its longer rows of zeros."""
    places = np.flatnonzero(block.view(np.int64))  # -0.0 too
    if not places.size:
        return struct.pack("<q", 0)
    breaks = np.flatnonzero(np.diff(places) > GAP)
    firsts = places[np.concatenate([[0], breaks + 1])].tolist()
    lasts = places[np.concatenate([breaks, [-1]])].tolist()
    rows = (
        struct.pack("<qq", first, last + 1 - first) + block[first : last + 1].tobytes()
        for first, last in zip(firsts, lasts, strict=True)
    )
    return struct.pack("<q", len(firsts)) + b"".join(rows)
