"""What precision costs: settings of scenes with the error and the run time that a study found for them.

The gallery's own are shipped beside the scenes; what ``cotrack study error-runtime`` finds here replaces them.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from fmus.build import cache_folder
from fmus.vehicle import BadInput

SHIPPED = Path(__file__).parent / "scenes" / "precision.json"


class Setting(NamedTuple):
    """A way to run a scene."""

    scene: str
    track: str
    settings: tuple[str, ...]  # KEY=VALUE, as after ``--set``
    error: float  # the largest relative error of the decisive observables against the truth
    wall_time: float  # s


def own() -> Path:
    """The table that studies on this machine write."""
    return cache_folder() / "precision.json"


def read(*files: Path) -> list[Setting]:
    """All settings; of a scene and track those of the last file that knows them."""
    found: dict[tuple[str, str], list[Setting]] = {}
    for file in files or (SHIPPED, own()):
        try:
            rows = [Setting(**row) for row in json.loads(file.read_text(encoding="utf-8"))]
        except (OSError, ValueError, TypeError):
            continue
        known = {(row.scene, row.track) for row in rows}
        for key in known:
            found[key] = [row for row in rows if (row.scene, row.track) == key]
    return [row for rows in found.values() for row in rows]


def front(settings: Iterable[Setting]) -> list[Setting]:
    """Those that no other beats in both error and run time, the cheapest first."""
    best: list[Setting] = []
    for one in sorted(settings, key=lambda s: (s.wall_time, s.error)):
        if not best or one.error < best[-1].error:
            best.append(one)
    return best


def write(settings: Iterable[Setting], file: Path) -> None:
    """The fronts of scenes and tracks, beside what the file says of others."""
    new: dict[tuple[str, str], list[Setting]] = {}
    for one in settings:
        new.setdefault((one.scene, one.track), []).append(one)
    kept = [row for row in read(file) if (row.scene, row.track) not in new]
    rows = kept + [row for key in sorted(new) for row in front(new[key])]
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps([row._asdict() for row in rows], indent=1) + "\n", encoding="utf-8")


def fraction(text: str) -> float:
    """``1%`` or ``0.01``; raises BadInput."""
    try:
        value = float(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
    except ValueError:
        value = 0.0
    if not 0.0 < value < 1.0:
        raise BadInput(f"--error {text}: must be a fraction or a percentage between 0 and 100 %, as in 1%")
    return value


def cheapest(scene: str, track: str, error: float) -> Setting:
    """The setting with the least run time within the error; raises BadInput when none is known."""
    known = [row for row in read() if (row.scene, row.track) == (scene, track)]
    if not known:
        raise BadInput(
            f"--error: what precision costs in '{scene}' on {track} links is not known:"
            f" find out with cotrack study error-runtime {scene} -o DIR"
        )
    within = [row for row in known if row.error <= error]
    if not within:
        best = min(known, key=lambda row: row.error)
        raise BadInput(
            f"--error {error:.3g}: no setting of '{scene}' on {track} links is known to reach it;"
            f" the best has an error of {best.error:.2g}"
        )
    return min(within, key=lambda row: row.wall_time)
