"""Keys of scenes and vehicles, and measures of checks, as texts and as the page ``keys.md``."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby

from orchestrator.results.measures import FIGURES
from orchestrator.scene.keys import REQUIRED, Key, facts, table_of

PAGE = """# Keys of scenes and vehicles

`cotrack keys --markdown` writes this page, `cotrack keys WORD` prints the keys of a word. Numbers have the unit
given, or are texts with one ("2 ms"); a ratio has the unit 1; none of mechanics may be above 1e17 in SI units. A key
without default may be left out, unless it is required. A vehicle file has the tables of `[vehicle]`, named without
`vehicle.`. An entry of a list is set by its number from 1, `--set "vehicle.road_wheel.x[1]=-0.6 m"`. A scene with
assembly = "fmus" has the keys name, title, assembly, run, expect, fmu and connections alone. In brackets: unit,
allowed values, default. Where a table has the keys of another one, a sentence says so in place of a list: unit,
values and meaning are the same, and the default too if nothing else is said."""
HIGH = "Of these {} have a second one, with `_high` behind the name: the value below which 99.9 % of the records are."
FEWEST = 3  # keys in common from which a table refers to another one


def measure_keys() -> list[Key]:
    """All figures that checks may name."""
    figures = FIGURES.values()
    return [Key(one.name, one.unit, "", "", f"{one.meaning}{one.none and '; none '}{one.none}") for one in figures]


def key_text(key: Key) -> str:
    """Key in two lines: unit, allowed values and default; meaning."""
    default = key.default if key.default in ("", REQUIRED) else f"default {key.default}"
    kinds, solved = key.assembly and f"assembly {key.assembly}", "solved by the run" * key.solved
    return f"{key.key}: {', '.join(filter(None, (facts(key), default, kinds, solved)))}\n    {key.meaning}"


def page(keys: Iterable[Key], measured: Iterable[Key]) -> str:
    """Reference of keys and measures as Markdown, a section for each table, without keys that repeat another table."""
    keys, blocks = list(keys), [PAGE]
    named = {key.key: key for key in keys}
    tables: dict[str, list[Key]] = {}
    for table, found in groupby(keys, table_of):  # [vehicle] is among the tables of a scene and of a vehicle
        tables[table] = [*tables.pop(table, []), *found]
    shown: dict[str, list[Key]] = {}
    for table, rows in tables.items():
        key = named.get(table)
        kinds = key.assembly if key else ""
        about = (key.meaning, f"Assembly: {kinds}." if kinds else "") if key else ()
        heads = [f"## [{table}]", *about] if table else ["## Scene"]
        own, sentence = _without_repeats(rows, shown)
        shown[table] = rows
        inner = [_inner(row, kinds) for row in own if row.key in tables and not row.key.endswith(".NAME")]
        own = [row for row in own if row.key not in tables]
        blocks += filter(
            None, [*heads, sentence, _markdown(own, kinds), f"Tables: {'; '.join(inner)}." if inner else ""]
        )
    if measured := list(measured):
        names = {one.key for one in measured}
        highs = [f"{name}_high" for name in names if f"{name}_high" in names]
        rows = [
            one._replace(meaning=re.sub(rf", {re.escape(one.unit)}(?=[;,]|$)", "", one.meaning))  # it is in brackets
            for one in measured
            if one.key not in highs
        ]
        both = [f"`{one.key}`" for one in rows if f"{one.key}_high" in highs]
        blocks += filter(None, ["## Measures", _markdown(rows, ""), HIGH.format(_listed(both)) if both else ""])
    return "\n\n".join(blocks)


def _without_repeats(rows: list[Key], shown: Mapping[str, Sequence[Key]]) -> tuple[list[Key], str]:
    """Keys that no table shown before has, and a sentence about the others."""
    best: tuple[str, list[Key]] = ("", [])
    bare = not any(key.default for key in rows)
    for other, others in shown.items():
        known = {_name(each): each for each in others}
        same = [key for key in rows if (each := known.get(_name(key))) and _same(key, each, bare)]
        if len(same) > len(best[1]) and (len(same) >= FEWEST or 2 <= len(same) == len(rows)):
            best = other, same
    other, same = best
    if not same:
        return rows, ""
    known, names = {_name(each): each for each in shown[other]}, {_name(key) for key in rows}
    lacks = [f"`{name}`" for name in known if name not in names]
    changed = [f"`{_name(key)}`" for key in rows if key not in same and _name(key) in known]
    words = [f"but for {_listed(lacks)}" if lacks else "", f"with another {_listed(changed)}" if changed else ""]
    without = bare and any(known[_name(key)].default not in ("", REQUIRED) for key in same)
    sentence = f"{', '.join(filter(None, [f'The keys of `[{other}]`', *words]))}.{' None has a default.' * without}"
    return [key for key in rows if key not in same], sentence


def _same(key: Key, other: Key, bare: bool) -> bool:
    """Is a key that of another table; if bare, whatever the other's default?"""
    same = (key.unit, key.allowed, key.meaning) == (other.unit, other.allowed, other.meaning)
    return same and (bare or key.default == other.default)


def _name(key: Key) -> str:
    return key.key.rpartition(".")[2]


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def _value(key: Key, kinds: str) -> str:
    """Unit, allowed values and default; kinds of scenes if they are not those of its table."""
    default = key.default if key.default in ("", REQUIRED) else f"default {key.default}"
    of_some = f"assembly {key.assembly}" if key.assembly not in ("", kinds) else ""
    values = re.sub(r"(^|, )(.+) or list of \2$", r"\1\2, or a list", facts(key))
    return ", ".join(filter(None, (values, default, of_some, "solved by the run" * key.solved)))


def _inner(key: Key, kinds: str) -> str:
    """Key whose values are a table of the page, with a link; what else it may be."""
    value = ", ".join(part for part in _value(key, kinds).split(", ") if part != "table")
    return f"[`{_name(key)}`](#{key.key.replace('.', '').lower()}){f' ({value})' * bool(value)}"


def _markdown(rows: Iterable[Key], kinds: str) -> str:
    """List of keys of one table, without its name: unit, values and default in brackets, then the meaning."""
    return "\n".join(f"- `{_name(key)}` ({_value(key, kinds)}): {key.meaning}" for key in rows)
