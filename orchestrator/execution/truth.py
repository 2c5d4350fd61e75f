"""Truth of a scene: a converged monolithic run with an error estimate, cached by content.

Two runs use the largest stable internal step and half of it; the second is the truth. With smooth forces its error
falls with the fourth power of the step. Contact forces have a kink at the onset of contact, which adds a fixed number
of errors of h^2. Richardson with ORDER gives error = difference / (2^ORDER - 1).
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from contextvars import copy_context
from pathlib import Path
from typing import Any, NamedTuple

from fmus.cache.files import cache_folder, error_text, private_folder, read_checked, write_checked
from fmus.monolith.model import content
from fmus.track.link_outputs import STANDARD
from fmus.vehicles.tables import BadInput
from orchestrator.execution import monolithic
from orchestrator.files.messages import PROGRESS, silent
from orchestrator.results.difference import INTERVAL, ObservableDifference, differences_of_logs
from orchestrator.scene import assembly, ground_plane, kinds, parts, placing, tables
from orchestrator.scene.kinds import Scene
from orchestrator.scene.placing import placed
from orchestrator.scene.tables import RunTable

ORDER = 2
SAMPLING = 1e-3  # s between outputs
LOGS = ("truth.mcap", "coarse.mcap")
FIGURES = "truth.json"  # also holds a hash of each log


class TruthFailed(RuntimeError):
    """The monolith could not be integrated; the message is one sentence."""


class Truth(NamedTuple):
    """Converged log with its error estimate."""

    log: Path
    coarse_log: Path  # log with twice the internal step
    internal_step: float  # s
    wall_time: float  # s, both runs
    difference: dict[str, ObservableDifference]  # between the two runs, by observable
    built: bool  # True if built now, False if found

    def error(self, observable: str) -> float:
        """Estimated error of the log in an observable, RMS in its unit."""
        return self.difference[observable].absolute / (2.0**ORDER - 1.0)


def truth(scene: Scene) -> Truth:
    """Find or build the truth of a scene.

    The truth depends on the physics of the scene and on the sources, not on the communication step nor on the
    components' integrators. Two processes that want the same truth build it once; a damaged one is built again.
    Raises TruthFailed, BadInput (also if it cannot be stored), LogFailed or ComponentFailed.
    """
    require_known(scene)
    scene = physical_scene(scene)
    folder = cache_folder() / "truth" / key(scene)
    try:
        private_folder(folder)
        stored, built = _stored_figures(folder), False
        if stored is None:
            with _locked(folder.with_suffix(".lock")):
                stored = _stored_figures(folder)
                if stored is None:
                    PROGRESS.info("%s: its truth is computed by two monolithic runs in short steps", scene.name)
                    stored, built = _build(scene, folder), True
    except OSError as error:
        raise BadInput(f"truth: it cannot be kept in the cache: {error_text(error)}") from None
    figures = {name: value for name, value in stored.items() if name != "sha256"}
    figures["difference"] = {name: ObservableDifference(**fields) for name, fields in figures["difference"].items()}
    return Truth(folder / LOGS[0], folder / LOGS[1], **figures, built=built)


def require_known(scene: Scene) -> None:
    """Raise BadInput for what the monolith, by which a truth is computed, does not know."""
    scene.require_own_parts("a truth has")
    if (element := scene.track.element) not in (None, "cable"):
        raise BadInput(f"truth: track.element = '{element}': the monolith knows chains of cables and rigid links only")
    table = scene.resolved()
    ground = table.get("ground") or {}
    given = {"ground.soil": ground.get("soil"), "ground.hull": ground.get("hull")}
    for key, value in {**given, "hitch": table.get("hitch"), "seats": table.get("seats")}.items():
        if value:
            raise BadInput(f"truth: {scene.where}: {key}: the monolith has tracks on hard ground, no hitch, no seats")


def _stored_figures(folder: Path) -> dict[str, Any] | None:
    """Return the figures of a stored truth if its files are intact, else None."""
    figures = read_checked(folder / FIGURES)
    if figures is None:
        return None
    stored: dict[str, Any] = json.loads(figures)
    return stored if stored["sha256"] == _hashes(folder) else None


def _hashes(folder: Path) -> dict[str, str]:
    hashes = {}
    for name in LOGS:
        with suppress(FileNotFoundError), (folder / name).open("rb") as log:
            hashes[name] = hashlib.file_digest(log, "sha256").hexdigest()
    return hashes


def physical_scene(scene: Scene) -> Scene:
    """Return the placed scene without settings irrelevant for the truth, sampled at SAMPLING if possible."""
    run = scene.run
    step = SAMPLING if abs(run.stop / SAMPLING - round(run.stop / SAMPLING)) < 1e-6 else run.step
    sampled = RunTable(stop=run.stop, step=step, outputs=1, links=max(1, round(INTERVAL / step)))
    default_method = {key: None for key, parameter in scene.track.fmu_parameters().items() if parameter.method}
    track = scene.track.model_copy(update={**default_method, "link_outputs": STANDARD})
    neutral = {"run": sampled, "track": track, "expect": {}, "planar": False}  # planar and spatial chains move alike
    return placed(scene).model_copy(update=neutral)


def key(scene: Scene) -> str:
    """Hash of a bare scene and of the sources that compute its truth."""
    physics = {name: value for name, value in scene.resolved().items() if name not in ("name", "title")}
    hashed = [json.dumps(physics, sort_keys=True), content()]
    modules = assembly, ground_plane, kinds, parts, placing, tables, monolithic
    hashed += [Path(str(module.__file__)).read_text(encoding="utf-8") for module in modules]
    return hashlib.sha256("\0".join(hashed).encode()).hexdigest()[:24]


def _build(scene: Scene, folder: Path) -> dict[str, Any]:
    """Do both runs in parallel; move the complete logs into place, then the figures."""
    stop = threading.Event()
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix="fresh-", ignore_cleanup_errors=True) as scratch:
        logs = [Path(scratch) / name for name in LOGS]
        with ThreadPoolExecutor(2) as pool:
            runs = [
                pool.submit(copy_context().run, run, scene, log, refine, stop.is_set)
                for log, refine, run in zip(logs, (2.0, 1.0), (silent()(monolithic.run), monolithic.run), strict=True)
            ]
            try:
                results = [future.result() for future in runs]
            finally:
                stop.set()
        for outcome, _ in results:
            if outcome.status != "ok":
                raise TruthFailed(f"{scene.name}: {outcome.message}")
        figures = {
            "internal_step": results[0][1]["internal_step"],
            "wall_time": max(cost["wall_time"] for _, cost in results),
            "difference": {
                name: difference._asdict() for name, difference in differences_of_logs(logs[1], logs[0]).items()
            },
            "sha256": _hashes(Path(scratch)),
        }
        for log in logs:
            log.replace(folder / log.name)
        write_checked(folder / FIGURES, json.dumps(figures).encode())
        return figures


@contextmanager
def _locked(lock: Path) -> Iterator[None]:
    """Lock against other processes; without file locks several may build the same truth."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    handle = os.open(lock, os.O_CREAT | os.O_RDWR | os.O_NOFOLLOW, 0o600)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
