"""A command that older versions had; it answers with its place in a clone."""

from __future__ import annotations

from typing import Annotated, NoReturn

import typer

from fmus.vehicle import BadInput


def bench(arguments: Annotated[list[str] | None, typer.Argument()] = None) -> NoReturn:
    """Moved: raises BadInput."""
    raise BadInput(
        f"bench is run in a clone of cotrack: python -m tests.benchmarks {' '.join(arguments or ())}".rstrip()
    )
