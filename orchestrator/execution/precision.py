"""Tables of precision: settings of scenes with measured error and run time.

The gallery's table is shipped beside the scenes and names the commit of its last measurements. Results of ``cotrack
study error-runtime`` on this machine replace its entries. A table has a checksum.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

from fmus.cache.files import UntrustedFolder, cache_folder, check_trust, make_folder, report_error
from fmus.cache.files import write as put
from fmus.vehicles.tables import BadInput, to_si
from orchestrator.files.budget import DOCUMENT, read_file
from orchestrator.files.messages import LOG

SHIPPED = Path(__file__).parents[1] / "gallery" / "precision.json"


class Setting(NamedTuple):
    """Settings of a run with their measured error and run time."""

    scene: str
    track: str
    settings: tuple[str, ...]  # KEY=VALUE, as after ``--set``
    error: float  # largest relative error of the decisive observables against the truth
    wall_time: float  # s


def local_file() -> Path:
    """Return the file that studies on this machine write."""
    return cache_folder() / "precision.json"


def read(*files: Path) -> list[Setting]:
    """Read all settings; for each scene and track the last file that has entries counts."""
    settings: list[Setting] = []
    for file in files or (SHIPPED, local_file()):
        rows = _rows(file)
        settings = _other_scenes(settings, rows) + rows
    return settings


def _other_scenes(settings: list[Setting], new: Iterable[Setting]) -> list[Setting]:
    """Return the settings whose scene and track do not occur among the new ones."""
    known = {(setting.scene, setting.track) for setting in new}
    return [setting for setting in settings if (setting.scene, setting.track) not in known]


def _rows(file: Path) -> list[Setting]:
    """Read the settings in a table; a damaged table gives a warning and an empty list."""
    try:
        if file == local_file():
            check_trust(file.parent)
        table = json.loads(read_file(file, DOCUMENT))
        if table["sha256"] != _checksum(table["rows"]):
            raise ValueError
        return [Setting(**row) for row in table["rows"]]
    except FileNotFoundError:
        return []
    except UntrustedFolder as error:
        report_error(error)
    except (OSError, ValueError, TypeError, LookupError, RecursionError):
        LOG.warning("the table %s is damaged and is left out: 'cotrack study error-runtime' writes it again", file)
    return []


def _checksum(rows: list[dict[str, Any]]) -> str:
    return hashlib.sha256(json.dumps(rows).encode()).hexdigest()


def pareto_front(
    candidates: Iterable[Any],
    cost: Callable[[Any], float] = attrgetter("wall_time"),
    error: Callable[[Any], float] = attrgetter("error"),
) -> list[Any]:
    """Return the Pareto front in error and run time, cheapest first."""
    best: list[Any] = []
    for setting in sorted(candidates, key=lambda candidate: (cost(candidate), error(candidate))):
        if not best or error(setting) < error(best[-1]):
            best.append(setting)
    return best


def write(settings: Iterable[Setting], file: Path) -> None:
    """Write the Pareto front of each scene and track; entries of others remain. Raises OSError."""
    new: dict[tuple[str, str], list[Setting]] = {}
    for setting in settings:
        new.setdefault((setting.scene, setting.track), []).append(setting)
    fronts = [setting for key in sorted(new) for setting in pareto_front(new[key])]
    rows = [setting._asdict() for setting in _other_scenes(read(file), fronts) + fronts]
    make_folder(file.parent)
    put(file, (json.dumps({"rows": rows, "sha256": _checksum(rows)}, indent=1) + "\n").encode())


def fraction(text: str) -> float:
    """Parse ``1%`` or ``0.01``; raises BadInput."""
    try:
        value = to_si("1")(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < 1.0:
        raise BadInput(f"--error {text}: must be a fraction or a percentage between 0 and 100 %, as in 1%")
    return value


def cheapest(scene: str, track: str, error: float, given: str = "") -> Setting:
    """Return the setting with the least run time within ``error``; raises BadInput if none is known.

    ``given``: how the user named the scene, as a file of one's own, of which this machine alone knows errors.
    """
    files = (local_file(),) if given not in ("", scene) else (SHIPPED, local_file())
    known = [row for row in read(*files) if (row.scene, row.track) == (scene, track)]
    if not known:
        raise BadInput(
            f"--error: no error of '{scene}' on {track} links has been measured:"
            f" run cotrack study error-runtime {given or scene} -o DIR"
        )
    within = [row for row in known if row.error <= error]
    if not within:
        best = min(known, key=lambda row: row.error)
        raise BadInput(
            f"--error {error:.3g}: no measured setting of '{scene}' on {track} links reaches it;"
            f" the best has an error of {best.error:.2g}"
        )
    return min(within, key=lambda row: row.wall_time)
