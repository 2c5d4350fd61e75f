"""Faults are valid changes and depend on the seed alone; a failing test is noticed."""

import ast
import json
import subprocess

import pytest

from tests.mutation import __main__ as command
from tests.mutation.areas import AREAS, ROOT, known_faults, nearest
from tests.mutation.operators import faults

SOURCE = '''"""A docstring with 1.0 + 2.0."""
LIMIT = 2.0 + 1.0


def f(x: float, y: float = 1.0 + 2.0) -> float:
    """Another - docstring."""
    z = x + 0.5 * y
    z += 1.0
    if x < y and not z:
        return max(z, x[1 + 2])
    raise ValueError(f"{x + y}")
'''


def test_faults_of_a_source():
    changed_lines = [(fault.line, fault.new.strip()) for fault in faults(SOURCE)]
    assert changed_lines == [
        (7, "z = x + 0.5 / y"),
        (7, "z = x + 0.6 * y"),
        (7, "z = x - 0.5 * y"),
        (8, "pass"),
        (8, "z += 1.2"),
        (9, "if not (x < y and (not z)):"),
        (9, "if x < y and z:"),
        (9, "if x < y or not z:"),
        (9, "if x <= y and not z:"),
        (10, "return min(z, x[1 + 2])"),
    ]


def test_areas_share_a_hundred_faults_and_have_tests():
    assert sum(area.share for area in AREAS) == 100
    for area in AREAS:
        assert area.files()
        assert all((ROOT / test).exists() for test in area.tests), area.name
    energy = nearest(next(file for file in AREAS[7].files() if file.name == "energy.py"), AREAS[7])
    assert "tests/orchestrator/test_energy.py" in energy
    assert [*AREAS[7].tests] != energy[: len(AREAS[7].tests)], "those that import it come first"
    assert {*AREAS[7].tests} < {*energy}
    assert len({*energy}) == len(energy)


@pytest.mark.long
def test_a_draw_is_the_same_for_a_seed_and_begins_with_known_faults():
    one, again, other = (command.chosen(20, seed) for seed in (1, 1, 2))
    assert one == again
    assert one != other
    for entry in one:
        lines = (ROOT / entry["file"]).read_text().splitlines()
        lines[entry["line"] - 1] = entry["new"]
        ast.parse("\n".join(lines))
    assert [entry["kind"] for entry in one[: len(known_faults())]] == ["known"] * len(known_faults())


NONE = "x = 1\n"
TEST = "from sums import add\n\n\ndef test_add():\n    assert add(1, 2) == 3\n"


@pytest.mark.parametrize(
    ("new", "test", "stage"),
    [
        ("    return a - b", TEST, "nearest"),
        ("    return b + a", TEST, ""),
        ("    return a - b", NONE, ""),
        ("    return a - b", "x = 1 / 0\n", "nearest"),
    ],
)
def test_a_failing_test_notices_a_fault(tmp_path, monkeypatch, new, test, stage):
    (tmp_path / "sums.py").write_text("def add(a, b):\n    return a + b\n")
    (tmp_path / "test_sums.py").write_text(test)
    monkeypatch.setattr(command, "nearest", lambda file, area: ["test_sums.py"])
    entry = {"area": AREAS[0].name, "file": "sums.py", "place": "sums.py:2", "line": 2, "old": "    return a + b",
             "new": new, "found": "", "stages": []}  # fmt: skip
    command.noticed(tmp_path, entry, ("nearest",))
    assert (entry["found"], entry["stages"]) == (stage, ["nearest"])
    assert "a + b" in (tmp_path / "sums.py").read_text(), "the fault was not removed"


@pytest.mark.long
def test_what_is_done_stays_done(call, tmp_path, monkeypatch):
    asked = []

    def noticed(checkout, entry, stages):
        asked.append(entry["place"])
        entry["stages"], entry["found"] = [*stages], "nearest" if len(asked) > 1 else ""

    monkeypatch.setattr(command, "noticed", noticed)
    monkeypatch.setattr(subprocess, "run", lambda *a, **k: type("Listed", (), {"stdout": "README.md\n"}))
    for _ in range(2):
        status, out, err = call(command.app, "-o", "kept", "--count", 10, "--until", "nearest")
    kept = json.loads((tmp_path / "kept" / "faults.json").read_text())
    assert len(asked) == len(kept) == len(command.chosen(10, 1))
    assert status == 1
    assert "1 survived nearest" in err
    assert out.count("survived") == 1
