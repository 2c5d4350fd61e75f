"""The documentation of the tracks' outputs has a row for each of them."""

from __future__ import annotations

import re
from pathlib import Path

import fmus
from fmus.track.link_outputs import GROUPS
from fmus.track.ports import OUTPUTS

PAGE = Path(fmus.__file__).with_name("track.md").read_text(encoding="utf-8")
ROWS = [line for line in PAGE.splitlines() if line.startswith("| `")]
WRENCH = ["S.force", "S.torque"]  # for each wheel


def test_every_output_is_defined_once_with_unit_and_kind():
    described = [name for row in ROWS for name in re.findall(r"`([^`]+)`", row.split(" | ")[0])]
    links = {f"{each.owner}[i].{each.signal}.{part}".rstrip(".") for each in GROUPS.values() for part in each.parts}
    shown = {re.sub(r"\.[xyz]$", "", name) for name in {name for name, _, _ in OUTPUTS} | links}
    assert sorted(described) == sorted([*WRENCH, *shown])
    assert all(len(re.split(r"(?<!\\) \| ", line)) == 4 for line in ROWS)
