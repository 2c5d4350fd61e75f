"""Random cases of all kinds, and every find of the corpus again."""

import json
import os
import random
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fuzz import oracle, values
from tests.fuzz.__main__ import CORPUS, EXPECTED, SHARES
from tests.fuzz.bench import Bench

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks under limits of Linux")
HALVES = (
    "settings,scenes,vehicles,caches,checkpoints,sweeps",
    "points,commands,logs,calls,states,measured,grounds,guests",
)


def fuzz(environment, folder, *arguments, timeout=600):
    """Run the command; exit status and the object that it prints."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.fuzz", "-o", folder / "finds", *arguments],
        cwd=folder, env=environment, capture_output=True, text=True, timeout=timeout,
    )  # fmt: skip
    assert done.stdout, done.stderr[-2000:]
    return done.returncode, json.loads(done.stdout.splitlines()[-1])


def run_half(environment, folder, half, minutes, seed):
    status, answer = fuzz(environment, folder, "--minutes", minutes, "--seed", seed, "--only", half, "--json")
    new = [find for find in answer["finds"] if not find["known"]]
    assert (status, new) == (0, [])
    assert {row["kind"] for row in answer["rows"] if row["cases"] >= 1} == set(half.split(","))


@pytest.mark.long
@pytest.mark.parametrize("half", HALVES)
def test_random_cases_of_all_kinds(environment, tmp_path, half):
    run_half(environment, tmp_path, half, "0.1", "18")  # its first grounds have kernels that other tests compile


@pytest.mark.long
def test_the_corpus(environment, tmp_path):
    """Finds are mended, but those of the table, which must still be there: a mended one leaves the table."""
    _, found = fuzz(environment, tmp_path, "--corpus")
    assert set(found) == {file.stem for file in CORPUS.glob("*.json")}
    wrong = {name: wrongs for name, wrongs in found.items() if wrongs and name not in EXPECTED}
    mended = [name for name in EXPECTED if not found[name]]
    assert (wrong, mended) == ({}, [])


def test_tables_of_finds():
    assert set(EXPECTED) <= {file.stem for file in CORPUS.glob("*.json")}
    assert {kind for half in HALVES for kind in half.split(",")} == set(SHARES)
    page = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    for name, (kind, _, reason) in EXPECTED.items():
        case = json.loads((CORPUS / f"{name}.json").read_text(encoding="utf-8"))
        assert case["kind"] == kind
        assert f"| `{name}` | {reason} |" in page


@given(st.randoms(use_true_random=False))
def test_changed_tables_are_tables(draw):
    """Changes of a table give TOML that reads back, apart from deep nesting."""
    table = {"a": 1, "b": {"c": [1.5, "x"], "d": True}, "e": [[0, 1], [2, 3]]}
    for _ in range(3):
        if list(values.places(table)):
            values.change(table, draw)
    if "\ufffe" not in repr(table):
        assert repr(tomllib.loads(values.toml(table))) == repr(table)


# --- the oracle sees each kind of wrong -------------------------------------------------------------


def crash():
    os.kill(os.getpid(), signal.SIGSEGV)


def compute():
    while True:
        pass


def wait():
    time.sleep(60)


def allocate():
    hoard = bytearray(2 << 30)
    print(len(hoard))


def say(text, status, file=""):
    def act():
        if file:
            Path(file).touch()
        print(text, file=sys.stderr)
        sys.exit(status)

    return act


def answer():
    print('{"status": "ok", "x": NaN}')


CASES = [
    (crash, "signal: SIGSEGV"),
    (compute, "hang: more than"),
    (wait, "hang: waits"),
    (allocate, "exit status 70"),
    (say("Traceback (most recent call last):", 1), "traceback"),
    (say("cotrack: internal error: KeyError", 1), "internal error"),
    (say(f"cotrack: {'x' * 401}", 2), "a sentence of 401 characters"),
    (say("RuntimeWarning: overflow", 0), "stderr has: RuntimeWarning"),
    (say("cotrack: a\ncotrack: b", 2), "2 sentences"),
    (say("cotrack: bad", 2, "left.csv"), "bad input leaves the file left.csv"),
    (say("cotrack: bad", 1, "a.csv.0123456789ab"), "a partial file is left"),
    (say("cotrack: bad", 5), "exit status 5"),
    (answer, "NaN in the answer"),
]


@pytest.mark.parametrize(("action", "said"), CASES, ids=[said for _, said in CASES])
def test_the_oracle_sees(tmp_path, action, said):
    folder = oracle.emptied(tmp_path / "room")
    wrongs = oracle.wrongs(oracle.play(action, folder, cpu=1, wall=2))
    assert said in wrongs[0]


def test_the_oracle_lets_good_endings_pass(tmp_path):
    for text, status in (
        ("cotrack: a.toml: mass = -1: must be greater than 0", 2),
        ("... a run", 0),
        ("Usage: x\nError: y", 2),
    ):
        assert oracle.wrongs(oracle.play(say(text, status), oracle.emptied(tmp_path / "room"))) == []


@pytest.mark.parametrize(
    ("played", "counted"),
    [([["hang: a"], []], []), ([["hang: a"], ["hang: b"]], ["hang: b"]), ([["traceback: c"]], ["traceback: c"])],
)
def test_a_hang_is_played_again(monkeypatch, played, counted):
    ends = iter(played)
    monkeypatch.setattr(Bench, "_play", lambda bench, case: next(ends))
    assert Bench.play(object.__new__(Bench), {}) == counted


def test_equal_finds_count_once():
    one, other = "tmp/a.csv: line 3: 'x' is no number", "/tmp/b.csv: line 77: 'yy' is no number"
    assert oracle.signature(one) == oracle.signature(other) != oracle.signature("a.csv: line 3: no line")
    assert random.Random("settings 1").random() == random.Random("settings 1").random()
