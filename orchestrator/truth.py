"""The truth about a scene: a monolithic run, converged in its internal step, with its own error, kept by content.

Two runs make it, one at the largest stable internal step and one at half of it; the second is the truth. Where forces
are smooth its error falls with the fourth power of the step, but contact forces have a kink where they begin, which
costs a fixed number of errors of h^2: by Richardson with ORDER, error = difference / (2^ORDER - 1).
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.build import cache_folder
from fmus.monolith.model import content
from orchestrator import monolithic, system
from orchestrator.evidence import Evidence
from orchestrator.reader import Log, Series
from orchestrator.scene import Run, Scene, Track

Floats = NDArray[np.float64]

ORDER = 2
SAMPLING, LINKS = 1e-3, 10  # s between outputs; links at one in so many
WINDOW = 1.0  # s: tensions are compared as means and root mean squares over it
LOGS = ("truth.mcap", "coarse.mcap")


class TruthFailed(RuntimeError):
    """The monolith could not be integrated; the message is one sentence."""


class Gap(NamedTuple):
    """How far two logs lie apart in one observable, root mean squares over the run."""

    difference: float
    size: float  # of the observable itself in the second log
    unit: str


class Truth(NamedTuple):
    """A log that can be believed, and how far."""

    log: Path
    coarse_log: Path  # of the same with the internal step doubled
    internal_step: float  # s
    wall_time: float  # s that the two runs took
    gaps: dict[str, Gap]  # between the two runs, by observable
    built: bool  # now, not found

    def error(self, observable: str) -> float:
        """Estimated error of the log in an observable, root mean square over the run."""
        return self.gaps[observable].difference / (2.0**ORDER - 1.0)


def truth(scene: Scene, title: str = "") -> Truth:
    """Find or build the truth about a scene; a ``title`` shows progress.

    Depends on the physics of the scene and on the sources, not on its communication step, nor on how its components
    integrate. Two processes that want the same build it once. Raises TruthFailed, BadInput or ComponentFailed.
    """
    scene = bare(scene)
    folder = cache_folder() / "truth" / key(scene)
    built = False
    if not folder.is_dir():
        folder.parent.mkdir(parents=True, exist_ok=True)
        with _alone(folder.with_suffix(".lock")):
            if not folder.is_dir():
                _build(scene, folder, title)
                built = True
    figures = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    gaps = {name: Gap(*gap) for name, gap in figures.pop("gaps").items()}
    return Truth(folder / LOGS[0], folder / LOGS[1], **figures, gaps=gaps, built=built)


def bare(scene: Scene) -> Scene:
    """The placed scene without what a truth does not depend on; sampled at SAMPLING where its stop allows that."""
    run = scene.run
    step = SAMPLING if abs(run.stop / SAMPLING - round(run.stop / SAMPLING)) < 1e-6 else run.step
    sampled = Run(stop=run.stop, step=step, outputs=1, links=LINKS)
    track = Track(model=scene.track.model, elasticity=scene.track.elasticity, start=scene.track.start)
    return system.placed(scene).model_copy(update={"run": sampled, "track": track, "expect": {}})


def key(scene: Scene) -> str:
    """Hash of a bare scene and of the sources that make its truth."""
    physics = {name: value for name, value in scene.resolved().items() if name not in ("name", "title")}
    parts = [json.dumps(physics, sort_keys=True), content()]
    parts += [Path(str(module.__file__)).read_text(encoding="utf-8") for module in (system, monolithic)]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]


def _build(scene: Scene, folder: Path, title: str) -> None:
    """Both runs side by side and what they differ in, put in place at once."""
    stop = threading.Event()
    fresh = Path(tempfile.mkdtemp(dir=folder.parent, prefix="fresh-"))
    logs = [fresh / name for name in LOGS]
    try:
        with ThreadPoolExecutor(2) as pool:
            runs = [
                pool.submit(monolithic.run, scene, log, refine, shown, stop.is_set)
                for log, refine, shown in zip(logs, (2.0, 1.0), (title, ""), strict=True)
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
            "gaps": gaps(logs[1], logs[0]),
        }
        (fresh / "truth.json").write_text(json.dumps(figures), encoding="utf-8")
        fresh.chmod(0o755)
        with suppress(OSError):  # another process was faster
            fresh.rename(folder)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


@contextmanager
def _alone(lock: Path) -> Iterator[None]:
    """One process at a time, where the system can lock files; elsewhere both build and the first one's stays."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    handle = os.open(lock, os.O_CREAT | os.O_RDWR)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


# --- how far two logs lie apart ------------------------------------------------------------------------


def gaps(log: Path, reference: Path) -> dict[str, Gap]:
    """Differences of ``log`` from ``reference`` by observable, at the times that both hold."""
    with Log(log) as one, Log(reference) as two:
        runs = Evidence(one), Evidence(two)
        found: dict[str, Gap] = {}
        if "chassis" in runs[1].instances:
            for name, unit in (("position", "m"), ("velocity", "m/s")):
                motion = [run.vectors("chassis", "out", f"chassis.{name}") for run in runs]
                found[f"chassis {name}"] = _gap(_together(motion), unit, 3)
            found["chassis pitch"] = _gap(_together([run.signal("chassis.pitch") for run in runs]), "rad")
        for name in runs[1].instances:
            if runs[1].has(f"{name}.torque"):
                found[f"{name} torque"] = _gap(_means([run.signal(f"{name}.torque") for run in runs]), "N.m")
            topic = f"/{name}/links"
            if topic in one.topics and topic in two.topics:
                series = [log.read(topic) for log in (one, two)]
                t = _common([s.t for s in series])[0]
                tension = _together([(s.t, _columns(s, "].tension")) for s in series])
                pins = _together([(s.t, _columns(s, "].position.")) for s in series])
                means, squares = (tuple(_windows(t, v**power) for v in tension) for power in (1, 2))
                found[f"{name} tension, mean"] = _gap(means, "N")
                found[f"{name} tension, rms"] = _gap(tuple(np.sqrt(s) for s in squares), "N")
                found[f"{name} pins"] = _gap(pins, "m", 3)
    return found


def _columns(series: Series, part: str) -> Floats:
    return series.values[:, [part in name for name in series.names]]


def _gap(pair: tuple[Floats, ...], unit: str, axes: int = 1) -> Gap:
    """Root mean squares over time and columns; so many ``axes`` make a vector."""
    one, two = pair
    return Gap(float(np.sqrt(axes * np.mean((one - two) ** 2))), float(np.sqrt(axes * np.mean(two**2))), unit)


def _common(times: list[Floats]) -> tuple[Floats, Any, Any]:
    """The times of both, s, and where they stand."""
    one, two = (np.rint(t * 1e9).astype(np.int64) for t in times)
    common, first, second = np.intersect1d(one, two, return_indices=True)
    return np.asarray(common * 1e-9, dtype=float), first, second


def _together(pair: list[tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    """Values at the common times after the start."""
    _, first, second = _common([t for t, _ in pair])
    return pair[0][1][first[1:]], pair[1][1][second[1:]]


def _means(pair: list[tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    """What is a mean over the step before, as means between the common times."""
    common, *places = _common([t for t, _ in pair])
    sums = [np.cumsum(y * np.diff(t, prepend=t[0])) for t, y in pair]
    one, two = (np.diff(s[at]) / np.diff(common) for s, at in zip(sums, places, strict=True))
    return one, two


def _windows(t: Floats, values: Floats) -> Floats:
    """Means of the columns over windows of WINDOW s, the last one taking the rest; ``t`` holds the start too."""
    count = max(1, int(np.floor(t[-1] / WINDOW + 1e-9)))
    window = np.minimum(np.floor((t[1:] - 1e-9) / WINDOW), count - 1)
    return np.array([values[window == i].mean(axis=0) for i in range(count)])
