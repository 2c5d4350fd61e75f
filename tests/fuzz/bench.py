"""Bench on which cases are played: files that are made once, and the way from a case to its faults.

A case is an object of JSON: ``kind`` and ``arguments`` of a command line; ``files`` by name (text, or {"link": target},
{"fifo": true}, {"bytes": base64}); ``edits`` of the base log, which becomes ``mutant.mcap``; or what its kind defines.
"""

from __future__ import annotations

import base64
import gc
import os
import struct
import sys
from collections.abc import Collection, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from orchestrator.cli import main
from tests.fuzz import caches, grounds, guests, logs, oracle, sequences

Case = dict[str, Any]
SMALL = ("--set", "chain.links=8", "--set", "run.links=7", "--set", "expect={}", "--set", "run.checkpoints=0.005")
ENDING = ("--no-estimate", "--json")
BASES = {
    "chain": ("run", "hanging_chain", *SMALL, "--stop", "0.02", *ENDING),
    "rigid": ("run", "hanging_chain", "--track", "rigid", *SMALL, "--stop", "0.02", *ENDING),
}
SWEEP = (
    "sweep", "hanging_chain", *SMALL, "--set", "run.stop=0.002", "--vary", "chain.span=0.7,0.75", "--no-estimate",
    "--workers", "1",
)  # fmt: skip
FOUND = ("--map", "chain.tension.max=chain.tension.max [N]", "--shift", "find")
WARM = (("show", "straight"), ("show", "rig", "--set", "rig.tension=1 lbf"), ("--help",))
LOG_KINDS = ("logs", "checkpoints")
CALLING = {"calls", "states"}  # kinds that call an FMU
READING = ("commands", "measured")  # kinds that read the base log as it is


class Bench:
    """Folder with the base logs, in a process that has loaded what commands load."""

    def __init__(self, folder: Path, kinds: Collection[str]) -> None:
        self.folder = folder
        self.room = folder / "room"
        self.bases = {name: folder / f"{name}.mcap" for name in BASES}
        oracle.describe_by_fork()
        for name, arguments in BASES.items():
            with _quiet(folder / "start.txt"):
                status = _status([*arguments, "--log", str(self.bases[name])])
            if status:
                raise RuntimeError((folder / "start.txt").read_text(encoding="utf-8"))
        with _quiet(folder / "start.txt"):  # loads what these commands import
            _status(["analyse", str(self.bases["chain"]), "links"])
            _status(["report", str(self.bases["chain"]), "-o", str(folder / "page.html")])
            for arguments in WARM:
                _status([*arguments])
            _status(["plot", str(self.bases["chain"]), "chain.tension.max", "-o", str(folder / "plot.png")])
            if "sweeps" in kinds:
                _status([*SWEEP, "-o", str(folder / "sweep")])
            if "measured" in kinds:
                _status(["log", "export", str(self.bases["chain"]), "-o", str(folder / "m.csv")])
                _status(["compare", str(self.bases["chain"]), str(folder / "m.csv"), *FOUND])
        self._logs: dict[str, Any] = {}
        if "caches" in kinds:
            caches.prepare(folder)
        if not CALLING.isdisjoint(kinds):
            sequences.prepare()
        if "guests" in kinds:
            guests.prepare(folder)
        gc.collect()
        gc.freeze()

    def content(self, base: str) -> Any:
        """Content of a base log, read once; must not be modified."""
        if base not in self._logs:
            self._logs[base] = logs.content(self.bases[base])
        return self._logs[base]

    def play(self, case: Case) -> list[str]:
        """Play a case; what is wrong, as sentences. One that hangs is played again: a true hang is seen twice.

        A machine without free memory, or a busy one, has stopped a case that takes 0.1 s of a processor.
        """
        wrongs = self._play(case)
        return self._play(case) if any(wrong.startswith("hang: ") for wrong in wrongs) else wrongs

    def _play(self, case: Case) -> list[str]:
        room = oracle.emptied(self.room)
        if case["kind"] == "caches":
            return oracle.wrongs(oracle.play(caches.act(self.folder, case), room))
        if case["kind"] == "grounds":
            return oracle.wrongs(oracle.play(grounds.act(case), room, oracle.STARTING))
        if case["kind"] in CALLING:
            return oracle.wrongs(oracle.play(sequences.act(case), room, oracle.STARTING, oracle.STARTING))
        for name, content in case.get("files", {}).items():
            (room / name).parent.mkdir(exist_ok=True)
            _lay(room / name, content)
        if case["kind"] in READING:
            os.link(self.bases["chain"], room / "a.mcap")
        if case["kind"] in LOG_KINDS:
            try:
                logs.write(self.content(case["base"]), case["edits"], room / "mutant.mcap")
            except (LookupError, TypeError, ValueError, OverflowError, struct.error):
                return []  # no record can hold it, or an edit does not fit what an earlier one left
            os.link(self.bases[case["base"]], room / "whole.mcap")
        cpu = oracle.STARTING if case["kind"] in ("sweeps", "guests") else oracle.CPU
        wall = oracle.STARTING if case["kind"] == "guests" else oracle.WALL  # FMUs run in processes of their own
        ended = oracle.play(oracle.command(case["arguments"]), room, cpu, wall)
        return oracle.wrongs(ended, refusal_is_alone=case["kind"] not in LOG_KINDS)


def _lay(path: Path, content: Any) -> None:
    if isinstance(content, str):
        path.write_bytes(content.encode("utf-8", "surrogatepass"))
    elif "link" in content:
        path.symlink_to(content["link"])
    elif "fifo" in content:
        os.mkfifo(path)
    else:
        path.write_bytes(base64.b64decode(content["bytes"]) * content.get("times", 1))


def _status(arguments: list[str]) -> int:
    sys.argv = ["cotrack", *arguments]
    try:
        main()
    except SystemExit as ended:
        return int(ended.code or 0)
    return 0


@contextmanager
def _quiet(file: Path) -> Iterator[None]:
    with file.open("w", encoding="utf-8") as stream, redirect_stdout(stream), redirect_stderr(stream):
        yield
