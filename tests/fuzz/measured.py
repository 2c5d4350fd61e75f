"""CSV files of tests beside a log: clocks, units, encodings and cells of all sorts; commands that read them."""

from __future__ import annotations

import base64
import math
import random
from collections.abc import Sequence
from typing import Any

from tests.fuzz import values
from tests.fuzz.tables import ODD_FILES

SIGNALS = {
    "chain.tension.max": "N", "chain.link[3].tension": "kN", "chain.energy.strain": "J",
    "chain.joint[2].position.z": "m",
}  # fmt: skip
ODD = 0.03  # probability of each oddity
NO_SIGNALS = ("chain.none", "", "chain.link[*].tension", "*")
ENCODINGS = ("utf-8-sig", "utf-16", "utf-16-le", "latin-1", "cp1252", "cp037")
CLOCKS = ("TIME (ms)", "t, us", "clock", "t [h]", "t [kg]", "Zeit", "t [1/0]", "")
UNITS = (
    "", "N", "kN", "J", "m", "mm", "m/s", "-", "1", "%", "\u00b0", "\u00b5m", "lbf", "kgf", "N*m", "N\u00b7m",
    "kN/m^2", "m/s\u00b2", "1/0", "0 N", "-N", "N N N", "degC", "degF", "dB", "nan", "inf N", "1e400 N",
    "10**10**10 m", "N**-1e9", "kmph", "km/h", "Grad", "Grad/s", "mil", "m/s2", "mm/s2", "N/mm2", "g", "RPM", "1/min",
    "KN", "\u00b0/s", "kkN", "ton", "daN", "kgm", "Nm/rad", "N/(m s)", "m^-9", "1/s/s", "U/min", "MPa/s", "rad/s^2",
    "t", "bar", "psi", "__import__('os')", "(", ")", "[[", "\x00", "'", "x" * 300, "m" * 20_000, "furlong/fortnight",
)  # fmt: skip
NUMBERS = (
    "nan", "NaN", "inf", "-inf", "Infinity", "1e400", "-1e400", "1e308", "-1e308", "4.94e-324", "1_000", "0x10",
    "1,5", " 3 ", "", " ", "-", "--", "#N/A", "1e", ".", "+-1", "\u0663", "1\u00a0000", "true", "9" * 400,
    "9" * 70_000, '"', "=1+1",
)  # fmt: skip


def draw(chance: random.Random) -> dict[str, Any]:
    """A case: a file, columns of it for signals of ``a.mcap``, and a command that compares or draws both."""
    signals = [_rarely(chance, one, NO_SIGNALS) for one in chance.sample([*SIGNALS], chance.choice((1, 1, 2, 4)))]
    content, clock = _file(chance, signals)
    mapped = [
        _rarely(chance, f"{one}={column}", _maps(chance, one)) for one, column in zip(signals, "abcd", strict=False)
    ]
    options = [word for text in _rarely(chance, mapped, ([],)) for word in ("--map", text)]
    if chance.random() < 0.2 or clock not in ("t", "time"):
        options += ["--clock", _rarely(chance, clock, (*CLOCKS, "none", "a", "t:ms"))]
    if chance.random() < 0.7:
        shift = chance.choice(("find", "find", "find", "0.002", "-0.01"))
        options += ["--shift", _rarely(chance, shift, ("1e9", "nan", "late", "", "1e308", "-1e-300"))]
    match chance.randrange(3):
        case 0:
            allow = ("--allow 0.5", "--allow chain.tension.max=nan")
            more = chance.choice(("", "", "", "--json", "--json", *allow, "--phases", "--bits"))
            arguments = ["compare", "a.mcap", "m.csv", *options, *more.split()]
        case 1:
            names = chance.choice(("", "", signals[0], "chain.link[*].tension", "none")).split()
            more = _rarely(chance, "", ("--spectrum", "--place"))
            arguments = ["plot", "a.mcap", *names, "--with", "m.csv", *options, "-o", "out.png", *more.split()]
        case _:
            reference = chance.choice(("", "", "a.mcap")).split()
            arguments = ["report", "a.mcap", *reference, "--with", "m.csv", *options, "-o", "out.html"]
    if arguments[0] != "report" and chance.random() < 0.2:
        arguments += ["--from", chance.choice(("0", "0.005", "nan", "-1"))]
        arguments += ["--to", chance.choice(("0.01", "inf", "1e308"))]
    return {"files": {"m.csv": content}, "arguments": [one.replace("\x00", "") for one in arguments]}


def _rarely(draw: random.Random, usual: Any, odd: Sequence[Any]) -> Any:
    return draw.choice(odd) if draw.random() < ODD else usual


def _file(draw: random.Random, signals: list[str]) -> tuple[Any, str]:
    """Content of a file with columns a, b, ... for the signals, and the name of its clock."""
    clock = _rarely(draw, draw.choice(("t", "time", "time [s]")), CLOCKS)
    form = draw.choice(("{} [{}]", "{} ({})", '"{}, {}"'))
    units = [_rarely(draw, SIGNALS.get(one, ""), UNITS) for one in signals]
    heads = [form.format(name, unit) if unit else name for name, unit in zip("abcd", units, strict=False)]
    between = _rarely(draw, draw.choice((",", ";", "\t")), (", ", "|", " "))
    count = _rarely(draw, draw.choice((3, 30, 30, 30, 400, 20_000)), (0, 1, 2))
    lines = [between.join([clock, *heads]), *map(between.join, _rows(draw, count, 1 + len(heads)))]
    if draw.random() < ODD:
        lines.insert(draw.randrange(len(lines)), draw.choice(("", "# a remark", "\x00", '"open', between * 500)))
    text = _rarely(draw, "\n", ("\r\n", "\r")).join(lines) + draw.choice(("\n", ""))
    content = {"bytes": base64.b64encode(text.encode(_rarely(draw, "utf-8", ENCODINGS), "replace")).decode()}
    return _rarely(draw, content, ODD_FILES), clock.partition(" [")[0]


def _rows(draw: random.Random, count: int, width: int) -> list[list[str]]:
    """Rows of numbers, waves over the time of the log or another time, with odd cells."""
    start = _rarely(draw, draw.choice((0.0, 0.0, 0.0, 1.7e9)), (math.nan, -1e308, 1e11))
    step = _rarely(draw, draw.choice((1e-3, 7e-4, 1.0 / 128.0)), (1e-9, 0.0, -1e-3, 1e6))
    odd = draw.choice((0.0, 0.0, 0.0, 0.01, 0.1)) if count < 1000 else 0.0
    size, rate = _rarely(draw, 1.0, (1e4, 0.0, 1e200, 5e-324)), draw.choice((300.0, 3000.0, 1e5))
    rows = []
    for k in range(count):
        row = [repr(start + k * step), *(repr(size * math.sin(rate * k * step + i)) for i in range(1, width))]
        rows.append([row[0], *(_cell(draw) if draw.random() < odd else cell for cell in row[1:])])
        if odd and draw.random() < 0.005:
            rows[-1] = draw.choice((row[:-1], ["nan", *row[1:]], [_cell(draw) for _ in row]))
    return rows


def _cell(draw: random.Random) -> str:
    usual = draw.choice(("", "", "nan", "inf", repr(draw.uniform(-1.0, 1.0))))
    return str(_rarely(draw, usual, (*NUMBERS, *values.TEXTS)))


def _maps(draw: random.Random, signal: str) -> list[str]:
    """Odd maps of a signal."""
    unit = draw.choice(UNITS)
    return [f"{signal}=a:{unit}", f"{signal}=a:{unit}", f"{signal}=none", f"{signal}=", "=a", signal, f"{signal}=t", ""]
