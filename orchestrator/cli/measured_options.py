"""Options that lay a measured record, a CSV file, beside a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

from fmus.vehicle import BadInput

MapOption = Annotated[
    list[str] | None,
    typer.Option("--map", metavar="SIGNAL=COLUMN[:UNIT]", help="column of the CSV file for a signal, repeatable"),
]
ClockOption = Annotated[
    str, typer.Option("--clock", metavar="COLUMN[:UNIT]", help="time in the CSV file; default t or time")
]
ShiftOption = Annotated[
    str, typer.Option("--shift", metavar="S|find", help="s added to the file's time; find: least RMS difference")
]


def columns_by_signal(mapped: Sequence[str] | None, clock: str, shift: str, has_file: bool) -> dict[str, str]:
    """Parse ``--map``; raises BadInput, also for options of a file without one or without a map."""
    columns: dict[str, str] = {}
    for text in mapped or ():
        signal, _, column = text.partition("=")
        if not (signal and column):
            raise BadInput(f"--map {text}: must be SIGNAL=COLUMN or SIGNAL=COLUMN:UNIT")
        if signal in columns:
            raise BadInput(f"--map {text}: '{signal}' has a column already, '{columns[signal]}'")
        columns[signal] = column
    if has_file and not columns:
        raise BadInput("a measured record needs --map SIGNAL=COLUMN, for example --map 'chassis.speed=v'")
    if not has_file and (columns or clock or shift != "0"):
        raise BadInput("--map, --clock and --shift belong to the CSV file of a test, which is not given")
    return columns
