"""Command ``cotrack``; results go to stdout, messages and progress to stderr.

Exit status: 0 if the command is done and every check is met; 1 if it failed, a check is not met or the energy balance
is open; 2 on bad input.
"""

from __future__ import annotations

import atexit
import gc
import logging
import os
import signal
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from typing import Annotated, Any, NoReturn

import typer

from fmus.cache.limit import keep_limit
from fmus.vehicles.tables import BadInput
from orchestrator import __version__
from orchestrator.cli import log_commands
from orchestrator.cli.analysis_commands import analyse, life, plot, view
from orchestrator.cli.common import USAGE_ERROR, Printing, message_and_status, print_message, show_usage
from orchestrator.cli.result_commands import compare, replay, report
from orchestrator.cli.run_commands import resume, run, truth
from orchestrator.cli.scene_commands import build, cache, check, keys, new, scenes, schema, show, ssp, vehicles, warm
from orchestrator.cli.study_commands import fit, sensitivity, study, sweep
from orchestrator.files.command import command_scope
from orchestrator.files.messages import LOG
from orchestrator.files.progress import Progress

app = typer.Typer(
    name="cotrack",
    help="Tracked vehicles with flexible or rigid link chains as FMI 2.0 co-simulation components.",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.add_typer(log_commands.app, name="log")
COMMANDS: tuple[Callable[..., None], ...] = (
    scenes, vehicles, keys, schema, new, show, build, ssp, check, run, resume, replay, compare,
    view, analyse, life, plot, report, study, sweep, fit, sensitivity, truth, warm, cache,
)  # fmt: skip
for command in COMMANDS:
    app.command()(command)


@app.command(hidden=True, context_settings={"ignore_unknown_options": True})
def bench(arguments: Annotated[list[str] | None, typer.Argument()] = None) -> NoReturn:
    """Raise BadInput with the new place of a command of older versions, which exists in a clone only."""
    raise BadInput(
        f"bench is run in a clone of cotrack: python -m tests.benchmarks {' '.join(arguments or ())}".rstrip()
    )


def _version(wanted: bool) -> None:
    if wanted:
        print(f"cotrack {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="print the installed version")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="print tracebacks; give it before the command")] = False,
) -> None:
    LOG.setLevel(logging.DEBUG if debug else logging.NOTSET)


def _stop(number: int, frame: object) -> None:
    """End the command by a signal, as its shell would say it."""
    print_message(f"ended by {signal.Signals(number).name}", 0)
    sys.exit(128 + number)


def main(command: Callable[..., Any] = app) -> None:
    """Run a command line; an error ends as one sentence, with exit status 2 for bad input."""
    task = next((word for word in sys.argv[1:] if not word.startswith("-")), "cotrack")
    logging.getLogger().addHandler(printing := Printing())
    for stream in (sys.stdout, sys.stderr):  # file names may hold bytes that are not text
        with suppress(AttributeError):  # a closed stream, or one that is not the system's
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    for number in (getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)):
        signal.signal(number, _stop)
    status: Any = 0
    try:
        with warnings.catch_warnings(), command_scope(), Progress(task):
            warnings.simplefilter("ignore", RuntimeWarning)  # of overflow; the results say what became of it
            status = command(standalone_mode=False)
    except KeyboardInterrupt:
        status = 130
    except SystemExit as ended:
        status = ended.code
    except USAGE_ERROR as error:
        status = show_usage(error)
    except Exception as error:
        status = print_message(*message_and_status(error))
    if status == 130:  # typer's status for Ctrl-C
        status = print_message("interrupted", 1)
    keep_limit()
    logging.getLogger().removeHandler(printing)
    atexit.register(gc.freeze)  # otherwise the interpreter goes through all objects of the libraries: half a second
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except OSError as error:
            status = print_message(*message_and_status(error)) if stream is sys.stdout else status
            with suppress(OSError, ValueError):  # buffered data must not raise again at exit
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    sys.exit(status)
