"""Commands that run a scene: co-simulated (``run``, ``resume``) or monolithic (``truth``)."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from orchestrator.cli import common
from orchestrator.cli.common import (
    EstimateOption,
    JsonLine,
    LogPath,
    NativeOption,
    PartsOption,
    SceneName,
    Settings,
    StopOption,
    TrackOption,
    VehicleOption,
    beside,
    exit_with,
    message_and_status,
    print_json,
    print_message,
    with_vehicle,
)
from orchestrator.files.messages import PROGRESS

if TYPE_CHECKING:
    from orchestrator.scene.kinds import Scene
    from orchestrator.scene.system_scene import SystemScene

Verbose = Annotated[bool, typer.Option("--verbose", help="print the whole summary, not its ten most important lines")]

LogTarget = Annotated[
    Path | None,
    typer.Option(
        "-o", "--output", "--log", metavar="PATH", help="the log, default logs/SCENE-TRACK.mcap, with settings behind"
    ),
]


def run(
    scene: SceneName,
    track: TrackOption = None,
    settings: Settings = None,
    vehicle: VehicleOption = None,
    stop: StopOption = None,
    step: Annotated[
        str | None, typer.Option("--step", metavar="H", help="communication step, '1 ms' or a number")
    ] = None,
    coupling: Annotated[
        str | None,
        typer.Option("--coupling", metavar="NAME", help="coupling scheme, instead of the scene's"),
    ] = None,
    error: Annotated[
        str | None, typer.Option("--error", metavar="E", help="'1%': use the cheapest settings known to reach it")
    ] = None,
    estimate: EstimateOption = True,
    estimate_parts: PartsOption = False,
    analyses: Annotated[
        list[str] | None,
        typer.Option("--for", metavar="ANALYSIS", help="also record what this analysis needs, repeatable"),
    ] = None,
    log: LogTarget = None,
    native: NativeOption = False,
    replaced: Annotated[
        list[str] | None,
        typer.Option("--replace", metavar="NAME=FMU", help="your FMU in place of this part of the scene, repeatable"),
    ] = None,
    as_json: JsonLine = False,
    verbose: Verbose = False,
) -> None:
    """Run a scene, record it, evaluate its checks and estimate its error."""
    PROGRESS.info("%s: the scene is read", scene)
    from orchestrator.execution import summary
    from orchestrator.scene.fmu_table import replacing_fmus

    result, status = summary.empty(scene, track), 2
    overrides = (("stop", stop), ("step", step), ("coupling", coupling))
    changes = [*with_vehicle(vehicle, settings), *(f"run.{k}={v}" for k, v in overrides if v is not None)]
    try:
        estimated = common.estimated(estimate, estimate_parts)
        changes += replacing_fmus(replaced or ())
        resolved = _scene_to_run(scene, track, changes, error, analyses or ())
        from orchestrator.execution.simulate import simulate

        path = log or Path("logs") / resolved.log_name
        result = simulate(resolved, path, estimated=estimated, native=native)
        status = 0 if summary.is_passed(result) else 1
    except KeyboardInterrupt:
        result["message"], result["status"], status = "interrupted", "interrupted", 1
    except Exception as failure:
        result["message"], status = message_and_status(failure)
    _report(result, status, as_json, verbose)


def _report(result: Mapping[str, Any], status: int, as_json: bool, verbose: bool) -> NoReturn:
    """Print the summary of a run, unless its input was bad, and exit."""
    print_message(result["message"], status)
    if as_json:
        print_json(result)
    elif status != 2:
        common.summary(result, verbose)
    sys.exit(status)


def _scene_to_run(
    scene: str, track: str | None, changes: list[str], error: str | None, analyses: Sequence[str]
) -> SystemScene:
    """Return the scene with the cheapest settings known for an ``error``, recording what analyses need."""
    from orchestrator.scene.scene import with_track
    from orchestrator.scene.ssp_scene import load_runnable

    resolved = load_runnable(scene, track, changes)
    if error is not None:
        from orchestrator.execution.precision import cheapest, fraction

        chosen = cheapest(with_track(resolved).name, resolved.variant, fraction(error), scene)
        print(
            f"cotrack: --error {error}: {', '.join(chosen.settings)}; measured error {100 * chosen.error:.2g} %"
            + " of the scene as it is, unknown with the settings given here" * bool(changes),
            file=sys.stderr,
        )
        resolved = load_runnable(scene, track, [*chosen.settings, *changes])
    if analyses:
        from orchestrator.results.analyses.catalogue import require_library

        resolved = with_track(resolved).recording_for(analyses)
        for name in analyses:
            require_library(name)
    return resolved


def resume(
    log: LogPath,
    at: Annotated[
        float | None, typer.Option("--at", metavar="T", help="continue from the last checkpoint by then, s")
    ] = None,
    stop: Annotated[float | None, typer.Option("--stop", metavar="T", help="end, s, instead of the scene's")] = None,
    settings: Settings = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="PATH", help="default LOG-resumed.mcap, LOG-branch-SETTINGS.mcap"),
    ] = None,
    as_json: JsonLine = False,
    verbose: Verbose = False,
) -> None:
    """Continue a run from a checkpoint in its log.

    The new log equals, bit by bit, that of an uninterrupted run; it includes everything before the checkpoint. A run
    that was stopped or killed continues from its last checkpoint. With --set the run branches off there with changed
    numbers of the scene. The states continue unchanged: layout and equilibrium are not computed again.
    """
    from orchestrator.execution import summary
    from orchestrator.execution.resume import resume as go_on
    from orchestrator.scene.settings import file_part, pairs

    window = {"at": at, "stop": stop}
    branch = {key: value for key, value in window.items() if value is not None} | dict(pairs(settings or ()))
    path = output or beside(log, f"-branch{file_part(branch)}.mcap" if settings else "-resumed.mcap")
    result = go_on(log, path, at, stop, settings or ())
    _report(result, 0 if summary.is_passed(result) else 1, as_json, verbose)


def truth(
    scene: SceneName,
    track: TrackOption = None,
    settings: Settings = None,
    vehicle: VehicleOption = None,
    stop: StopOption = None,
    against: Annotated[
        Path | None, typer.Option("--against", metavar="LOG", help="print the error of this run of the scene")
    ] = None,
    as_json: JsonLine = False,
) -> None:
    """Run a scene as a monolith (without co-simulation), converged in its step.

    The monolithic reference has an error estimate and is cached: a second call finds it.
    """
    from orchestrator.execution import truth as module
    from orchestrator.results.difference import differences_of_logs
    from orchestrator.scene.scene import load

    changes = [*with_vehicle(vehicle, settings), *([f"run.stop={stop}"] if stop is not None else ())]
    resolved = load(scene, track, changes)
    if against:
        _check_comparable(against, resolved, scene)
    try:
        converged = module.truth(resolved)
    except module.TruthFailed as failure:
        exit_with(str(failure), 1)
    deviations = differences_of_logs(against, converged.log) if against else {}
    observables = {
        name: {"unit": difference.unit, "difference": difference.absolute, "error": converged.error(name)}
        | ({"off": deviations[name].absolute, "off_relative": deviations[name].relative} if name in deviations else {})
        for name, difference in converged.difference.items()
    }
    result = {
        "scene": resolved.name,
        "track": resolved.variant,
        "log": str(converged.log),
        "coarse_log": str(converged.coarse_log),
        "built": converged.built,
        "internal_step": converged.internal_step,
        "wall_time": converged.wall_time,
        "observables": observables,
    }
    if as_json:
        print_json(result)
        return
    print(f"{'built' if converged.built else 'found'} {converged.log}")
    print(f"  internal step {converged.internal_step:.3g} s, {converged.wall_time:.3g} s of wall time; RMS errors:")
    for name, entry in observables.items():
        line = f"  {name:18} {entry['error']:9.2g} {entry['unit']:4}"
        print(
            line + (f" {against} is off by {entry['off']:.3g}, {entry['off_relative']:.2%}" if "off" in entry else "")
        )


def _check_comparable(against: Path, scene: Scene, name: str) -> None:
    """Raise BadInput if a log is not of the scene; print how its run differs from that of the truth."""
    from orchestrator.log.reader import Log
    from orchestrator.results.difference import SAME_END
    from orchestrator.results.run_data import RunData, given_parts
    from orchestrator.scene.placing import placed
    from orchestrator.scene.same_scene import require_same_scene

    with Log(against) as log:
        run_data = RunData(log)
        require_same_scene((f"{against}", run_data.scene), (f"the truth of {name}", placed(scene).resolved()))
        for component, part in given_parts(run_data).items():
            print_message(f"{against}: {component} is {part}, not the part of cotrack", 0)
        if abs((end := run_data.span[1]) - scene.run.stop) > SAME_END:
            print_message(
                f"{against} ends at t = {end:g} s, the truth at {scene.run.stop:g} s: they are compared up to"
                f" {min(end, scene.run.stop):g} s, without the averages over windows that one does not fill",
                0,
            )
