"""Files of scenes, vehicles and points: tables with changes, texts with changes, other kinds of files."""

from __future__ import annotations

import json
import random
import tomllib
from functools import cache
from importlib import resources
from typing import Any

from orchestrator.scene.scene import scene_names
from tests.fuzz import values

ODD_FILES: tuple[Any, ...] = (
    {"link": "/dev/zero"}, {"link": "/dev/full"}, {"fifo": True}, {"link": "."}, {"link": "none"},
    {"link": "/proc/self/mem"}, {"bytes": "AA==", "times": 50_000_000}, {"bytes": "//79/A==", "times": 3},
    {"bytes": "Ww==", "times": 200_000}, {"bytes": "MCwwCg==", "times": 5_000_000},
)  # fmt: skip
INSERTED = "", "=", "[", "]", '"', "\x00", "\u202e", "[[a]]\n", "a.b.c = 1\n", "\udcff", "{" * 3000, "[" * 3000
FAST = ("hanging_chain", "released_chain", "rig", "sprocket_bench", "straight", "serpentine", "turn", "settle")
POINTS = ("speed_points", "torque_points", "brake_points")
PATH = ("points", "arcs")


@cache
def _file(kind: str, name: str) -> str:
    package, folder = ("orchestrator", "gallery") if kind == "scene" else ("fmus", "vehicles")
    return (resources.files(package) / folder / f"{name}.toml").read_text(encoding="utf-8")


def _changed(text: str, draw: random.Random) -> Any:
    """The text of a table with changes of its structure, or of its characters."""
    if draw.random() < 0.04:
        return draw.choice(ODD_FILES)
    if draw.random() < 0.15:
        at = draw.randrange(len(text))
        inserted = draw.choice(INSERTED)
        return text[:at] + inserted + text[at + draw.choice((0, 1, 40)) :]
    table = tomllib.loads(text)
    for _ in range(draw.choice((1, 1, 2, 4))):
        values.change(table, draw)
    return values.toml(table)


def scenes(draw: random.Random) -> dict[str, Any]:
    """A scene file that is shown."""
    name = draw.choice((*FAST, *scene_names()))
    return {"files": {"s.toml": _changed(_file("scene", name), draw)}, "arguments": ["show", "s.toml"]}


def vehicles(draw: random.Random) -> dict[str, Any]:
    """A vehicle file, alone or as a base."""
    files = {"v.toml": _changed(_file("vehicle", "m113"), draw)}
    setting = draw.choice(("vehicle=v.toml", 'vehicle={base="v.toml"}'))
    return {"files": files, "arguments": ["show", draw.choice(FAST), "--set", setting]}


def points(draw: random.Random) -> dict[str, Any]:
    """A table of points over time or of a path, as a file."""
    rows = []
    for i in range(draw.choice((0, 1, 2, 5, 500))):
        first = draw.choice((i, i, i, i - 2, values.value(draw, 1.0)))
        rows.append([str(first), str(values.value(draw, float(i)) if draw.random() < 0.2 else i)])
    text = draw.choice(("t,v\n", "", "", "\ufeff", "t;v\n", '"', "#\n")) + "".join(
        draw.choice((",", ",", ",", ",,", ";")).join(row) + draw.choice(("\n", "\n", "\r\n", "\r", "\n\n"))
        for row in rows
    )
    content = draw.choice(ODD_FILES) if draw.random() < 0.15 else text
    if draw.random() < 0.3:
        arguments = ["show", "serpentine", "--set", f"driver.{draw.choice(PATH)}=p.csv"]
    else:
        key = f"drive.{draw.choice(('', 'left.', 'steering.'))}{draw.choice(POINTS)}"
        mode = draw.choice(("speed", "torque", "controller"))
        scene = draw.choice(("straight", "turn", "rig"))
        arguments = ["show", scene, "--set", f"drive.mode={mode}", "--set", f"{key}=p.csv"]
    return {"files": {"p.csv": content}, "arguments": arguments}


def commands(draw: random.Random) -> dict[str, Any]:
    """A command line of any command with odd arguments; ``a.mcap`` is a small log."""
    arguments = list(draw.choice(COMMANDS))
    for _ in range(draw.choice((0, 1, 1, 2))):
        option = draw.choice(OPTIONS)
        arguments += [option, *([] if option in FLAGS else [_argument(draw)])]
    if len(arguments) > 1 and draw.random() < 0.7:
        at = draw.randrange(1, len(arguments))
        if not arguments[at].startswith("-"):
            arguments[at] = _argument(draw)
    if len(arguments) > 1 and draw.random() < 0.1:
        del arguments[draw.randrange(len(arguments))]
    if arguments[0] in ("build", "warm") and "none" not in arguments:
        arguments.append("none")  # without a scene they compile for minutes
    return {"arguments": [one.replace("\x00", "") for one in arguments]}


def _argument(draw: random.Random) -> str:
    if draw.random() < 0.5:
        return draw.choice(NAMES)
    one = draw.choice((*values.NUMBERS, *values.TEXTS))
    return one if isinstance(one, str) else str(one) if abs(one) != values.HUGE else json.dumps(one)


NAMES = (
    "a.mcap", "none.mcap", ".", "..", "/", "/dev/null", "/dev/full", "a.mcap/b", "n" * 300, "n" * 300 + ".csv",
    "n" * 300 + ".png", "n" * 300 + ".mcap", "b.mcap", "out", "out.csv", "out.png", "out.parquet", "out.html",
    "out.svg", "\udcff.mcap", "-1", "chain", "chain.tension.max", "chain.link[*].tension", "*", "[", "chain.*",
    "link[*", "time", "travel", "chain.tension.max=1", "chain.tension.max=nan", "0.01", "1e-300", "rigid", "flexible",
)  # fmt: skip
FLAGS = (
    "--json", "--bits", "--different", "--signals", "--order", "--teeth", "--spectrum", "--waterfall", "--place",
    "--above", "--markdown", "--phases",
)  # fmt: skip
OPTIONS = (
    *FLAGS, "--from", "--to", "--at", "-o", "--signal", "--topic", "--track", "--bins", "--sn", "--shape", "--link",
    "--align", "--allow", "--component", "--set", "--stop", "--step", "--as", "--colour", "--seen-from", "--for",
    "--vary", "--map", "--with", "--shift", "--clock",
)  # fmt: skip
RUN = "run hanging_chain --set chain.links=8 --set expect={} --stop 0.002 --no-estimate"
ANALYSES = (
    "power spectrum envelope fatigue joints links"
    " deformation ride events phases validity slip patches contact wheel-loads"
)
COMMANDS = [one.split() for one in (
    "keys", "keys friction", "keys friction --json", "keys --markdown", "schema scene", "schema vehicle",
    "new scene own", "new vehicle own", "new scene own --from turn", "new vehicle own --from a.mcap", "scenes",
    "show rig", "log info a.mcap", "log verify a.mcap", "log recover a.mcap -o b.mcap", "log recover a.mcap",
    "log export a.mcap -o out.csv", "log export a.mcap -o out", "compare a.mcap a.mcap",
    "compare a.mcap a.mcap --align travel", "compare a.mcap a.mcap --bits", "view a.mcap -o out.png",
    "plot a.mcap chain.tension.max -o out.png", "report a.mcap -o out.html",
    *(f"analyse a.mcap {what}" for what in ANALYSES.split()), "replay a.mcap --component chain",
    "resume a.mcap -o b.mcap --stop 0.02", "study none rig", "truth none", "run none", "build none -o out",
    "warm none", f"{RUN} --log b.mcap", f"{RUN} --for fatigue --for links --log b.mcap",
)]  # fmt: skip
