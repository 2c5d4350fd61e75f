"""Commands ``cotrack log ...``: info, verify, recover, export."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from enum import StrEnum
from math import inf
from pathlib import Path
from textwrap import shorten
from typing import Annotated, Any, NoReturn

import typer

from orchestrator.cli.common import From, JsonObject, LogPath, To, beside, print_json, print_lines

app = typer.Typer(help="Inspect, verify, recover or export a log.", no_args_is_help=True, rich_markup_mode=None)


@app.command("info")
def info(
    log: LogPath,
    signals: Annotated[bool, typer.Option("--signals", help="print name and unit of every signal, by topic")] = False,
    as_json: JsonObject = False,
) -> None:
    """Print the contents of a log and the status of its run, or the topics and numbers of the bag of a robot."""
    from orchestrator.log import bags, tools
    from orchestrator.log.container import ForeignLog

    try:
        summary = bags.contents(log) if log.suffix in bags.BAGS or log.is_dir() else tools.info(log)
    except ForeignLog:
        summary = bags.contents(log)
    if isinstance(summary, dict):
        print_json({"bag": str(log), "topics": summary}) if as_json else print_lines(_bag_lines(log, summary, signals))
        return
    if as_json:
        print_json(_info_as_json(summary))
        return
    print_lines(_info_lines(summary))
    for topic, entry in summary.log.topics.items() if signals else ():
        pairs = zip(entry.names, entry.units, strict=True)
        print_lines([f"{topic}:", *(f"  {name} [{unit}]" for name, unit in pairs)])


def _bag_lines(path: Path, topics: Mapping[str, Any], whole: bool) -> Iterator[str]:
    """Yield the lines about the topics of a bag, with every number of theirs or the first ones."""
    for topic, one in sorted(topics.items()):
        times = "; {rate:.4g} Hz, received {first:.6g} to {last:.6g} s".format(**one) if one["messages"] else ""
        if stamps := one.get("stamps"):
            first, last = ("not set" if each is None else f"{each:.12g}" for each in (stamps[0], stamps[-1]))
            times += f", header.stamp {first} to {last} s" if any(stamps) else ", no header.stamp"
        yield f"{topic}: {one['type'] or 'no type'}, {one['encoding']}, {one['messages']} messages{times}"
        names = ", ".join(number.removeprefix(topic) for number in one["numbers"]) or "no numbers"
        yield f"  {one['fault'] or (names if whole else shorten(names, 300, placeholder=' ... (--signals: all)'))}"
    numbers = [number for one in topics.values() for number in one["numbers"]]
    for number in sorted(numbers, key=lambda one: not one.endswith(".linear.x"))[:1]:  # ahead, if anything has it
        signal = "chassis.speed" if number.endswith(".linear.x") else "SIGNAL"
        yield f"beside a run: cotrack plot RUN.mcap {signal} --with {path} --map {signal}={number}"


def _info_lines(summary: Any) -> Iterator[str]:
    """Yield the lines about an ``Info``: file and run, messages of the run, contents, digest and seal."""
    opened = summary.log
    cut = "still being written" if opened.being_written else "cut off"
    end = f"{opened.closing['status']} after {opened.closing['steps']} steps" if opened.closing else cut
    yield f"{opened.path}: {opened.size / 1e6:.2f} MB, {summary.start:g} to {summary.end:g} s, {end}"
    yield from (f"  {sentence}" for sentence in _messages(summary))
    for record, entries in opened.metadata.items():
        yield f"  {record}: {', '.join(f'{key} = {value}' for key, value in entries.items())}"
    for topic, tally in summary.topics.items():
        yield (
            f"  {topic:22} {len(opened.topics[topic].names):5} signals, {tally.messages:7} messages,"
            f" one step in {opened.topics[topic].every}, {tally.bytes / 1e6:.2f} MB"
        )
    yield from (f"  {topic:22} {kind} for other tools" for topic, kind in opened.others.items())
    yield from _attached(summary.attachments)
    yield f"  digest {summary.digest or 'none: a part is damaged'}"
    yield f"  seal {opened.seal or 'none'}{', which does not hold' * bool(opened.seal and summary.seal_faults)}"


def _messages(summary: Any) -> Iterator[str]:
    """Yield message, faults, warnings and exceeded limits of the run of an ``Info``."""
    from orchestrator.execution import summary_text
    from orchestrator.results.validity.exceedance import recorded_entries

    closing = summary.log.closing or {"message": "", "warnings": []}
    yield from filter(None, (closing["message"], *summary.log.faults, *summary.seal_faults))
    yield from summary_text.warnings(closing["warnings"])
    yield from summary_text.validity(recorded_entries(closing.get("results", {})))


def _attached(attachments: Mapping[str, int]) -> Iterator[str]:
    """Yield a line for each attachment by its size, bytes, and one for all checkpoints."""
    from orchestrator.log.log_metadata import checkpoint_step

    points = {name: size for name, size in attachments.items() if checkpoint_step(name) is not None}
    yield from (f"  attached: {name}, {size} bytes" for name, size in attachments.items() if name not in points)
    if points:
        yield f"  {len(points)} checkpoints, {sum(points.values())} bytes: 'cotrack resume' continues from one"


def _info_as_json(summary: Any) -> dict[str, Any]:
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
def verify(log: LogPath, as_json: JsonObject = False) -> None:
    """Check that a log is whole: exit 0, or 1 if it is broken."""
    from orchestrator.log import tools

    _report(tools.verify(log), as_json)


@app.command("recover")
def recover(
    log: LogPath,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PATH", help="default LOG-recovered.mcap")
    ] = None,
    as_json: JsonObject = False,
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
    start: From = -inf,
    end: To = inf,
) -> None:
    """Export recorded values as CSV, Parquet or MATLAB files."""
    from orchestrator.log.export import export as write

    for file in write(log, output, signals or (), topics or (), (start, end), kind):
        print(file)


def _report(verdict: Any, as_json: bool) -> NoReturn:
    if as_json:
        print_json({"code": verdict.code, "sentences": verdict.sentences})
    else:
        print_lines(verdict.sentences)
    sys.exit(verdict.code)
