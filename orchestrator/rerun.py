"""Which FMU replays a component of a log: the one that ran, the other track model, or one that was given."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from fmus.vehicle import BadInput
from orchestrator import replay
from orchestrator.component import Component
from orchestrator.reader import Log
from orchestrator.scene import TrackScene, from_table
from orchestrator.simulate import sha256
from orchestrator.system import TRACKS, Part, assemble, build_all, placed

Logger = Callable[[str, int, str], None]


class Again(NamedTuple):
    """A component opened to be replayed."""

    log: Log
    component: Component
    parameters: replay.Parameters
    scene: dict[str, Any]

    def verify(self) -> replay.Verdict:
        """Bit by bit against the log."""
        return replay.verify(self.log, self.component, self.parameters)

    def answer(self, path: Path) -> list[str]:
        """Log the component's own answer, and lines of a table of forces."""
        if path.exists() and path.samefile(self.log.path):
            raise BadInput(f"{path} is the log itself: give another name")
        attachments = {name: self.log.attachment(name) for name in ("scene.json", "system.json")}
        rows = replay.answer(
            self.log, self.component, self.parameters, path, attachments, self.scene["run"]["links"]
        )
        head = (
            f"{'signal':28} {'unit':5} {'mean, log':>12} {'mean, now':>12} {'rms, log':>12} {'rms, now':>12}"
        )
        return [head] + [
            f"{row.name:28} {row.unit:5} {row.recorded_mean:12.1f} {row.replayed_mean:12.1f}"
            f" {row.recorded_rms:12.1f} {row.replayed_rms:12.1f}"
            for row in rows
        ]


@contextmanager
def opened(path: Path, name: str, other: str | None, logger: Logger | None = None) -> Iterator[Again]:
    """The component ``name`` of a log, or ``other`` ("rigid", "flexible" or an FMU file) in its place."""
    with Log(path) as log:
        scene = json.loads(log.attachment("scene.json"))
        entry = replay.instance(json.loads(log.attachment("system.json")), name)
        fmu, parameters = _fmu(scene, entry, other)
        with Component(fmu, name, logger) as component:
            known = set(component.parameters)
            yield Again(
                log, component, {key: value for key, value in parameters.items() if key in known}, scene
            )


def _fmu(table: dict[str, Any], entry: dict[str, Any], other: str | None) -> tuple[Path, replay.Parameters]:
    """File and parameters of the FMU that is to be stepped."""
    if "path" not in entry:
        raise BadInput(f"'{entry['name']}' of the log was stepped without an FMU: there is nothing to replay")
    if other is not None and other not in TRACKS:
        if not Path(other).is_file():
            raise BadInput(f"no FMU '{other}': give rigid, flexible or an .fmu file")
        return Path(other), entry["parameters"]
    scene = from_table(table, "the scene of the log")
    assert isinstance(scene, TrackScene)  # it has FMUs
    if other is not None:
        part = _part(
            scene.model_copy(
                update={
                    "planar": False,
                    "track": scene.track.model_copy(
                        update={"model": other, "integrator": None, "element": None, "elasticity": None}
                    )
                }
            ),
            entry["name"],
        )
        if part.kind != TRACKS[other]:
            raise BadInput(f"--with {other}: '{entry['name']}' is no track")
        return build_all([(part.kind, part.config, None)])[0], part.parameters
    recorded = Path(entry["path"])
    if recorded.is_file() and sha256(recorded) == entry["sha256"]:
        return recorded, entry["parameters"]
    part = _part(scene, entry["name"])
    built = build_all([(part.kind, part.config, None)])[0]
    if sha256(built) != entry["sha256"]:
        raise BadInput(f"the log was made by another build of {entry['fmu']}: name an FMU with --with")
    return built, entry["parameters"]


def _part(scene: TrackScene, name: str) -> Part:
    return next(part for part in assemble(placed(scene)).parts if part.name == name)
