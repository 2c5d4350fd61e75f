"""Commands ``cotrack log ...``: info, verify, recover, export."""

from __future__ import annotations

import json
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from orchestrator.cli import printed
from orchestrator.cli.common import LogPath
from orchestrator.cli.printed import plain
from orchestrator.results.validity.entry import recorded

JsonOption = Annotated[bool, typer.Option("--json", help="one JSON object on stdout")]
app = typer.Typer(help="Inspect, verify, recover or export a log.", no_args_is_help=True, rich_markup_mode=None)


@app.command("info")
def info(
    log: LogPath,
    signals: Annotated[bool, typer.Option("--signals", help="print name and unit of every signal, by topic")] = False,
    as_json: JsonOption = False,
) -> None:
    """Print the contents of a log and the status of its run."""
    from orchestrator.log import tools
    from orchestrator.log.log_format import checkpoint_step

    about = tools.info(log)
    points = {name: size for name, size in about.attachments.items() if checkpoint_step(name) is not None}
    held, closing = about.log, about.log.closing or {"message": "", "warnings": []}
    cut = "still being written" if held.being_written else "cut off"
    ended = f"{closing['status']} after {closing['steps']} steps" if held.closing else cut
    lines = [
        f"{held.path}: {held.size / 1e6:.2f} MB, {about.start:g} to {about.end:g} s, {ended}",
        *(f"  {sentence}" for sentence in (closing["message"], *held.faults) if sentence),
        *(f"  {printed.warning(each)}" for each in closing["warnings"]),
        *(f"  {printed.validity(each)}" for each in recorded(closing.get("results", {}))),
        *(
            f"  {record}: {', '.join(f'{key} = {value}' for key, value in entries.items())}"
            for record, entries in held.metadata.items()
        ),
        *(
            f"  {topic:22} {len(held.topics[topic].names):5} signals, {tally.messages:7} messages,"
            f" one step in {held.topics[topic].every}, {tally.bytes / 1e6:.2f} MB"
            for topic, tally in about.topics.items()
        ),
        *(f"  {topic:22} {kind} for other tools" for topic, kind in held.others.items()),
        *(f"  attached: {name}, {size} bytes" for name, size in about.attachments.items() if name not in points),
        *(
            [f"  {len(points)} checkpoints, {sum(points.values())} bytes: 'cotrack resume' continues from one"]
            * bool(points)
        ),
        f"  digest {about.digest or 'none: a part is damaged'}",
    ]
    if as_json:
        print(json.dumps(printed.finite(_info_as_json(about))))
        return
    for line in lines:
        print(plain(line))
    if signals:
        for topic, each in held.topics.items():
            print(plain(f"{topic}:"))
            for name, unit in zip(each.names, each.units, strict=True):
                print(plain(f"  {name} [{unit}]"))


def _info_as_json(about: Any) -> dict[str, Any]:
    """Return the JSON object of an ``Info``."""
    held = about.log
    return {
        "log": str(held.path),
        "bytes": held.size,
        "start": about.start,
        "end": about.end,
        "complete": held.complete,
        "being_written": held.being_written,
        "faults": held.faults,
        "closing": held.closing,
        "metadata": held.metadata,
        "topics": {
            topic: {
                "signals": [list(pair) for pair in zip(each.names, each.units, strict=True)],
                "every": each.every,
                "messages": about.topics[topic].messages,
                "bytes": about.topics[topic].bytes,
            }
            for topic, each in held.topics.items()
        },
        "attachments": about.attachments,
        "digest": about.digest,
    }


@app.command("verify")
def verify(log: LogPath, as_json: JsonOption = False) -> None:
    """Check that a log is whole: exit 0, or 1 if it is broken."""
    from orchestrator.log import tools

    _report(tools.verify(log), as_json)


@app.command("recover")
def recover(
    log: LogPath,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PATH", help="default LOG-recovered.mcap")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Save the complete steps of a broken log: exit 0 without loss, 3 with loss, 1 if nothing is left."""
    from orchestrator.log import tools

    _report(tools.recover(log, output or log.with_name(f"{log.stem}-recovered.mcap")), as_json)


class ExportFormat(StrEnum):
    """File format of an export."""

    csv = "csv"
    parquet = "parquet"
    mat = "mat"


@app.command("export")
def export(
    log: LogPath,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="PATH", help="a folder, or one .csv, .parquet or .mat file")
    ],
    signals: Annotated[
        list[str] | None,
        typer.Option("--signal", metavar="NAME", help="instance.variable, * for any text; repeatable"),
    ] = None,
    topics: Annotated[
        list[str] | None, typer.Option("--topic", metavar="TOPIC", help="a whole topic; repeatable")
    ] = None,
    kind: Annotated[
        ExportFormat | None, typer.Option("--as", help="format of the files in a folder, default csv")
    ] = None,
    start: Annotated[float, typer.Option("--from", metavar="T", help="first instant, s")] = float("-inf"),
    end: Annotated[float, typer.Option("--to", metavar="T", help="last instant, s")] = float("inf"),
) -> None:
    """Export recorded values as CSV, Parquet or MATLAB files."""
    from orchestrator.log.export import export as write

    for file in write(log, output, signals or (), topics or (), (start, end), kind):
        print(file)


def _report(verdict: Any, as_json: bool) -> NoReturn:
    if as_json:
        print(json.dumps({"code": verdict.code, "sentences": verdict.sentences}))
    else:
        for sentence in verdict.sentences:
            print(plain(sentence))
    sys.exit(verdict.code)
