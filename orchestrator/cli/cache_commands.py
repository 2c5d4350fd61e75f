"""Command ``cache``: what the cache folder holds, and its size."""

from __future__ import annotations

import time
from typing import Annotated

import typer

from fmus.vehicle import BadInput


def cache(
    prune: Annotated[
        bool, typer.Option("--prune", help="remove what was used longest ago, to the largest size")
    ] = False,
    most: Annotated[
        float | None,
        typer.Option("--most", metavar="GB", help="largest size; default $COTRACK_CACHE_SIZE, else 4 GB", min=0.0),
    ] = None,
) -> None:
    """Print what the cache folder holds: compiled kernels, built and unpacked FMUs, places of idlers.

    Every command keeps it below its largest size; what was used in the last day stays. With --most, --prune removes
    that too. What is missing is made again.
    """
    from fmus import cache_limit
    from fmus.cache import cache_folder

    try:
        limit = cache_limit.limit() if most is None else most * cache_limit.GB
    except ValueError as error:
        raise BadInput(str(error)) from None
    if prune:
        removed = cache_limit.prune(limit, cache_limit.RECENT if most is None else 0.0)
        print(f"removed {len(removed)} folders, {_size(sum(entry.size for entry in removed))}")
    held = cache_limit.entries()
    print(f"{cache_folder()}: {_size(sum(entry.size for entry in held))} of {_size(limit)} at most")
    for kind, about in cache_limit.KINDS.items():
        if own := [entry for entry in held if entry.kind == kind]:
            oldest = (time.time() - own[0].used) / 86400.0
            size = _size(sum(entry.size for entry in own))
            print(f"  {kind:10} {about:32} {len(own):5} folders {size:>9}, the oldest used {oldest:.1f} days ago")


def _size(size: float) -> str:
    return f"{1e-9 * size:.2f} GB" if size >= 1e8 else f"{1e-6 * size:.1f} MB"
