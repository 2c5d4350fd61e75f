"""The truth about a scene: a monolithic run, converged in its internal step, with its own error, kept by content.

Two runs make it, one at the largest stable internal step and one at half of it; the second is the truth. Where forces
are smooth its error falls with the fourth power of the step, but contact forces have a kink where they begin, which
costs a fixed number of errors of h^2: by Richardson with ORDER, error = difference / (2^ORDER - 1).
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
from pathlib import Path
from typing import Any, NamedTuple

from fmus.cache import cache_folder, keep, kept, own, reason
from fmus.link_outputs import STANDARD
from fmus.monolith.model import content
from fmus.vehicle import BadInput
from orchestrator.cosim.narration import Narration
from orchestrator.execution import monolithic
from orchestrator.results.difference import Difference, differences_of_logs
from orchestrator.scene import assembly, parts, placing
from orchestrator.scene.placing import placed
from orchestrator.scene.run_tables import Run
from orchestrator.scene.scene import Scene

ORDER = 2
SAMPLING, LINKS = 1e-3, 10  # s between outputs; links at one in so many
LOGS = ("truth.mcap", "coarse.mcap")
FIGURES = "truth.json"  # with a hash of each log


class TruthFailed(RuntimeError):
    """The monolith could not be integrated; the message is one sentence."""


class Truth(NamedTuple):
    """A log that can be believed, and how far."""

    log: Path
    coarse_log: Path  # of the same with the internal step doubled
    internal_step: float  # s
    wall_time: float  # s that the two runs took
    difference: dict[str, Difference]  # between the two runs, by observable
    built: bool  # now, not found

    def error(self, observable: str) -> float:
        """Estimated error of the log in an observable, RMS in its unit."""
        return self.difference[observable].absolute / (2.0**ORDER - 1.0)


def truth(scene: Scene, narration: Narration | None = None) -> Truth:
    """Find or build the truth about a scene; a ``narration`` is told what is done.

    Depends on the physics of the scene and on the sources, not on its communication step, nor on how its components
    integrate. Two processes that want the same build it once; one that is damaged is built again. Raises TruthFailed,
    BadInput (also where it cannot be kept), LogFailed or ComponentFailed.
    """
    if scene.track.element == "beam":
        raise BadInput("truth: track.element = 'beam': the monolith knows chains of cables and rigid links only")
    scene = bare(scene)
    folder = cache_folder() / "truth" / key(scene)
    try:
        own(folder)
        found, built = _found(folder), False
        if found is None:
            with _alone(folder.with_suffix(".lock")):
                found = _found(folder)
                if found is None:
                    if narration:
                        narration(f"{scene.name}: two monolithic runs in short steps make its truth")
                    found, built = _build(scene, folder, narration), True
    except OSError as error:
        raise BadInput(f"truth: it cannot be kept in the cache: {reason(error)}") from None
    figures = {name: value for name, value in found.items() if name != "sha256"}
    figures["difference"] = {name: Difference(**one) for name, one in figures["difference"].items()}
    return Truth(folder / LOGS[0], folder / LOGS[1], **figures, built=built)


def _found(folder: Path) -> dict[str, Any] | None:
    """The figures of a truth whose files are as they were built."""
    figures = kept(folder / FIGURES)
    if figures is None:
        return None
    found: dict[str, Any] = json.loads(figures)
    return found if found["sha256"] == _hashes(folder) else None


def _hashes(folder: Path) -> dict[str, str]:
    found = {}
    for name in LOGS:
        with suppress(FileNotFoundError), (folder / name).open("rb") as log:
            found[name] = hashlib.file_digest(log, "sha256").hexdigest()
    return found


def bare(scene: Scene) -> Scene:
    """The placed scene without what a truth does not depend on; sampled at SAMPLING where its stop allows that."""
    run = scene.run
    step = SAMPLING if abs(run.stop / SAMPLING - round(run.stop / SAMPLING)) < 1e-6 else run.step
    sampled = Run(stop=run.stop, step=step, outputs=1, links=LINKS)
    how = {key: None for key, one in scene.track.sets().items() if one.method}
    track = scene.track.model_copy(update={**how, "link_outputs": STANDARD})
    same = {"run": sampled, "track": track, "expect": {}, "planar": False}  # the motion of a planar chain is no other
    return placed(scene).model_copy(update=same)


def key(scene: Scene) -> str:
    """Hash of a bare scene and of the sources that make its truth."""
    physics = {name: value for name, value in scene.resolved().items() if name not in ("name", "title")}
    hashed = [json.dumps(physics, sort_keys=True), content()]
    hashed += [
        Path(str(module.__file__)).read_text(encoding="utf-8") for module in (assembly, parts, placing, monolithic)
    ]
    return hashlib.sha256("\0".join(hashed).encode()).hexdigest()[:24]


def _build(scene: Scene, folder: Path, narration: Narration | None) -> dict[str, Any]:
    """Both runs side by side and what they differ in; each file is put in its place at once, the figures last."""
    stop = threading.Event()
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix="fresh-", ignore_cleanup_errors=True) as fresh:
        logs = [Path(fresh) / name for name in LOGS]
        with ThreadPoolExecutor(2) as pool:
            runs = [
                pool.submit(monolithic.run, scene, log, refine, shown, stop.is_set)
                for log, refine, shown in zip(logs, (2.0, 1.0), (None, narration), strict=True)
            ]
            try:
                results = [each.result() for each in runs]
            finally:
                stop.set()
        for outcome, _ in results:
            if outcome.status != "ok":
                raise TruthFailed(f"{scene.name}: {outcome.message}")
        figures = {
            "internal_step": results[0][1]["internal_step"],
            "wall_time": max(cost["wall_time"] for _, cost in results),
            "difference": {name: one._asdict() for name, one in differences_of_logs(logs[1], logs[0]).items()},
            "sha256": _hashes(Path(fresh)),
        }
        for log in logs:
            log.replace(folder / log.name)
        keep(folder / FIGURES, json.dumps(figures).encode())
        return figures


@contextmanager
def _alone(lock: Path) -> Iterator[None]:
    """One process at a time, where the system can lock files; elsewhere both build and the first one's stays."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    handle = os.open(lock, os.O_CREAT | os.O_RDWR, 0o600)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
