"""Options that lay a measured record, a CSV file, beside a run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fmus.vehicle import BadInput

if TYPE_CHECKING:
    from orchestrator.results.measured_record import MeasuredFile

WithOption = Annotated[
    Path | None, typer.Option("--with", metavar="FILE.csv", help="measured record, shown beside the run")
]
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


def measured_file(file: Path | None, mapped: Sequence[str] | None, clock: str, shift: str) -> MeasuredFile | None:
    """Parse the options of a CSV file; None without one.

    Raises BadInput, also for options without a file and a file without a map.
    """
    from orchestrator.results.measured_record import MeasuredFile

    columns: dict[str, str] = {}
    for text in mapped or ():
        signal, _, column = text.partition("=")
        if not (signal and column):
            raise BadInput(f"--map {text}: must be SIGNAL=COLUMN or SIGNAL=COLUMN:UNIT")
        if signal in columns:
            raise BadInput(f"--map {text}: '{signal}' has a column already, '{columns[signal]}'")
        columns[signal] = column
    if file is None and (columns or clock or shift != "0"):
        raise BadInput("--map, --clock and --shift belong to the CSV file of a test, which is not given")
    if file is not None and not columns:
        raise BadInput("a measured record needs --map SIGNAL=COLUMN, for example --map 'chassis.speed=v'")
    return None if file is None else MeasuredFile(file, columns, clock, shift)
