"""Log surgery: changes of a log's content, written again with right checksums, and changes of its records.

Edits are lists of JSON, so that a find is a small file.
"""

from __future__ import annotations

import json
import random
import struct
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np

from tests.fuzz import values
from tests.support.mutated import PREFIX, Content

Edit = list[Any]
HEAD = struct.Struct("<BQ")
MAGIC = 8  # bytes at both ends
DATA_END, FOOTER = 15, 2
WORDS = (bytes(8).hex(), "ff" * 8, *(struct.pack("<d", one).hex() for one in (float("inf"), -1.0, 1e300, 4.94e-324)))
RECORDS = (
    ("drop", 1), ("drop", 3), ("repeat", 1), ("repeat", 50), ("swap", 0), ("empty", 3), ("kind", 0), ("length", 0),
    ("length", 1), ("length", 2**40), ("length", 2**63),
)  # fmt: skip
READS: tuple[tuple[str, ...], ...] = (
    ("log", "info"), ("log", "verify"), ("log", "recover", "-o", "saved.mcap"), ("log", "export", "-o", "out.csv"),
    ("log", "export", "-o", "csv"), ("compare", "whole.mcap"), ("compare", "whole.mcap", "--different"),
    ("compare", "whole.mcap", "--bits"),
    ("analyse", "links"), ("analyse", "links"), ("analyse", "links"), ("analyse", "links", "--by", "place"),
    ("analyse", "fatigue"), ("analyse", "validity"), ("analyse", "events"),
    ("analyse", "deformation"), ("analyse", "spectrum", "--signal", "chain.*"), ("view", "-o", "out.png"),
    ("report", "-o", "out.html"),
    ("plot", "chain.link[*].tension", "--waterfall", "-o", "out.png"), ("replay", "--component", "chain"),
    ("resume", "-o", "b.mcap"),
)  # fmt: skip


def content(path: Path) -> Content:
    """Content of a base log."""
    return Content(path)


def write(base: Content, edits: list[Edit], path: Path) -> None:
    """Write a base log with edits."""
    altered = deepcopy(base)
    for edit in edits:
        _apply(altered, edit)
    altered.write(path)
    if records := [edit for edit in edits if edit[0] == "record"]:
        _rewrite(path, records)


def _apply(log: Content, edit: Edit) -> None:
    match edit:
        case ["attachment", name, *place, value]:
            log.attachments[name] = json.dumps(_with(json.loads(log.attachments[name]), place, value)).encode()
        case ["bytes", name, at, xor]:
            data = bytearray(log.attachments[name])
            data[int(at * len(data))] ^= xor
            log.attachments[name] = bytes(data)
        case ["checkpoint", name, *place, value]:
            saved = log.attachments[name]
            end = 8 + struct.unpack_from("<Q", saved)[0]
            head = json.dumps(_with(json.loads(saved[8:end]), place, value)).encode()
            log.attachments[name] = struct.pack("<Q", len(head)) + head + saved[end:]
        case ["number", name, at, word]:
            data = bytearray(log.attachments[name])
            begin = 8 + struct.unpack_from("<Q", data)[0]
            start = begin + 8 * int(at * ((len(data) - begin) // 8))
            data[start : start + 8] = bytes.fromhex(word)
            log.attachments[name] = bytes(data)
        case ["renamed", name, other]:
            log.attachments[other] = log.attachments.pop(name)
        case ["metadata", name, key, None]:
            log.metadata.get(name, {}).pop(key, None)
        case ["metadata", name, key, text]:
            log.metadata.setdefault(name, {})[key] = text
        case ["topic", number, topic]:
            log.channels[number] = (topic, *log.channels[number][1:])
        case ["about", number, key, *place, value]:
            about = log.channels[number][2]
            about[key] = json.dumps(_with(json.loads(about[key]), place, value))
        case ["words", chunk, part, row, place, word]:
            number, rows, times = log.chunks[chunk][part]
            rows = rows.copy()
            start = PREFIX + int(place * (rows.shape[1] - PREFIX)) if place >= 0 else 11
            rows[row, start : start + 8] = list(bytes.fromhex(word))[: rows.shape[1] - start]
            log.chunks[chunk][part] = number, rows, times
        case ["times", chunk, part, row, time]:
            log.chunks[chunk][part][2][row] = time
        case ["messages", chunk, part, first, step]:
            number, rows, times = log.chunks[chunk][part]
            log.chunks[chunk][part] = number, rows[first::step].copy(), times[first::step].copy()
        case ["empty", count]:
            rows = np.zeros((count, 9), np.uint8)
            rows[:, 0] = 0x80  # a record of a kind that readers skip, without content
            log.chunks.append([(next(iter(log.channels)), rows, np.zeros(count, np.uint64))])


def _with(table: Any, place: list[Any], value: Any) -> Any:
    """Table with another value at a place; without it for the value "__none__"."""
    if not place:
        return value
    *path, last = place
    holder = table
    for key in path:
        holder = holder[key]
    if value == "__none__":
        del holder[last]
    else:
        holder[last] = value
    return table


def _rewrite(path: Path, edits: list[Edit]) -> None:
    """Rewrite a log's records without its summary."""
    data, at, records = path.read_bytes(), MAGIC, []
    while data[at] not in (DATA_END, FOOTER):
        size = HEAD.size + HEAD.unpack_from(data, at)[1]
        records.append(data[at : at + size])
        at += size
    for _, what, place, argument in edits:
        k = int(place * len(records))
        match what:
            case "drop":
                del records[k : k + argument]
            case "repeat":
                records[k:k] = [records[k]] * argument
            case "swap":
                other = int(argument * len(records))
                records[k], records[other] = records[other], records[k]
            case "kind":
                records[k] = bytes([argument]) + records[k][1:]
            case "length":
                records[k] = HEAD.pack(records[k][0], argument) + records[k][HEAD.size :]
            case "empty":
                records.insert(k, HEAD.pack(0x80, 0) * argument)
    end = HEAD.pack(DATA_END, 4) + bytes(4) + HEAD.pack(FOOTER, 20) + bytes(20)
    path.write_bytes(data[:MAGIC] + b"".join(records) + end + data[:MAGIC])


# --- draws ------------------------------------------------------------------------------------------


def _place(draw: random.Random, table: Any) -> list[Any]:
    """A place in a table of JSON, for `_with`."""
    place: list[Any] = []
    while isinstance(table, dict | list) and table and (not place or draw.random() < 0.85):
        key = draw.choice(list(table)) if isinstance(table, dict) else draw.randrange(len(table))
        place.append(key)
        table = table[key]
    return place


def _value(draw: random.Random) -> Any:
    return "__none__" if draw.random() < 0.2 else values.value(draw)


def _edit(log: Content, draw: random.Random) -> Edit:
    chunk = draw.randrange(len(log.chunks))
    part = draw.randrange(len(log.chunks[chunk]))
    rows = len(log.chunks[chunk][part][1])
    number = draw.choice(list(log.channels))
    match draw.randrange(12):
        case 0 | 1:
            name = draw.choice([name for name in log.attachments if name.endswith(".json")])
            return ["attachment", name, *_place(draw, json.loads(log.attachments[name])), _value(draw)]
        case 2:
            name = draw.choice(list(log.metadata))
            text = draw.choice((None, *values.TEXTS, *map(str, values.NUMBERS)))
            return ["metadata", name, draw.choice([*log.metadata[name], "x"]), text]
        case 3:
            topics = "", "/", "/chain/out", "/chain/links", "/../../evil/out", "x" * 5000, "/a/b/c"
            return ["topic", number, draw.choice(topics)]
        case 4 | 5 | 6:
            about = log.channels[number][2]
            key = draw.choice(list(about))
            entries = json.loads(about[key])
            if key == "names" and len(entries) > 2 and draw.random() < 0.6:
                k = draw.randrange(len(entries))  # a family of other length
                other = draw.choice((entries[k - 1], "link[99].tension", "joint[1].force", "x", ""))
                return ["about", number, key, k, other]
            return ["about", number, key, *_place(draw, entries), _value(draw)]
        case 7:
            return ["words", chunk, part, draw.randrange(rows), draw.choice((-1, draw.random())), draw.choice(WORDS)]
        case 8:
            return ["times", chunk, part, draw.randrange(rows), draw.choice((0, 1, 2**63, 2**64 - 1, 10**18))]
        case 9:
            return ["messages", chunk, part, draw.randrange(rows), draw.choice((1, 2, 3))]
        case 10:
            what, drawn = draw.choice(RECORDS)
            argument: float = {"swap": draw.random(), "kind": draw.randrange(1, 16)}.get(what, drawn)
            return ["record", what, draw.random(), argument]
        case _:
            return ["empty", draw.choice((1, 1000, 3_000_000))]


def logs(bench: Any, draw: random.Random) -> dict[str, Any]:
    """A log with one or two edits, and a command that reads it."""
    base = draw.choice(list(bench.bases))
    edits = [_edit(bench.content(base), draw) for _ in range(draw.choice((1, 1, 2)))]
    name, *rest = draw.choice(READS)
    arguments = [name, rest[0], "mutant.mcap", *rest[1:]] if name == "log" else [name, "mutant.mcap", *rest]
    return {"base": base, "edits": edits, "arguments": arguments}


def checkpoints(bench: Any, draw: random.Random) -> dict[str, Any]:
    """A log whose last checkpoint has edits, and its resumption."""
    base = draw.choice(list(bench.bases))
    log, edits = bench.content(base), []
    names = [name for name in log.attachments if name.startswith("checkpoint/")]
    name = max(names, key=lambda one: int(one.partition("/")[2]))
    head = log.attachments[name]
    table = json.loads(head[8 : 8 + struct.unpack_from("<Q", head)[0]])
    for _ in range(draw.choice((1, 1, 3))):
        match draw.randrange(5):
            case 0:
                edits.append(["checkpoint", name, *_place(draw, table), _value(draw)])
            case 1 | 2:
                edits.append(["number", name, draw.random(), draw.choice(WORDS)])
            case 3:
                edits.append(["bytes", name, draw.random(), 1 << draw.randrange(8)])
            case _:
                edits.append(["renamed", name, f"checkpoint/{draw.choice((0, 1, 7, 19, 10**6, -1, 2**70, ''))}"])
                break
    return {"base": base, "edits": edits, "arguments": ["resume", "mutant.mcap", "-o", "b.mcap", "--json"]}
