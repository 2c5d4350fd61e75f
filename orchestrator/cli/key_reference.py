"""Keys of scenes and vehicles, and measures of checks, as texts and as the page ``keys.md``."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby

from orchestrator.results.measures import FIGURES
from orchestrator.results.table import Table
from orchestrator.scene.keys import REQUIRED, Key, facts, table_of

ASSEMBLY = Key._fields.index("assembly")
PAGE = """# Keys of scenes and vehicles

`cotrack keys --markdown` writes this page. Numbers have the unit given, or are texts with one ("2 ms"); the unit 1
is a ratio; none of mechanics may be above 1e17 in SI units. A key without default may be left out, unless it is
required. A vehicle file has the tables of `[vehicle]`, named without `vehicle.`. An entry of a list is set by its
number from 1, `--set "vehicle.road_wheel.x[1]=-0.6 m"`. A scene with assembly = "fmus" has the keys name, title,
assembly, run, expect, fmu and connections alone."""


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
    """Reference of keys and measures as Markdown, a section for each table."""
    keys, blocks = list(keys), [PAGE]
    about = {key.key: key for key in keys}
    for table, rows in groupby(keys, table_of):
        key = about.get(table)
        heads = f"## [{table}]", key and key.meaning, key and key.assembly and f"Assembly: {key.assembly}."
        blocks += ["\n\n".join(filter(None, heads)) if table else "## Scene", _markdown(rows)]
    if measured := list(measured):
        blocks += ["## Measures", _markdown(measured)]
    return "\n\n".join(blocks)


def _markdown(rows: Iterable[Key]) -> str:
    """Table of keys of one table, without the names of the table and columns that are empty in all rows."""
    short = [(f"`{key.key.rpartition('.')[2]}`", *key[1 : ASSEMBLY + 1]) for key in rows]
    of_some = len({row[ASSEMBLY] for row in short}) > 1
    used = [k for k in range(ASSEMBLY + of_some) if any(row[k] for row in short)]
    columns = [(Key._fields[k], "") for k in used]
    return Table.of("", columns, [[row[k] for k in used] for row in short]).markdown().rstrip()
