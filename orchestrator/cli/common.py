"""Arguments, options, messages and exit status shared by all commands; text of any origin for the terminal."""

from __future__ import annotations

import errno
import json
import logging
import os
import sys
import traceback
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from shutil import get_terminal_size
from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Any, Literal, NoReturn

import typer

from fmus.track.choices import TRACKS
from fmus.vehicles.tables import BadInput, path_text
from orchestrator.files.messages import LOG, plain
from orchestrator.log.extra import lacking

if TYPE_CHECKING:
    from orchestrator.results.measured_record import MeasuredFile


def summary(result: Mapping[str, Any], verbose: bool = False) -> None:
    """Print the summary of a run, all of it if it is to be ``verbose``, as wide as the terminal lets it be."""
    from orchestrator.execution.summary_text import WIDTH, lines

    width = min(WIDTH, get_terminal_size((WIDTH, 0)).columns) if sys.stdout.isatty() else WIDTH
    print_lines(lines(result, verbose, width))


def print_lines(lines: Iterable[str]) -> None:
    """Print lines of text of any origin."""
    for line in lines:
        print(plain(line))


def print_json(result: object) -> None:
    """Print a result as one JSON object on one line; numbers that JSON lacks are null."""
    from orchestrator.results.units import finite

    print(json.dumps(finite(result)))


LONGEST_MESSAGE = 380  # characters of an error: names and values of the user may have any length
LONGEST_USAGE = 300  # of an error in the command line
USAGE_ERROR: Any = typer.BadParameter.__base__  # unknown commands and options too; typer has no public name for it
# Errors of a stream that accepts no more data.
CLOSED_STREAM = (errno.ENOSPC, errno.EIO, errno.EFBIG, errno.EBADF, errno.EDQUOT)
TrackModel = StrEnum("TrackModel", [*TRACKS])  # type: ignore[misc]
SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="a name of the gallery or a TOML file")]
LogPath = Annotated[Path, typer.Argument(metavar="LOG", help="an MCAP log")]
TrackOption = Annotated[TrackModel | None, typer.Option("--track", help="the track model, instead of the scene's")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="a dotted key of the resolved scene, repeatable"),
]
VehicleOption = Annotated[
    str | None,
    typer.Option("--vehicle", metavar="VEHICLE", help="a packaged vehicle or a TOML file, instead of the scene's"),
]

JsonLine = Annotated[bool, typer.Option("--json", help="the last line on stdout is one JSON object")]
JsonObject = Annotated[bool, typer.Option("--json", help="one JSON object on stdout")]
NativeOption = Annotated[bool, typer.Option("--native", help="use native FMUs; results have the same bits")]
EstimateOption = Annotated[bool, typer.Option(help="estimate the error by two coarser runs, in 0.75 of the run's time")]
PartsOption = Annotated[
    bool, typer.Option("--estimate-parts", help="estimate its parts, coupling and integration, too, by a third run")
]
StopOption = Annotated[str | None, typer.Option("--stop", metavar="T", help="end, '2 s' or a number")]
DifferentOption = Annotated[bool, typer.Option("--different", help="also compare runs of different scenes")]
From = Annotated[float, typer.Option("--from", metavar="T", help="first instant, s")]
FromCompared = Annotated[float, typer.Option("--from", metavar="T", help="first instant of the comparison, s")]
To = Annotated[float, typer.Option("--to", metavar="T", help="last instant, s")]


def with_vehicle(vehicle: str | None, settings: list[str] | None) -> list[str]:
    """Return the settings with the vehicle first."""
    return [*([f"vehicle={vehicle}"] if vehicle is not None else ()), *(settings or ())]


def estimated(estimate: bool, parts: bool) -> bool | Literal["parts"]:
    """Return which estimate is wanted; raises BadInput for parts of none."""
    if parts and not estimate:
        raise BadInput("--estimate-parts: there are no parts of an estimate that --no-estimate leaves out")
    return "parts" if parts else estimate


def beside(log: Path, ending: str) -> Path:
    """Return the default name of a file made from a log, beside it; raises BadInput for a path without a name."""
    if not log.name:
        raise BadInput(f"the log {log} cannot be read: it is a directory")
    return log.with_name(f"{log.stem}{ending}")


def message_and_status(error: Exception) -> tuple[str, int]:
    """Return message and exit status for an error."""
    if LOG.isEnabledFor(logging.DEBUG):
        traceback.print_exception(error)
    if isinstance(error, ImportError) and not (error.name or "").startswith(("fmus", "orchestrator")):
        return shortened(lacking(error)), 2
    if isinstance(error, refusals()):
        return shortened(str(error)), 2
    if isinstance(error, BrokenPipeError):  # the reader of the pipe has closed it
        return "", 1
    if isinstance(error, OSError) and error.errno == errno.ENAMETOOLONG:
        return f"{path_text(error.filename)}: {os.strerror(error.errno).lower()}", 2
    if isinstance(error, OSError) and error.filename is None and error.errno in CLOSED_STREAM:
        return f"the output cannot be written: {os.strerror(error.errno).lower()}", 1
    return (
        f"internal error: {type(error).__name__}: {shortened(str(error), 200)}; run 'cotrack --debug ...' to see where",
        1,
    )


def show_usage(error: Any) -> int:
    """Print a USAGE_ERROR, its message in one short line, and the usage of the command; return the exit status."""
    message = shortened(" ".join(error.format_message().split()), LONGEST_USAGE)
    error.format_message = lambda: message
    error.show()
    return int(error.exit_code)


def shortened(message: str, most: int = LONGEST_MESSAGE) -> str:
    """Return a message of ``most`` characters at most, its middle left out if it is longer."""
    return message if len(message) <= most else f"{message[: most // 2]} ... {message[len(message) - most // 2 + 5 :]}"


def refusals() -> tuple[type[Exception], ...]:
    """Return the exceptions that report bad input, before anything ran."""
    from fmus.fmi.build import BuildFailed
    from orchestrator.cosim.checkpoint import UnusableCheckpoint
    from orchestrator.cosim.coupling.scheme import CouplingFailed
    from orchestrator.cosim.graph import Miswired
    from orchestrator.execution.replays import UnfitLog
    from orchestrator.fmi.slave import ComponentFailed
    from orchestrator.log.extra import NotInstalled
    from orchestrator.log.log_file import LogFailed
    from orchestrator.log.reader import LogUnreadable, Missing

    return (
        BadInput,
        BuildFailed,
        ComponentFailed,
        CouplingFailed,
        Miswired,
        LogUnreadable,
        LogFailed,
        Missing,
        NotInstalled,
        UnfitLog,
        UnusableCheckpoint,
    )


class Printing(logging.Handler):
    """Prints messages on stderr, each once."""

    def __init__(self) -> None:
        super().__init__()
        self._printed: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        """Print a message that is a new one."""
        message = record.getMessage()
        if message not in self._printed:
            self._printed.add(message)
            print_message(message, 0)


def print_message(message: str, status: int) -> int:
    """Print a message on stderr and return the exit status."""
    if message and sys.stderr is not None:
        with suppress(OSError):  # stderr is closed
            text = f"cotrack: {plain(message)}"
            if sys.stderr.isatty():  # a terminal would break words
                columns = get_terminal_size().columns
                text = "\n".join(
                    fill(line, columns, break_long_words=False, break_on_hyphens=False) for line in text.splitlines()
                )
            print(text, file=sys.stderr)
    return status


def exit_with(message: str, status: int) -> NoReturn:
    """End the command with a message and an exit status."""
    sys.exit(print_message(message, status))


WithOption = Annotated[
    Path | None, typer.Option("--with", metavar="FILE", help="measured record, shown beside the run")
]
MapOption = Annotated[
    list[str] | None,
    typer.Option("--map", metavar="SIGNAL=COLUMN[:UNIT]", help="column of the record for a signal, repeatable"),
]
ClockOption = Annotated[
    str, typer.Option("--clock", metavar="COLUMN[:UNIT]", help="time in the measured record; default t or time")
]
ShiftOption = Annotated[
    str, typer.Option("--shift", metavar="S|find", help="s added to the file's time; find: least RMS difference")
]


def measured_file(file: Path | None, mapped: Sequence[str] | None, clock: str, shift: str) -> MeasuredFile | None:
    """Parse the options of a measured record; None without one.

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
        raise BadInput("--map, --clock and --shift belong to the file of a test, which is not given")
    if file is not None and not columns:
        raise BadInput("a measured record needs --map SIGNAL=COLUMN, for example --map 'chassis.speed=v'")
    return None if file is None else MeasuredFile(file, columns, clock, shift)
