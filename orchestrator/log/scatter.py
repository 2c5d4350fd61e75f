"""Words of rows put into message records, in machine code: numpy needs two copies for it, and Python's lock."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.log.machine_code import ADDRESS, WORD, made

CODE = """
define void @scatter(ptr %rows, i64 %width, ptr %which, i64 %n, ptr %moves, i64 %n.moves, ptr %records, i64 %size) {
entry:
  br label %next
next:
  %i = phi i64 [0, %entry], [%i.next, %over]
  %more = icmp ult i64 %i, %n
  br i1 %more, label %row, label %out
row:
  %which.at = getelementptr i64, ptr %which, i64 %i
  %number = load i64, ptr %which.at
  %from.first = mul i64 %number, %width
  %from = getelementptr i8, ptr %rows, i64 %from.first
  %to.first = mul i64 %i, %size
  %to = getelementptr i8, ptr %records, i64 %to.first
  br label %move
move:
  %k = phi i64 [0, %row], [%k.next, %copy]
  %on = icmp ult i64 %k, %n.moves
  br i1 %on, label %copy, label %over
copy:
  %pair = getelementptr [2 x i64], ptr %moves, i64 %k
  %source = load i64, ptr %pair
  %target.at = getelementptr i64, ptr %pair, i64 1
  %target = load i64, ptr %target.at
  %word.at = getelementptr i8, ptr %from, i64 %source
  %word = load i64, ptr %word.at
  %place = getelementptr i8, ptr %to, i64 %target
  store i64 %word, ptr %place, align 1
  %k.next = add i64 %k, 1
  br label %move
over:
  %i.next = add i64 %i, 1
  br label %next
out:
  ret void
}
"""


@cache
def _function() -> Any:
    kind = (None, ADDRESS, WORD, ADDRESS, WORD, ADDRESS, WORD, ADDRESS, WORD)
    return made(CODE, {"scatter": kind})  # which keeps the function


def scatter(
    rows: NDArray[np.float64], which: NDArray[np.int64], moves: NDArray[np.int64], records: NDArray[np.uint8]
) -> None:
    """Copy words of the rows ``which`` (m,) into as many records (m, bytes), all arrays contiguous.

    ``moves`` (n, 2): from so many bytes behind the beginning of the row, which may be negative, to that byte of the
    record; the later of two that overlap counts.
    """
    _function().functions["scatter"](
        rows.ctypes.data,
        rows.strides[0],
        which.ctypes.data,
        len(which),
        moves.ctypes.data,
        len(moves),
        records.ctypes.data,
        records.shape[1],
    )
