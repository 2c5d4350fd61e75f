"""Sweeps of a small chain: texts of ``--vary`` of all sorts, samples, and folders that hold something else."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

from tests.fuzz import settings, values

ODD = 0.06  # probability of each oddity
SMALL = ("chain.links=8", "expect={}", "run.stop=0.002")
RANGES = ("0.7:0.8:2", "0.7:0.8:3", "0.7:0.8", "20:25 kg", "1:2:3:4", "0:0:1", "1e308:-1e308:3", "-1:1:2", "1e-320:1:2")
LISTS = (
    "0.7,0.75", "8,9", "rigid,flexible", "1,1", "1,,2", "1 kg,2 m", "nan,inf", "true,false", "[1],{}", "20 kg, 25 kg",
)  # fmt: skip
KEYS = (
    "chain.span", "vehicle.track.mass", "run.links", "track.model", "run.stop", "track.start", "chain.lnks", "", "x",
)  # fmt: skip
SHORT = "chain.span=0.7,0.75", "track.model=rigid,flexible", "vehicle.track.mass=20,25", "run.links=1,2"
FOLDERS: tuple[dict[str, Any], ...] = (
    {"found": "a file"}, {"found": {"link": "none"}}, {"found": {"link": "."}}, {"found": {"fifo": True}},
    {"found/sweep.json": "[]"}, {"found/sweep.json": {"link": "/dev/zero"}}, {"found/sweep.json": {"fifo": True}},
    {"found/sweep.json": '{"scene": 1, "vary": [' + "9" * 3000 + '], "digest": []}'}, {"found/cases": "a file"},
    {"found/sweep.csv": {"link": "/dev/full"}}, {"found/sweep.png": {"link": "none"}},
)  # fmt: skip


def draw(chance: random.Random) -> dict[str, Any]:
    """A case: a sweep of few runs in one process."""

    def rarely(usual: str, odd: Sequence[str]) -> str:
        return chance.choice(odd) if chance.random() < ODD else usual

    vary = [_vary(chance) for _ in range(chance.choice((1, 1, 2)))]
    if chance.random() < 0.3:
        vary.append(rarely("vehicle.track.mass=18:22", ("vehicle.track.mass=18 kg:22 kg", "chain.span=1:0")))
    options = [word for text in vary for word in ("--vary", text)]
    if any(text.count(":") == 1 for text in vary):
        options += ["--sample", rarely(chance.choice("12"), ("0", "-1", "1.5", "nan", "10000000000", "x"))]
        options += ["--seed", rarely("7", ("-1", "9" * 40, "x"))]
    options += rarely("", ("--keep-logs", "--keep-logs", "--track rigid", "--track none")).split()
    folder = rarely("found", (".", "..", "/dev/null", "/none/none", "n" * 300, "found/a/b", ""))
    fixed = [word for text in SMALL for word in ("--set", text)]
    ending = ["--no-estimate", "--workers", rarely("1", ("0", "-1", "x")), "-o", folder]
    arguments = ["sweep", rarely("hanging_chain", ("none", "none.toml", "")), *fixed, *options, *ending]
    files = chance.choice(FOLDERS) if chance.random() < 2.0 * ODD else {}
    return {"files": files, "arguments": [one.replace("\x00", "") for one in arguments]}


def _vary(draw: random.Random) -> str:
    """A varied key with values whose runs are short."""
    if draw.random() < 0.5:
        text = draw.choice(SHORT)
    elif draw.random() < 0.3:
        text = f"{draw.choice(KEYS)}={draw.choice((*RANGES, *LISTS))}"
    elif draw.random() < 0.7:
        key, _, value = settings.setting(draw, "hanging_chain").partition("=")
        text = f"{key}={value},{values.text(values.value(draw, 1.0))}"
    else:
        text = draw.choice(
            (f"{draw.choice(KEYS)}={draw.choice(values.TEXTS)}", draw.choice(values.TEXTS), "=", "a=b=c")
        )
    key, _, listed = text.partition("=")
    parts = listed.split(":")[:2] if ":" in listed else listed.split(",")
    longest = any(settings.takes_long(f"{key.strip()}={part.strip()}") for part in parts)
    return "chain.span=0.7,0.75" if longest and text != "track.model=rigid,flexible" else text
