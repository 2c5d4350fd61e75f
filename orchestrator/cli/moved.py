"""Command of older versions that exists in a clone only; it prints the new place."""

from __future__ import annotations

from typing import Annotated, NoReturn

import typer

from fmus.vehicle import BadInput


def bench(arguments: Annotated[list[str] | None, typer.Argument()] = None) -> NoReturn:
    """Raise BadInput with the new place of the command."""
    raise BadInput(
        f"bench is run in a clone of cotrack: python -m tests.benchmarks {' '.join(arguments or ())}".rstrip()
    )
