"""The command ``cotrack``. Results go to stdout, messages and progress to stderr.

Exit status: 0 done and every check made is ok, 1 failed, a check not ok or an energy ledger left open, 2 bad input.
"""

from __future__ import annotations

import errno
import json
import logging
import os
import sys
import traceback
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from fmus.vehicle import BadInput
from orchestrator import cli_log, printed
from orchestrator.cli_log import LogPath
from orchestrator.cosim.narration import Narration

FMI_WARNING = 1
LOST = (errno.ENOSPC, errno.EIO, errno.EFBIG, errno.EBADF, errno.EDQUOT)  # of a stream that takes no more

app = typer.Typer(
    name="cotrack",
    help="Tracked vehicles with flexible or rigid link chains as FMI 2.0 co-simulation components.",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.add_typer(cli_log.app, name="log")


class TrackModel(StrEnum):
    """The two track models."""

    flexible = "flexible"
    rigid = "rigid"


SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="a name of the gallery or a TOML file")]
TrackOption = Annotated[TrackModel | None, typer.Option("--track", help="the track model, instead of the scene's")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="a dotted key of the resolved scene, repeatable"),
]


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"cotrack {version('cotrack')}")
        raise typer.Exit


def _narrate(line: str) -> None:
    with suppress(OSError, ValueError):  # nobody listens
        print(f"... {printed.plain(line)}", file=sys.stderr, flush=True)


narration = Narration(_narrate)


@app.callback()
def _common(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="what is installed")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="show where an error was raised; before the command")] = False,
) -> None:
    logging.getLogger("cotrack").setLevel(logging.DEBUG if debug else logging.NOTSET)
    context.with_resource(narration)
    narration.begin(str(context.invoked_subcommand))


def main() -> None:
    """Run the command line; an error ends as one sentence, with exit status 2 where the user gave something wrong."""
    logging.basicConfig(format="cotrack: %(message)s", level=logging.WARNING, stream=sys.stderr)
    for stream in (sys.stdout, sys.stderr):  # names of files may hold bytes that are no text
        with suppress(AttributeError):  # closed, or not the system's
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    status: Any = 0
    try:
        app()
    except KeyboardInterrupt:
        status = _tell("interrupted", 1)
    except SystemExit as ended:
        status = _tell("interrupted", 1) if ended.code == 130 else ended.code  # typer's word for Ctrl-C
    except Exception as error:
        status = _tell(*_ended_by(error))
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except OSError as error:
            status = _tell(*_ended_by(error)) if stream is sys.stdout else status
            with suppress(OSError, ValueError):  # what is still to be written must not complain again
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    sys.exit(status)


def _ended_by(error: Exception) -> tuple[str, int]:
    """What is said of an error, and the exit status."""
    if logging.getLogger("cotrack").isEnabledFor(logging.DEBUG):
        traceback.print_exception(error)
    if isinstance(error, _refusals()):
        return str(error), 2
    if isinstance(error, BrokenPipeError):  # who reads has read enough
        return "", 1
    if isinstance(error, OSError) and error.filename is None and error.errno in LOST:
        return f"the output cannot be written: {os.strerror(error.errno).lower()}", 1
    return f"internal error: {type(error).__name__}: {error}; run 'cotrack --debug ...' to see where", 1


def _refusals() -> tuple[type[Exception], ...]:
    """What is raised about input before anything ran."""
    from fmus.build import BuildFailed
    from orchestrator.cosim.component import ComponentFailed
    from orchestrator.cosim.coupling.scheme import CouplingFailed
    from orchestrator.cosim.graph import Miswired
    from orchestrator.execution.replays import Unfit
    from orchestrator.log.reader import LogUnreadable, NoSuchSignal
    from orchestrator.log.recorder import LogFailed
    from orchestrator.results.run_data import Missing

    return (
        BadInput,
        BuildFailed,
        ComponentFailed,
        CouplingFailed,
        Miswired,
        LogUnreadable,
        LogFailed,
        NoSuchSignal,
        Unfit,
        Missing,
    )


def _tell(message: str, status: int) -> int:
    if message and sys.stderr is not None:
        with suppress(OSError):  # nobody can be told
            print(f"cotrack: {printed.plain(message)}", file=sys.stderr)
    return status


def _leave(message: str, status: int) -> NoReturn:
    sys.exit(_tell(message, status))


@app.command()
def scenes() -> None:
    """The gallery, one line each."""
    from orchestrator.scene import gallery

    for name in gallery.names():
        print(f"{name:16} {gallery.read(name)[1]['title']}")


@app.command()
def show(scene: SceneName, track: TrackOption = None, settings: Settings = None) -> None:
    """What is in, what is left out, sizes."""
    from orchestrator.scene.scene import load
    from orchestrator.show import lines

    for line in lines(load(scene, _model(track), settings or ())):
        print(line)


@app.command()
def build(
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="the folder of the FMUs")],
    scene: Annotated[str | None, typer.Argument(metavar="[SCENE]", help="only what this scene needs")] = None,
    everything: Annotated[bool, typer.Option("--all", help="every distinct FMU of the gallery")] = False,
    track: TrackOption = None,
    settings: Settings = None,
    vehicle: Annotated[
        str | None, typer.Option("--vehicle", metavar="FILE", help="a vehicle, instead of the scene's")
    ] = None,
) -> None:
    """FMUs to be kept, the scene's parameters their defaults.

    The four standard ones, a scene's, or all.
    """
    from orchestrator.scene import products
    from orchestrator.scene.assembly import TRACKS
    from orchestrator.scene.scene import load

    if scene is not None and everything:
        raise BadInput("give a scene or --all, not both")
    changes = [*([f"vehicle={vehicle}"] if vehicle else ()), *(settings or ())]
    models = [track.value] if track else list(TRACKS)
    if everything:
        wanted = products.of_gallery(models, changes)
    elif scene is None:
        wanted = products.of_scenes([load(products.STANDARD, model, changes) for model in models])
    else:
        wanted = products.of_scenes([load(scene, _model(track), changes)])
    if not wanted:
        raise BadInput(f"scene '{scene}' needs no FMU")
    for file in products.build_to(output, wanted):
        print(file)


@app.command()
def run(
    scene: SceneName,
    track: TrackOption = None,
    settings: Settings = None,
    stop: Annotated[str | None, typer.Option("--stop", metavar="T", help="end, '2 s' or a number")] = None,
    step: Annotated[
        str | None, typer.Option("--step", metavar="H", help="communication step, '1 ms' or a number")
    ] = None,
    coupling: Annotated[
        str | None,
        typer.Option("--coupling", metavar="NAME", help="the coupling scheme, instead of the scene's"),
    ] = None,
    error: Annotated[
        str | None, typer.Option("--error", metavar="E", help="'1%': the cheapest settings known to keep it")
    ] = None,
    estimate: Annotated[
        bool, typer.Option(help="say how wrong the run is: two coarser runs beside it, about its cost again")
    ] = True,
    log: Annotated[Path | None, typer.Option("--log", metavar="PATH", help="default logs/SCENE-TRACK.mcap")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="the last line on stdout is one JSON object")] = False,
) -> None:
    """Run a scene, log it, check what it expects, say how wrong it is."""
    narration(f"{scene}: the scene is read")
    from orchestrator.execution import summary
    from orchestrator.scene.scene import load

    result, status = summary.empty(scene, _model(track)), 2
    told = (("stop", stop), ("step", step), ("coupling", coupling))
    changes = [*(settings or ()), *(f"run.{k}={v}" for k, v in told if v is not None)]
    try:
        resolved = load(scene, _model(track), changes)
        if error is not None:
            from orchestrator.execution.precision import cheapest, fraction

            chosen = cheapest(resolved.name, resolved.variant or "none", fraction(error)).settings
            print(f"cotrack: --error {error}: {', '.join(chosen)}", file=sys.stderr)
            resolved = load(scene, _model(track), [*chosen, *changes])
        from orchestrator.execution.simulate import simulate

        path = log or Path("logs") / f"{'-'.join(filter(None, (resolved.name, resolved.variant)))}.mcap"
        result = simulate(resolved, path, _warn, narration, estimated=estimate)
        checked = all(check["ok"] for check in result["checks"].values())
        status = 0 if result["status"] == "ok" and checked and not summary.energy_warning(result["energy"]) else 1
    except KeyboardInterrupt:
        result["message"], status = "interrupted", 1
    except Exception as failure:
        result["message"], status = _ended_by(failure)
    _tell(result["message"], status)
    if as_json:
        print(json.dumps(printed.finite(result)))
    elif status != 2:
        printed.summary(result)
    sys.exit(status)


@app.command()
def replay(
    log: LogPath,
    component: Annotated[str, typer.Option("--component", metavar="NAME", help="the component that is stepped again")],
    other: Annotated[
        str | None,
        typer.Option("--with", metavar="rigid|flexible|FMU", help="another model under the recorded motion"),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PATH", help="log of the other model's answer")
    ] = None,
) -> None:
    """Feed a component its recorded inputs: is it equal?

    Bit by bit; or, with another model in its place, how does that one answer.
    What is stepped is built from the scene in the log, or is the FMU that --with names: no file that the log names.
    An FMU that is the one that ran, by its hash, is compared bit by bit unless -o asks for its log.
    """
    from orchestrator.execution import replay_model
    from orchestrator.log.tools import file_name

    with replay_model.opened(log, component, other, _warn) as again:
        if other is None or (again.model.ran and output is None):
            verdict = again.verify()
            print(verdict.sentence)
            sys.exit(0 if verdict.equal else 1)
        path = output or log.with_name(f"{log.stem}-{file_name(component)}-{Path(other).stem}.mcap")
        lines = again.answer(path)
        if not lines:
            _leave(f"{log} holds no step of '{component}': there is nothing to answer", 1)
        for line in lines:
            print(line)
        print(f"log {path}")


@app.command()
def compare(
    run: Annotated[Path, typer.Argument(metavar="A", help="an MCAP log")],
    reference: Annotated[Path, typer.Argument(metavar="B", help="the log that A is held against")],
    different: Annotated[bool, typer.Option("--different", help="even if they are runs of different scenes")] = False,
) -> None:
    """How far two runs of a scene are apart, by observable.

    They may differ in the track model, in what its links are, in steps, coupling, duration, checks and records; where
    anything else of their scenes differs, vehicle included, they are refused (--different compares them all the same).
    """
    from orchestrator.log.reader import Log
    from orchestrator.results.difference import differences
    from orchestrator.results.run_data import RunData
    from orchestrator.scene.scene import of_one_scene

    with Log(run) as one, Log(reference) as other:
        a, b = RunData(one), RunData(other)
        if not different:
            of_one_scene((f"{run}", a.scene), (f"{reference}", b.scene))
        found = differences(a, b)
    print(f"{'observable':18} {'RMS':>10}       {'relative':>9}")
    for name, apart in found.items():
        note = "" if apart.decisive else "  instant by instant: sensitive"
        print(f"{name:18} {apart.absolute:10.3g} {apart.unit:5} {apart.relative:9.2g}{note}")


@app.command()
def view(
    log: LogPath,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="a picture, .png or .svg")],
    times: Annotated[list[float] | None, typer.Option("--at", metavar="T", help="an instant, s; repeatable")] = None,
) -> None:
    """Side view, links coloured by their tension.

    At three instants or those given.
    """
    from orchestrator.results import picture

    picture.draw(log, output, times or None)
    print(output)


@app.command()
def study(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="without it: the known studies")] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="the folder of tables and figures")
    ] = None,
    scene: Annotated[
        str | None, typer.Argument(metavar="[SCENE]", help="for studies of a scene; default straight")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="below five minutes on two cores")] = False,
    workers: Annotated[
        int | None,
        typer.Option("--workers", metavar="N", help="processes; default 2, 1 where runs are timed", min=1),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="a Dask scheduler, instead of processes"),
    ] = None,
) -> None:
    """Many cases side by side, as tables and figures.

    Exit 1 when a row is not as it should be.
    Started again with the same folder, it goes on where it was interrupted.
    """
    from orchestrator import studies
    from orchestrator.studies import pool
    from orchestrator.studies.progress import Watched
    from orchestrator.studies.store import Store

    if name is None:
        for known, about in studies.STUDIES.items():
            print(f"{known:16} {about}")
        return
    chosen = studies.find(name)
    if output is None:
        raise BadInput(f"study {name}: -o DIR says where its tables and figures go")
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"the folder {output} cannot be made: {error.strerror}") from None
    timed = hasattr(chosen, "WORKERS")  # a study of one scene, whose runs have the machine to themselves
    if scene is not None and not timed:
        raise BadInput(f"study {name} takes no scene")
    make: Any = chosen.cases
    cases = make(quick, scene) if scene is not None else make(quick)
    workers = workers or (1 if timed else 2)
    try:
        with narration.elsewhere(), Watched(name, len(cases)) as done:
            rows = pool.run(chosen, cases, workers, scheduler, Store(output / "cases", chosen.Row), done)
        files = chosen.write(output, name, rows, chosen.TITLE)
    except OSError as error:
        raise BadInput(f"the folder {output} cannot be written: {error}") from None
    print(chosen.to_markdown(rows))
    for file in files:
        print(file)
    missed = chosen.missed(rows)
    print(f"{len(rows)} rows, {len(missed)} not as they should be", file=sys.stderr)
    for row in missed:
        print(f"cotrack: {row.item}: {row.case}: {row.note or 'misses its tolerance'}", file=sys.stderr)
    sys.exit(1 if missed else 0)


@app.command()
def truth(
    scene: SceneName,
    track: TrackOption = None,
    settings: Settings = None,
    stop: Annotated[str | None, typer.Option("--stop", metavar="T", help="end, '2 s' or a number")] = None,
    against: Annotated[
        Path | None, typer.Option("--against", metavar="LOG", help="how far this run of the scene is off")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="the last line on stdout is one JSON object")] = False,
) -> None:
    """The scene without co-simulation, converged.

    With its own error; built once, then found.
    """
    from orchestrator.execution import truth as module
    from orchestrator.log.reader import Log
    from orchestrator.results.difference import differences_of_logs
    from orchestrator.results.run_data import RunData
    from orchestrator.scene.assembly import placed
    from orchestrator.scene.scene import TrackScene, load, of_one_scene

    changes = [*(settings or ()), *([f"run.stop={stop}"] if stop is not None else ())]
    resolved = load(scene, _model(track), changes)
    if against:
        with Log(against) as log:
            own = placed(resolved) if isinstance(resolved, TrackScene) else resolved
            of_one_scene((f"{against}", RunData(log).scene), (f"the truth of {scene}", own.resolved()))
    try:
        found = module.truth(resolved, narration)
    except module.TruthFailed as failure:
        _leave(str(failure), 1)
    off = differences_of_logs(against, found.log) if against else {}
    observables = {
        name: {"unit": one.unit, "difference": one.absolute, "error": found.error(name)}
        | ({"off": off[name].absolute, "off_relative": off[name].relative} if name in off else {})
        for name, one in found.difference.items()
    }
    result = {
        "scene": resolved.name,
        "track": resolved.variant,
        "log": str(found.log),
        "coarse_log": str(found.coarse_log),
        "built": found.built,
        "internal_step": found.internal_step,
        "wall_time": found.wall_time,
        "observables": observables,
    }
    if as_json:
        print(json.dumps(printed.finite(result)))
        return
    print(f"{'built' if found.built else 'found'} {found.log}")
    print(f"  internal step {found.internal_step:.3g} s, {found.wall_time:.3g} s of wall time; RMS errors:")
    for name, each in observables.items():
        line = f"  {name:18} {each['error']:9.2g} {each['unit']:4}"
        print(line + (f" {against} is off by {each['off']:.3g}, {each['off_relative']:.2%}" if "off" in each else ""))


@app.command()
def bench(
    only: Annotated[str | None, typer.Option("--only", metavar="A,B,...", help="some parts, instead of all")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="shorter windows, fewer steps and repeats")] = False,
    repeat: Annotated[
        int | None, typer.Option("--repeat", metavar="N", help="repeats of each timing, or pairs", min=1)
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option("--against", metavar="FOLDER", help="another checkout: both measure themselves in turn"),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="the last line on stdout is one JSON object")] = False,
) -> None:
    """How fast: the chain against peers, the vehicle, a step by part and layer, growth, start, memory."""
    from orchestrator import bench as module
    from orchestrator.bench import machine, tables

    names = module.chosen(only)
    repeats = repeat or (module.QUICK_REPEATS if quick else module.REPEATS)
    print(machine.sentence(machine.facts()), end="\n\n")
    with narration.elsewhere():
        result = module.report(
            names,
            quick,
            repeats,
            against,
            lambda what: print(f"... {what}", file=sys.stderr, flush=True),
            lambda table: print(tables.to_markdown(table), flush=True),
        )
    if as_json:
        print(json.dumps(printed.finite(result)))
    sys.exit(0 if result["ok"] else 1)


def _model(track: TrackModel | None) -> str | None:
    return track.value if track else None


def _warn(instance: str, status: int, message: str) -> None:
    """Warnings of components, each when it first comes; what is worse ends the run and is its message."""
    if status == FMI_WARNING:
        logging.getLogger("cotrack").warning("%s: %s", instance, message)
