"""Values that readers do not expect, changes of tables, and tables as TOML."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

HUGE = 10**400
NUMBERS = (
    0, -1, 1, 2, 3, 0.5, -0.0, 1e-6, -1e-6, 1e-9, 4.94e-324, 1e-310, 1e-300, 1e15, 1e19, -1e19, 1e300, 1e308, -1e308,
    math.nan, math.inf, -math.inf, 2**31, 2**63, 2**64, HUGE, -HUGE, True, False,
)  # fmt: skip
TEXTS = (
    "", " ", "x", "\u00fc\u20ac\U0001f600", "\x00", "\x1b[2J", "a\nb", "9" * 400, "y" * 3000, "../../evil", ".", "/",
    "/dev/zero", "/dev/null", "/proc/self/mem", "none.csv", "none.toml", "1 kg", "1 s", "0 s", "-1 ms", "1e400 s",
    "nan s", "9**9**9 s", "1 m/s^2", "1 parsec", "1 kmph", "3 Grad", "2 mil", "5 m/s2", "1 N/mm2", "1 g", "9 RPM",
    "1 1/min", "2 KN", "1 \u00b0/s", "=1+1", "nan", "flexible", "rigid", "spring", "true", "%s%n", "{}", "[",
    "\u202e", "\ufffe",
)  # fmt: skip
OTHERS: tuple[Any, ...] = (
    [], [[]], {}, {"a": 1}, [math.nan], [[0, math.nan], [1, 1]], [[0.0, 1.0], [0.0, 2.0]], [1, "x"], [[[[[[]]]]]],
    [0] * 2000, {"": {"": ""}}, ["1 m", "1 kg"],
)  # fmt: skip


def value(draw: random.Random, near: Any = None) -> Any:
    """A value: far from or close to what is expected there."""
    if isinstance(near, bool) or not isinstance(near, int | float) or abs(near) > 1e250 or draw.random() < 0.5:
        return deepcopy(draw.choice(draw.choice((NUMBERS, NUMBERS, TEXTS, OTHERS))))
    factor = draw.choice((-1.0, 0.1, 0.5, 0.9, 1.1, 2.0, 10.0, 1e3, 1e6, 1e12, 1e18, 1e-3, 1e-6, 1e-12))
    return round(near * factor) if isinstance(near, int) and draw.random() < 0.8 else near * factor


def places(table: Any) -> Iterator[tuple[Any, Any]]:
    """Yield every (dict, key) and (list, index) within a value."""
    entries = table.items() if isinstance(table, dict) else enumerate(table) if isinstance(table, list) else ()
    for key, inner in entries:
        yield table, key
        yield from places(inner)


def change(table: Any, draw: random.Random) -> None:
    """Change a table at one place: another value, nothing, another key, deeper, twice."""
    holder, key = draw.choice(list(places(table)))
    match draw.randrange(8):
        case 0:
            del holder[key]
        case 1 if isinstance(holder, dict):
            name = draw.choice((f"{key}s", "", "x", key.upper(), "base", "\u00fc", "a.b", "y" * 500))
            holder[name] = holder.pop(key)
        case 2:
            deep = holder[key]
            for _ in range(draw.choice((1, 2, 30, 90))):
                deep = draw.choice(([deep], {"a": deep}))
            holder[key] = deep
        case 3 if isinstance(holder, list):
            holder.insert(key, deepcopy(holder[key]))
        case 4:
            other, at = draw.choice(list(places(table)))
            holder[key] = deepcopy(other[at])
        case _:
            holder[key] = value(draw, holder[key])


def text(one: Any) -> str:
    """A value as TOML, tables inline."""
    if isinstance(one, bool):
        return str(one).lower()
    if isinstance(one, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {text(inner)}" for key, inner in one.items()) + "}"
    if isinstance(one, list | tuple):
        return "[" + ", ".join(map(text, one)) + "]"
    if isinstance(one, str):
        return json.dumps(one).replace("\\ud83d\\ude00", "\U0001f600")
    return repr(one).replace("e+", "e")


def toml(table: dict[str, Any]) -> str:
    """A table as the text of a TOML file, one line a key."""
    return "".join(f"{json.dumps(key)} = {text(inner)}\n" for key, inner in table.items())
