"""Compiled kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel: no Python objects, no GIL, cached."""
    return numba.njit(cache=True, nogil=True, error_model="numpy")(function)
