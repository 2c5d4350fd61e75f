"""Commands ``cotrack log ...``: info, verify, recover, export."""

from __future__ import annotations

import json
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from orchestrator.cli import common
from orchestrator.cli.common import LogPath, beside, plain
from orchestrator.results.validity.exceedance import recorded_entries

JsonOption = Annotated[bool, typer.Option("--json", help="one JSON object on stdout")]
app = typer.Typer(help="Inspect, verify, recover or export a log.", no_args_is_help=True, rich_markup_mode=None)


@app.command("info")
def info(
    log: LogPath,
    signals: Annotated[bool, typer.Option("--signals", help="print name and unit of every signal, by topic")] = False,
    as_json: JsonOption = False,
) -> None:
    """Print the contents of a log and the status of its run."""
    from orchestrator.execution import summary_text
    from orchestrator.log import tools
    from orchestrator.log.log_metadata import checkpoint_step

    summary = tools.info(log)
    points = {name: size for name, size in summary.attachments.items() if checkpoint_step(name) is not None}
    opened, closing = summary.log, summary.log.closing or {"message": "", "warnings": []}
    cut = "still being written" if opened.being_written else "cut off"
    end = f"{closing['status']} after {closing['steps']} steps" if opened.closing else cut
    lines = [
        f"{opened.path}: {opened.size / 1e6:.2f} MB, {summary.start:g} to {summary.end:g} s, {end}",
        *(f"  {sentence}" for sentence in (closing["message"], *opened.faults, *summary.seal_faults) if sentence),
        *(f"  {summary_text.warning(entry)}" for entry in closing["warnings"]),
        *(f"  {summary_text.validity(entry)}" for entry in recorded_entries(closing.get("results", {}))),
        *(
            f"  {record}: {', '.join(f'{key} = {value}' for key, value in entries.items())}"
            for record, entries in opened.metadata.items()
        ),
        *(
            f"  {topic:22} {len(opened.topics[topic].names):5} signals, {tally.messages:7} messages,"
            f" one step in {opened.topics[topic].every}, {tally.bytes / 1e6:.2f} MB"
            for topic, tally in summary.topics.items()
        ),
        *(f"  {topic:22} {kind} for other tools" for topic, kind in opened.others.items()),
        *(f"  attached: {name}, {size} bytes" for name, size in summary.attachments.items() if name not in points),
        *(
            [f"  {len(points)} checkpoints, {sum(points.values())} bytes: 'cotrack resume' continues from one"]
            * bool(points)
        ),
        f"  digest {summary.digest or 'none: a part is damaged'}",
        f"  seal {opened.seal or 'none'}{', which does not hold' * bool(opened.seal and summary.seal_faults)}",
    ]
    if as_json:
        print(json.dumps(common.finite(_info_as_json(summary))))
        return
    for line in lines:
        print(plain(line))
    if signals:
        for topic, entry in opened.topics.items():
            print(plain(f"{topic}:"))
            for name, unit in zip(entry.names, entry.units, strict=True):
                print(plain(f"  {name} [{unit}]"))


def _info_as_json(summary: Any) -> dict[str, Any]:
    """Return the JSON object of an ``Info``."""
    opened = summary.log
    return {
        "log": str(opened.path),
        "bytes": opened.size,
        "start": summary.start,
        "end": summary.end,
        "complete": opened.complete,
        "being_written": opened.being_written,
        "faults": opened.faults,
        "closing": opened.closing,
        "metadata": opened.metadata,
        "topics": {
            topic: {
                "signals": [list(pair) for pair in zip(channel.names, channel.units, strict=True)],
                "every": channel.every,
                "messages": summary.topics[topic].messages,
                "bytes": summary.topics[topic].bytes,
            }
            for topic, channel in opened.topics.items()
        },
        "attachments": summary.attachments,
        "digest": summary.digest,
        "seal": opened.seal,
        "seal_faults": summary.seal_faults,
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

    _report(tools.recover(log, output or beside(log, "-recovered.mcap")), as_json)


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
