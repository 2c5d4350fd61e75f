"""The command ``cotrack``. Results go to stdout, messages and progress to stderr.

Exit status: 0 done and every check made is ok, 1 failed or a check not ok, 2 bad input.
"""

from __future__ import annotations

import json
import logging
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from fmus.vehicle import BadInput

FMI_WARNING = 1

app = typer.Typer(
    name="cotrack",
    help="Tracked vehicles with flexible or rigid link chains as FMI 2.0 co-simulation components.",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
log_app = typer.Typer(help="Look into a log.", no_args_is_help=True, rich_markup_mode=None)
app.add_typer(log_app, name="log")


class TrackModel(StrEnum):
    """The two track models."""

    flexible = "flexible"
    rigid = "rigid"


SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="a name of the gallery or a TOML file")]
TrackOption = Annotated[
    TrackModel | None, typer.Option("--track", help="the track model, instead of the scene's")
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="a dotted key of the resolved scene, repeatable"),
]
LogPath = Annotated[Path, typer.Argument(metavar="LOG", help="an MCAP log")]


def main() -> None:
    """Run the command line; what a user gave wrong ends as one sentence and exit status 2."""
    logging.basicConfig(format="cotrack: %(message)s", level=logging.WARNING, stream=sys.stderr)
    try:
        app()
    except KeyboardInterrupt:
        _leave("interrupted", 1)
    except Exception as error:
        if not isinstance(error, _refusals()):
            raise
        _leave(str(error), 2)


def _refusals() -> tuple[type[Exception], ...]:
    """What is raised about input before anything ran."""
    from fmus.build import BuildFailed
    from orchestrator.component import ComponentFailed
    from orchestrator.coupling.scheme import CouplingFailed
    from orchestrator.evidence import Missing
    from orchestrator.graph import Miswired
    from orchestrator.reader import LogUnreadable, NoSuchSignal
    from orchestrator.recorder import LogFailed
    from orchestrator.replay import Unfit

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


def _leave(message: str, status: int) -> NoReturn:
    print(f"cotrack: {message}", file=sys.stderr)
    sys.exit(status)


@app.command()
def scenes() -> None:
    """The gallery, one line each."""
    from orchestrator import gallery

    for name in gallery.names():
        print(f"{name:16} {gallery.read(name)[1]['title']}")


@app.command()
def show(scene: SceneName, track: TrackOption = None, settings: Settings = None) -> None:
    """What is in, what is left out, sizes."""
    from orchestrator.scene import load
    from orchestrator.system import describe

    for line in describe(load(scene, _model(track), settings or ())):
        print(line)


@app.command()
def build(
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="the folder of the FMUs")],
    scene: Annotated[str | None, typer.Argument(metavar="[SCENE]", help="only what this scene needs")] = None,
    everything: Annotated[bool, typer.Option("--all", help="every distinct FMU of the gallery")] = False,
    track: TrackOption = None,
    vehicle: Annotated[
        str | None, typer.Option("--vehicle", metavar="FILE", help="a vehicle, instead of the scene's")
    ] = None,
) -> None:
    """FMUs to be kept: the four standard ones, a scene's, or all."""
    from orchestrator import products
    from orchestrator.scene import load
    from orchestrator.system import TRACKS

    if scene is not None and everything:
        raise BadInput("give a scene or --all, not both")
    settings = [f"vehicle={vehicle}"] if vehicle else []
    models = [track.value] if track else list(TRACKS)
    if everything:
        wanted = products.of_gallery(models, settings)
    elif scene is None:
        wanted = products.of_scenes([load(products.STANDARD, model, settings) for model in models])
    else:
        wanted = products.of_scenes([load(scene, _model(track), settings)])
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
        str | None, typer.Option("--coupling", metavar="NAME", help="the coupling scheme, instead of the scene's")
    ] = None,
    log: Annotated[
        Path | None, typer.Option("--log", metavar="PATH", help="default logs/SCENE-TRACK.mcap")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="the last line on stdout is one JSON object")
    ] = False,
) -> None:
    """Run a scene, log it, check what it expects."""
    from orchestrator import summary
    from orchestrator.scene import load
    from orchestrator.simulate import simulate

    result, status = summary.empty(scene, _model(track)), 2
    told = (("stop", stop), ("step", step), ("coupling", coupling))
    changes = [*(settings or ()), *(f"run.{k}={v}" for k, v in told if v is not None)]
    try:
        resolved = load(scene, _model(track), changes)
        path = log or Path("logs") / f"{resolved.name}-{resolved.track.model}.mcap"
        result = simulate(resolved, path, _warn, progress=True)
        sound = result["status"] == "ok" and all(check["ok"] for check in result["checks"].values())
        status = 0 if sound else 1
    except _refusals() as error:
        result["message"] = str(error)
    if result["message"]:
        print(f"cotrack: {result['message']}", file=sys.stderr)
    if as_json:
        print(json.dumps(_finite(result)))
    elif status != 2:
        _print_summary(result)
    sys.exit(status)


@app.command()
def replay(
    log: LogPath,
    component: Annotated[
        str, typer.Option("--component", metavar="NAME", help="the component that is stepped again")
    ],
    other: Annotated[
        str | None,
        typer.Option("--with", metavar="rigid|flexible|FMU", help="another model under the recorded motion"),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PATH", help="log of the other model's answer")
    ] = None,
) -> None:
    """Feed a component the recorded inputs bit by bit: is it equal, or how does another model answer?"""
    from orchestrator import rerun

    with rerun.opened(log, component, other, _warn) as again:
        if other is None:
            verdict = again.verify()
            print(verdict.sentence)
            sys.exit(0 if verdict.difference is None else 1)
        path = output or log.with_name(f"{log.stem}-{component}-{Path(other).stem}.mcap")
        for line in again.answer(path):
            print(line)
        print(f"log {path}")


@app.command()
def view(
    log: LogPath,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="a picture, .png or .svg")],
    times: Annotated[
        list[float] | None, typer.Option("--at", metavar="T", help="an instant, s; repeatable")
    ] = None,
) -> None:
    """Side view with the links coloured by tension, at three instants or those given."""
    from orchestrator import picture

    picture.draw(log, output, times or None)
    print(output)


@app.command()
def study(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="without it: the known studies")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="the folder of tables and figures")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="below five minutes on two cores")] = False,
    workers: Annotated[int, typer.Option("--workers", metavar="N", help="processes", min=1)] = 2,
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="ADDRESS", help="a Dask scheduler, instead of processes")
    ] = None,
) -> None:
    """Many cases side by side, as tables and figures: exit 1 when a row is not as it should be.

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
    cases = chosen.cases(quick)
    try:
        with Watched(name, len(cases)) as done:
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


@log_app.command("info")
def log_info(log: LogPath) -> None:
    """What a log holds and how its run ended."""
    from orchestrator.log_tools import info

    about = info(log)
    steps = "" if about.steps is None else f" after {about.steps} steps"
    print(
        f"{about.path}: {about.bytes / 1e6:.2f} MB, {about.start:g} to {about.end:g} s, {about.status}{steps}"
    )
    for sentence in (about.message, *about.faults):
        if sentence:
            print(f"  {sentence}")
    for record, entries in about.metadata.items():
        print(f"  {record}: " + ", ".join(f"{key} = {value}" for key, value in entries.items()))
    for topic in about.topics:
        print(
            f"  {topic.topic:22} {topic.signals:5} signals, {topic.messages:7} messages,"
            f" one step in {topic.every}, {topic.bytes / 1e6:.2f} MB"
        )
    for name, size in about.attachments:
        print(f"  attached: {name}, {size} bytes")
    print(f"  digest {about.digest or 'none: a part is damaged'}")


@log_app.command("verify")
def log_verify(log: LogPath) -> None:
    """Whether a log is whole: exit 0, or 1 when it is broken."""
    from orchestrator.log_tools import verify

    _report(verify(log))


@log_app.command("recover")
def log_recover(
    log: LogPath,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PATH", help="default LOG-recovered.mcap")
    ] = None,
) -> None:
    """Save what is whole in a broken log: exit 0 without loss, 3 with loss, 1 when nothing is left."""
    from orchestrator.log_tools import recover

    _report(recover(log, output or log.with_name(f"{log.stem}-recovered.mcap")))


@log_app.command("export")
def log_export(
    log: LogPath,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="PATH", help="a folder, or one .csv file")
    ],
    signals: Annotated[
        list[str] | None,
        typer.Option("--signal", metavar="NAME", help="instance.variable, * for anything; repeatable"),
    ] = None,
    topics: Annotated[
        list[str] | None, typer.Option("--topic", metavar="TOPIC", help="a whole topic; repeatable")
    ] = None,
) -> None:
    """Recorded values as CSV."""
    from orchestrator.log_tools import export

    for file in export(log, output, signals or (), topics or ()):
        print(file)


def _report(verdict: Any) -> NoReturn:
    for sentence in verdict.sentences:
        print(sentence)
    sys.exit(verdict.code)


def _model(track: TrackModel | None) -> str | None:
    return track.value if track else None


def _warn(instance: str, status: int, message: str) -> None:
    """Warnings of components; what is worse ends the run and is its message."""
    if status == FMI_WARNING:
        logging.getLogger("cotrack").warning("%s: %s", instance, message)


def _finite(value: Any) -> Any:
    """JSON knows no NaN."""
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, float) and (value != value or abs(value) == float("inf")):
        return None
    return value


def _print_summary(result: dict[str, Any]) -> None:
    r = result
    print(
        f"{r['scene']} ({r['track']}): {r['status']}, {r['simulated_time']:.6g} s in {r['wall_time']:.3g} s"
        f" ({r['real_time_factor']:.3g} x real time), start-up {r['startup_time']:.3g} s"
    )
    if r["rejected_steps"]:
        print(f"  {r['communication_steps']} steps kept, {r['rejected_steps']} pairs of steps taken back")
    for name, check in r["checks"].items():
        mark = "ok " if check["ok"] else "NOT"
        expected = f"{check['expected']:.7g} +- {check['tolerance']:.3g}"
        print(f"  {mark} {name} = {check['value']:.7g}, expected {expected}")
    for name, value in r["observables"].items():
        print(f"      {name} = {value:.7g}")
    if r["energy"]:
        e = r["energy"]
        print(
            f"  energy: work {e['work']:.6g} J = change {e['change']:.6g} + dissipated {e['dissipated']:.6g}"
            f" + residual {e['residual']:.4g} ({e['residual_relative'] * 100:.3g} %; ports {e['port']:.4g} J)"
        )
    for name, cost in r["components"].items():
        counts = ", ".join(f"{count} {what}" for what, count in cost.items() if what != "wall_time" and count)
        print(f"  {name:12} {cost['wall_time']:8.3f} s  {counts}")
    print(f"  log {r['log']} ({r['log_bytes'] / 1e6:.1f} MB)")
