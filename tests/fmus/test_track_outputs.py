"""The documentation of the tracks' outputs has a row for each of them."""

from __future__ import annotations

import re
from pathlib import Path

import fmus
from fmus.track.link_outputs import GROUPS
from fmus.track.ports import OUTPUTS

PAGE = Path(fmus.__file__).with_name("track.md").read_text(encoding="utf-8")
WRENCH = ["S.force", "S.torque"]  # for each wheel


def described() -> list[str]:
    rows = (line.split(" | ")[0] for line in PAGE.splitlines() if line.startswith("| `"))
    return [name for first in rows for name in re.findall(r"`([^`]+)`", first)]


def shown() -> set[str]:
    vector = re.compile(r"\.[xyz]$")
    links = {
        f"{group.owner}[i].{group.signal}" + (f".{part}" if part else "")
        for group in GROUPS.values()
        for part in group.parts
    }
    return {vector.sub("", name) for name in {name for name, _, _ in OUTPUTS} | links}


def test_every_output_is_defined_once():
    assert sorted(described()) == sorted([*WRENCH, *shown()])


def test_units_and_kinds_stand_in_every_row():
    rows = [line for line in PAGE.splitlines() if line.startswith("| `")]
    assert all(len(re.split(r"(?<!\\) \| ", line)) == 4 for line in rows)
