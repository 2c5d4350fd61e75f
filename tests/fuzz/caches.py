"""Damaged files of the cache: two toy FMUs and their kernel must be found whole, or made anew."""

from __future__ import annotations

import json
import logging
import os
import random
import shutil
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from fmus.fmi.build import build_shell
from orchestrator.cosim.component import Component
from tests.fuzz import oracle

TOY = Path(__file__).parents[1] / "toy"
STARTS = (0.1, 0.7)  # m, of the two FMUs
CACHED_FILES = (
    "fmus/*/*", "kernels/*/*", "unpacked/*/modelDescription.xml", "unpacked/*/resources/*",
    "unpacked/*/binaries/linux64/*",
)  # fmt: skip
HOWS = (
    "flip", "cut", "empty", "delete", "twice", "zeros", "folder", "link", "loop", "fifo", "other", "other", "other",
    "other",
)  # fmt: skip


def draw(chance: random.Random) -> dict[str, Any]:
    """One or two damages of files of the cache."""
    damages = [
        [chance.choice(CACHED_FILES), chance.choice(HOWS), chance.random(), chance.random()]
        for _ in range(chance.choice((1, 1, 2)))
    ]
    return {"damages": damages}


def prepare(folder: Path) -> None:
    """Fill the cache that cases damage, and keep what runs on it compute."""
    fill = partial(_fill, folder / "cache", folder / "answer.json")
    made = oracle.play(fill, oracle.emptied(folder / "filled"), oracle.STARTING, 2 * oracle.STARTING)
    if made.status:
        raise RuntimeError(made.err)


def act(folder: Path, case: dict[str, Any]) -> Callable[[], None]:
    """Action of a case: damage a copy of the cache, then run on it."""
    pristine, answer = folder / "cache", folder / "answer.json"

    def damaged() -> None:
        logging.basicConfig(format="cotrack: %(message)s", level=logging.WARNING, stream=sys.stderr)
        cache = Path("cache").absolute()
        shutil.copytree(pristine, cache)
        for pattern, how, which, place in case["damages"]:
            _damage(sorted(file for file in cache.glob(pattern) if file.is_file()), how, which, place)
        expected = json.loads(answer.read_text())
        for _ in range(2):  # the second run is on the mended cache
            computed = _computed(cache)
            assert computed == expected, f"the run on the damaged cache gives {computed}"
        shutil.rmtree(cache)

    return damaged


def _fill(cache: Path, answer: Path) -> None:
    answer.write_text(json.dumps(_computed(cache)))


def _computed(cache: Path) -> list[list[float]]:
    """Outputs of both FMUs after three steps."""
    os.environ["COTRACK_CACHE"] = str(cache)
    found = []
    for start in STARTS:
        fmu = build_shell(TOY / "toy_fmu.py", {"spare": 3, "start": start}, packages=[TOY])
        with Component(fmu, "toy") as component:
            component.initialise({})
            for i in range(3):
                component.step(i * 1e-3, 1e-3)
            component.read()
            found.append(component.y.tolist())
    return found


def _damage(files: list[Path], how: str, which: float, place: float) -> None:
    if not files:
        return
    file = files[int(which * len(files))]
    content = bytearray(file.read_bytes())
    file.unlink()
    match how:
        case "flip" if content:
            content[int(place * len(content))] ^= 1 << int(8 * place)
            file.write_bytes(content)
        case "cut":
            file.write_bytes(content[: int(place * len(content))])
        case "empty":
            file.touch()
        case "twice":
            file.write_bytes(2 * content)
        case "zeros":
            file.write_bytes(bytes(len(content)))
        case "folder":
            file.mkdir()
        case "link":
            file.symlink_to("/dev/zero")
        case "loop":
            file.symlink_to(file)
        case "fifo":
            os.mkfifo(file)
        case "other":  # the content of another file of the same kind
            others = [other for other in files if other != file]
            if others:
                shutil.copyfile(others[int(place * len(others))], file)
