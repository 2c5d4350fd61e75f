"""``python -m tests.fuzz``: random settings, files, logs and calls; prints a table and keeps each find."""

from __future__ import annotations

import json
import os
import random
import re
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # a process with threads should not fork

import typer

from fmus.vehicles.tables import BadInput
from orchestrator.cli import main
from orchestrator.results.table import Column, Table
from tests.fuzz import caches, grounds, guests, logs, measured, oracle, sequences, settings, sweeps, tables
from tests.fuzz.bench import Bench, Case

CORPUS = Path(__file__).parent / "corpus"
# Finds that are not mended yet, which do not fail the fuzzing: file in ``corpus/`` -> kind, pattern of what is wrong,
# reason. Until it is mended and leaves the table, a file must still show its find.
EXPECTED: dict[str, tuple[str, str, str]] = {}
SHARES = {  # of the time
    "settings": 3, "scenes": 2, "vehicles": 2, "points": 2, "commands": 4, "logs": 3, "checkpoints": 1, "caches": 2,
    "calls": 2, "states": 1, "measured": 3, "sweeps": 2, "grounds": 2, "guests": 3,
}  # fmt: skip
COLUMNS = (
    Column("kind", "kind"), Column("cases", "cases"), Column("s", "s"), Column("seeds", "seeds"),
    Column("finds", "finds"), Column("known", "known"),
)  # fmt: skip


def draw(kind: str, bench: Bench, seed: int) -> Case:
    """The case of a kind and a seed."""
    chance = random.Random(f"{kind} {seed}")
    own: dict[str, Callable[[random.Random], Case]] = {
        "settings": settings.draw, "scenes": tables.scenes, "vehicles": tables.vehicles, "points": tables.points,
        "commands": tables.commands, "logs": partial(logs.logs, bench), "checkpoints": partial(logs.checkpoints, bench),
        "caches": caches.draw, "calls": sequences.draw, "states": sequences.draw_states, "measured": measured.draw,
        "sweeps": sweeps.draw, "grounds": grounds.draw, "guests": guests.draw,
    }  # fmt: skip
    return {"kind": kind, **own[kind](chance)}


class Campaign:
    """Cases of all kinds by turns, with counts and finds."""

    def __init__(self, bench: Bench, output: Path, kinds: list[str], seed: int) -> None:
        self.bench, self.output, self.kinds = bench, output, kinds
        self.next_seed = dict.fromkeys(kinds, 1_000_000 * seed)
        self.used = dict.fromkeys(kinds, 0.0)
        self.cases: Counter[str] = Counter()
        self.finds: dict[tuple[str, str], dict[str, Any]] = {}  # kind and signature -> first find and count

    def run(self, seconds: float) -> None:
        """Play cases until the time is over, one of each kind at least; kinds get time by their shares."""
        end = time.monotonic() + seconds
        while time.monotonic() < end or not all(self.used.values()):
            kind = min(self.kinds, key=lambda one: self.used[one] / SHARES[one])
            seed = self.next_seed[kind]
            self.next_seed[kind] += 1
            began = time.monotonic()
            case = draw(kind, self.bench, seed)
            wrongs = self.bench.play(case)
            self.used[kind] += time.monotonic() - began
            self.cases[kind] += 1
            for wrong in wrongs:
                self._keep(case, seed, wrong)

    def _keep(self, case: Case, seed: int, wrong: str) -> None:
        kind = case["kind"]
        hits = (name for name, (of, pattern, _) in EXPECTED.items() if of == kind and re.search(pattern, wrong))
        known = next(hits, "")
        key = kind, known or oracle.signature(wrong)
        if key in self.finds:
            self.finds[key]["count"] += 1
            return
        self.finds[key] = {"wrong": wrong[:600], "known": known, "seed": seed, "count": 1, "case": case}
        self.output.mkdir(parents=True, exist_ok=True)
        file = self.output / f"{kind}-{seed}-{len(self.finds)}.json"
        file.write_text(json.dumps({"about": wrong[:600], **case}, indent=1), encoding="utf-8")

    def rows(self) -> list[dict[str, Any]]:
        """Counts by kind."""
        rows = []
        for kind in self.kinds:
            own = [find for (of, _), find in self.finds.items() if of == kind]
            new = [find for find in own if not find["known"]]
            seeds = f"{self.next_seed[kind] - self.cases[kind]} to {self.next_seed[kind] - 1}"
            row = {"kind": kind, "cases": self.cases[kind], "s": round(self.used[kind], 1), "seeds": seeds}
            rows.append(row | {"finds": len(new), "known": len(own) - len(new)})
        return rows


def replay(bench: Bench, names: list[str]) -> dict[str, list[str]]:
    """Play the cases of the corpus; return the faults of each."""
    found = {}
    for file in sorted(CORPUS.glob("*.json")):
        if not names or file.stem in names:
            found[file.stem] = bench.play(json.loads(file.read_text(encoding="utf-8")))
    return found


def fuzz(
    minutes: Annotated[float, typer.Option("--minutes", min=0.0, help="time to spend, after the start")] = 60.0,
    only: Annotated[str, typer.Option("--only", metavar="KINDS", help=f"of {','.join(SHARES)}")] = "",
    seed: Annotated[int, typer.Option("--seed", help="of all draws")] = 1,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="a file for each find")] = Path("finds"),
    corpus: Annotated[bool, typer.Option("--corpus", help="play the finds of the corpus instead")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object on stdout")] = False,
) -> None:
    """Play random cases; exit 1 if one is wrong that is not known."""
    kinds = [kind for kind in only.split(",") if kind] or list(SHARES)
    if unknown := set(kinds) - set(SHARES):
        raise BadInput(f"--only {only}: no kind '{min(unknown)}': there are {', '.join(SHARES)}")
    sys.setrecursionlimit(1000)
    with tempfile.TemporaryDirectory(prefix="cotrack-fuzz-") as folder:
        bench = Bench(Path(folder), kinds)
        if corpus:
            answers = replay(bench, [])
            print(json.dumps(answers))
            sys.exit(int(any(wrongs and name not in EXPECTED for name, wrongs in answers.items())))
        campaign = Campaign(bench, output.absolute(), kinds, seed)
        campaign.run(60.0 * minutes)
    finds = [
        {"kind": kind, **{k: v for k, v in find.items() if k != "case"}} for (kind, _), find in campaign.finds.items()
    ]
    if as_json:
        print(json.dumps({"rows": campaign.rows(), "finds": finds}))
    else:
        print(Table.of_records("", COLUMNS, campaign.rows()).markdown())
        for find in finds:
            known = f", known as {find['known']}" if find["known"] else ""
            print(f"{find['kind']} {find['seed']}, {find['count']} times{known}: {find['wrong'][:300]}")
    sys.exit(int(any(not find["known"] for find in finds)))


app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
app.command()(fuzz)

if __name__ == "__main__":
    main(app)
