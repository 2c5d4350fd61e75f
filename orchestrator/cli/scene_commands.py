"""Commands about scenes, own files and FMUs: list, show, build, check; keys, schemas, commented files; the cache."""

from __future__ import annotations

import json
import re
import sys
import time
from collections.abc import Mapping
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fmus.track.choices import TRACKS
from fmus.vehicles.tables import BadInput, value_text
from orchestrator.cli import common
from orchestrator.cli.common import (
    JsonLine,
    SceneName,
    Settings,
    TrackOption,
    VehicleOption,
    print_json,
    with_vehicle,
)
from orchestrator.files.messages import PROGRESS

if TYPE_CHECKING:
    from orchestrator.fmu_check.instance import Verdict


def scenes() -> None:
    """List the scenes of the gallery."""
    from orchestrator.scene.scene import read_scene, scene_names

    for name in scene_names():
        print(f"{name:16} {read_scene(name)[1]['title']}")


def vehicles() -> None:
    """List the packaged vehicles."""
    from fmus.vehicles.vehicle import names, read_table, vehicle

    for name in names():
        table = vehicle(*read_table(name))
        links = " and ".join(map(str, dict.fromkeys(table.of_side(side).track.links for side in ("left", "right"))))
        size = f"{table.total_mass():6.0f} kg, {links} links, {len(table.road_wheel.x)} road wheels a side"
        print(f"{name:10} {size}: {table.title}")


def show(scene: SceneName, track: TrackOption = None, settings: Settings = None, vehicle: VehicleOption = None) -> None:
    """Print the parts of a scene with their sizes, and the parts that are left out.

    Of an SSP archive and a free system: the FMUs, their parameters and connections.
    """
    from orchestrator.cli.inventory import lines
    from orchestrator.scene.ssp_scene import load_runnable

    for line in lines(load_runnable(scene, track, with_vehicle(vehicle, settings))):
        print(line)


def build(
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="folder for the FMUs")],
    scene: Annotated[str | None, typer.Argument(metavar="[SCENE]", help="only the FMUs of this scene")] = None,
    everything: Annotated[bool, typer.Option("--all", help="every distinct FMU of the gallery")] = False,
    track: TrackOption = None,
    settings: Settings = None,
    vehicle: VehicleOption = None,
    native: Annotated[bool, typer.Option("--native", help="native FMUs; parameters of the start are constant")] = False,
    windows: Annotated[
        bool, typer.Option("--windows", help="with --native: add libraries for Windows to those for Linux")
    ] = False,
    fmi: Annotated[int, typer.Option("--fmi", metavar="2|3", help="with --native: version of FMI, 2.0 or 3.0")] = 2,
) -> None:
    """Build FMUs whose default parameters are those of the scene.

    Without a scene: the four standard FMUs; with --all: the FMUs of the whole gallery.
    """
    from orchestrator.scene import products
    from orchestrator.scene.scene import load

    if scene is not None and everything:
        raise BadInput("give a scene or --all, not both")
    if windows and not native:
        raise BadInput("--windows needs --native: Python FMUs run on every system that has Python")
    if fmi not in (2, 3):
        raise BadInput(f"--fmi {fmi}: there are FMUs of FMI 2 and 3")
    if fmi == 3 and not native:
        raise BadInput("--fmi 3 needs --native: pythonfmu, which makes Python FMUs, writes FMI 2.0 alone")
    changes = with_vehicle(vehicle, settings)
    models = [track] if track else list(TRACKS)
    if everything:
        requested = products.gallery_products(models, changes)
    elif scene is None:
        requested = products.scene_products([load(products.STANDARD, model, changes) for model in models])
    else:
        requested = products.scene_products([load(scene, track, changes)])
    for file in products.build_to(output, requested, native, windows, fmi):
        print(file)


def ssp(
    scene: SceneName,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="the archive, FILE.ssp")],
    track: TrackOption = None,
    settings: Settings = None,
    vehicle: VehicleOption = None,
    python: Annotated[bool, typer.Option("--python", help="FMUs that run in Python instead of native ones")] = False,
) -> None:
    """Write a scene's FMUs and their connections into one SSP archive, for other tools.

    The FMUs are native ones, for Linux, and for Windows if the compiler ziglang is installed.
    """
    from orchestrator.results.output_files import check_output
    from orchestrator.scene.products import write_ssp
    from orchestrator.scene.scene import load

    check_output(output, (".ssp",))
    write_ssp(load(scene, track, with_vehicle(vehicle, settings)), output, native=not python)
    print(output)


def warm(
    scenes: Annotated[list[str] | None, typer.Argument(help="scenes; default the whole gallery")] = None,
    pack: Annotated[
        Path | None, typer.Option("--pack", metavar="FILE", help="write them for other machines into FILE.pack")
    ] = None,
) -> None:
    """Compile the kernels of scenes before their first run, in one process per core."""
    from orchestrator.execution.warm import packed, variants
    from orchestrator.execution.warm import warm as begun

    pairs, failed = variants(scenes or ()), 0
    for done, (name, message, seconds) in enumerate(packed(pairs, pack) if pack else begun(pairs), 1):
        failed += bool(message)
        print(f"{done}/{len(pairs)} {name}: " + (message or f"starts after {seconds:.1f} s"))
    sys.exit(min(failed, 1))


FileKind = StrEnum("FileKind", ["scene", "vehicle"])
Kind = Annotated[FileKind, typer.Argument(metavar="scene|vehicle", help="kind of file")]


def keys(
    word: Annotated[str, typer.Argument(metavar="[WORD]", help="only keys with a word that begins so")] = "",
    markdown: Annotated[bool, typer.Option("--markdown", help="as a page in Markdown, orchestrator/keys.md")] = False,
    as_json: JsonLine = False,
) -> None:
    """Print the keys of scenes and vehicles, and the measures of checks: unit, allowed values, default, meaning.

    A vehicle file has the keys that begin with "vehicle." without that.
    """
    from orchestrator.cli.key_reference import key_text, measure_keys, page
    from orchestrator.scene.keys import scene_keys
    from orchestrator.scene.settings import derived, near_keys

    begin = re.compile(rf"(?<![^\W_]){re.escape(word)}", re.IGNORECASE)  # of a word, or behind a _ in it
    chosen, measured = (
        [key for key in known if begin.search(f"{key.key}\n{key.meaning}")] for known in (scene_keys(), measure_keys())
    )
    if not chosen and not measured:
        parts, names = re.findall(r"\w+", word), [key.key for key in scene_keys()]
        near = [name for name in names if parts and all(part in name for part in parts)] or near_keys(word, names)
        hints = [derived(word), f"near it are {', '.join(near[:5])}" if near else ""]
        said = f"no key and no measure has a word that begins with {value_text(word)} in its name or meaning"
        raise BadInput("; ".join(filter(None, (said, *hints))))
    if as_json:
        print_json({"keys": [key._asdict() for key in chosen], "measures": [key._asdict() for key in measured]})
    elif markdown:
        print(page(chosen, measured))
    else:
        for text in map(key_text, (*chosen, *measured)):
            print(text)


def schema(kind: Kind) -> None:
    """Print the JSON schema of a scene or vehicle file, with which editors complete and check TOML."""
    from orchestrator.scene import keys

    print(json.dumps(keys.SCHEMAS[kind](), indent=1))


def new(
    kind: Kind,
    name: Annotated[str, typer.Argument(metavar="NAME", help="the file is NAME.toml in the current folder")],
    source: Annotated[
        str | None,
        typer.Option("--from", metavar="NAME", help="scene or vehicle, or its file; default straight, m113"),
    ] = None,
) -> None:
    """Write a commented scene or vehicle file: what the source sets, and as comments all else that may be set."""
    from orchestrator.scene import commented_file

    print(commented_file.new_file(kind, name, source))


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
    from fmus.cache import limit
    from fmus.cache.files import cache_folder

    try:
        largest = limit.limit() if most is None else most * limit.GB
    except ValueError as error:
        raise BadInput(str(error)) from None
    if prune:
        removed = limit.prune(largest, limit.RECENT if most is None else 0.0)
        print(f"removed {len(removed)} folders, {_size(sum(entry.size for entry in removed))}")
    held = limit.entries()
    print(f"{cache_folder()}: {_size(sum(entry.size for entry in held))} of {_size(largest)} at most")
    for kind, about in limit.CACHE_KINDS.items():
        if own := [entry for entry in held if entry.kind == kind]:
            oldest = (time.time() - own[0].used) / 86400.0
            size = _size(sum(entry.size for entry in own))
            print(f"  {kind:10} {about:32} {len(own):5} folders {size:>9}, the oldest used {oldest:.1f} days ago")


def _size(size: float) -> str:
    return f"{1e-9 * size:.2f} GB" if size >= 1e8 else f"{1e-6 * size:.1f} MB"


def check(
    fmus: Annotated[list[Path], typer.Argument(metavar="FMU...", help="FMUs of FMI 2.0 or 3.0 for co-simulation")],
    step: Annotated[
        float | None,
        typer.Option("--step", metavar="H", help="communication step, s; default the FMU's own, else 1 ms"),
    ] = None,
    limit: Annotated[
        float, typer.Option("--limit", metavar="T", help="time limit of a check, s; 1.2 T for all that hang")
    ] = 100.0,
    as_json: JsonLine = False,
) -> None:
    """Check any co-simulation FMUs of FMI 2.0 or 3.0: description, units, dependencies, states, steps,
    calls, memory, and what they leave behind in their process.

    Each check runs in a process of its own, so a crash or a hang of the FMU is a finding. The code of the FMU is run.
    The exit status is 1 if something is wrong.
    """
    from orchestrator.fmu_check import runner

    for name, value in (("--step", step), ("--limit", limit)):
        if value is not None and not 0.0 < value < float("inf"):
            raise BadInput(f"{name} {value:g}: must be a finite number greater than 0")
    for fmu in fmus:
        runner.require_fmu(fmu)
    results = {}
    for fmu in fmus:
        results[fmu] = runner.verdicts(fmu, step, limit, partial(_begin, fmu.name))
        if not as_json:
            _print_table(fmu, results[fmu])
    if as_json:
        print_json({"fmus": [_as_json(fmu, verdicts) for fmu, verdicts in results.items()]})
    sys.exit(int(any(verdict.faults for verdicts in results.values() for verdict in verdicts.values())))


def _begin(fmu: str, name: str) -> None:
    PROGRESS.debug("%s: %s", fmu, name)


def _print_table(fmu: Path, verdicts: Mapping[str, Verdict]) -> None:
    wrong = sum(bool(verdict.faults) for verdict in verdicts.values())
    print(f"{fmu}: " + (f"something is wrong in {wrong} of {len(verdicts)} checks" if wrong else "nothing is wrong"))
    for name, verdict in verdicts.items():
        print(f"  {name:{max(map(len, verdicts))}}  {verdict.result:14}  {common.plain(verdict.detail)}")


def _as_json(fmu: Path, verdicts: Mapping[str, Verdict]) -> dict[str, object]:
    checks = {
        name: {"result": verdict.result, "detail": verdict.detail, "faults": verdict.faults}
        for name, verdict in verdicts.items()
    }
    return {"file": str(fmu), "ok": not any(verdict.faults for verdict in verdicts.values()), "checks": checks}
