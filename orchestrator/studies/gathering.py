"""Runs that states of chains are taken from: every scene with a track, and the stiff and extreme cases.

Runs are short: what counts is that chains rest, drive, slide, fall, strike and hang in all ways that scenes and cases
know. The scenes ``without_fmu`` have no chain of links.
"""

from __future__ import annotations

import tempfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.build import BuildFailed
from fmus.physics.arrays import Floats
from fmus.ports import STATE
from fmus.vehicle import BadInput
from orchestrator.cosim.component import ComponentFailed
from orchestrator.cosim.coupling.scheme import CouplingFailed
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.scene.assembly import TRACK, assemble
from orchestrator.scene.scene import TrackScene
from orchestrator.studies.chain_states import FARTHEST, FASTEST, Completed, Kept, completed, keep
from orchestrator.studies.evaluations import Chain
from orchestrator.studies.extreme import FAMILIES, loaded

STATES = 42  # of a run of up to 64 links; long chains give as many links in all
NEEDED = 5  # records of a run that fails, from which on it is worth anything
WATCHED = ("track.link_outputs=true", "run.links=1", "run.outputs=10", "expect={}")

# Scenes of the gallery: track model, further settings, end of the run in s, how many times the usual number of states.
SCENES: tuple[tuple[str, str, tuple[str, ...], float, int], ...] = (
    *((scene, track, (), stop, 1) for track in ("flexible", "rigid") for scene, stop in (
        ("hanging_chain", 0.2), ("sprocket_bench", 1.2), ("rig", 1.5), ("settle", 0.6), ("released_chain", 0.5),
        ("folded_chain", 0.85), ("spinning_loop", 0.3),
    )),
    *((scene, track, settings, stop, 3) for track in ("flexible", "rigid") for scene, settings, stop in (
        ("straight", ("symmetric=true", "drive.ramp_start=0.3 s", "drive.ramp_time=2 s"), 3.0),
        ("hard_stop", (), 2.5),
    )),
    ("straight", "flexible", ("symmetric=true", "track.element=beam", "drive.ramp_start=0.1 s",
                              "drive.ramp_time=1.5 s"), 1.2, 1),
    ("straight", "rigid", ("start.heading=37 deg", "drive.ramp_start=0.1 s", "drive.ramp_time=2 s"), 1.5, 1),
    ("settle", "flexible", ("symmetric=true", "planar=true"), 0.4, 1),
    *(("hanging_chain", "flexible", ("track.start=displaced", f"track.elasticity={elasticity}"), 0.4, 1)
      for elasticity in ("small_deformation", "general", "engineering")),
    ("hanging_chain", "rigid", ("track.start=displaced",), 0.4, 1),
)  # fmt: skip

# The end of a run of a family, s, where it is not the usual one; what takes minutes and says nothing new about chains.
STOP = 1.2
STOPS = {"obstacle": 3.5, "sprockets": 2.7, "speed": 2.5, "friction": 2.0, "thrown": 1.6, "rolled": 1.6,
         "communication": 0.5, "links of": 0.4}  # fmt: skip
LEFT_OUT = ("minutes of driving: 10", "links round two wheels: 256")


class Source(NamedTuple):
    """A run."""

    name: str
    scene: str
    track: str
    settings: tuple[str, ...]
    longest: float  # s; a scene may end before
    times: int = 1  # the usual number of states


class Gathered(NamedTuple):
    """States of a run, and the chain they are of."""

    name: str
    config: Mapping[str, Any]  # of the component, as it is built
    parameters: Mapping[str, Any]
    kept: Kept

    def completed(self) -> Completed:
        """The states with all that an evaluation needs, drawn by the name."""
        pitch, closed = self.config["vehicle"]["track"]["pitch"], self.config["track"]["closed"]
        return completed(self.kept, float(pitch), bool(closed), zlib.crc32(self.name.encode()))


def sources() -> Iterator[Source]:
    """All runs."""
    for scene, track, settings, longest, times in SCENES:
        yield Source(", ".join((scene, track, *settings)), scene, track, settings, longest, times)
    for family in FAMILIES:
        longest = next((stop for start, stop in STOPS.items() if family.name.lower().startswith(start)), STOP)
        for value in family.values:
            name = f"{family.name}: {value:g}"
            if name not in LEFT_OUT:
                yield Source(name, family.scene, family.track, tuple(family.settings(value)), longest)


def gather(source: Source) -> Gathered | str:
    """The states of a run, also of one that fails on its way; a sentence where there are none."""
    try:
        scene = loaded(source.scene, source.track, (*source.settings, *WATCHED))
        stop = min(scene.run.stop, source.longest)
        scene = scene.model_copy(update={"run": scene.run.model_copy(update={"stop": stop})})
        tracks = [part for part in assemble(scene).parts if part.stage == TRACK]
        if not tracks:
            return f"{source.name}: no track"
        with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
            path = Path(folder) / "run.mcap"
            simulate(scene, path)
            with Log(path) as log:
                return _states(source, scene, tracks[0], log)
    except (BadInput, BuildFailed, ComponentFailed, CouplingFailed, LookupError, ValueError) as error:
        return f"{source.name}: {error}"


def _states(source: Source, scene: TrackScene, part: Any, log: Log) -> Gathered | str:
    frame = Chain("rigid", part.config, part.parameters).frame
    links, inputs = log.read(f"/{part.name}/links"), log.read(f"/{part.name}/in")
    nodes = sum(name.endswith("].position.x") for name in links.names)
    columns = [[links.names.index(f"joint[{i}].position.{a}") for i in range(1, nodes + 1)] for a in "xyz"]
    pins = _seen(np.stack([links.values[:, c] for c in columns], axis=-1) - frame[:3], frame)
    wanted = max(6, round(source.times * STATES * min(1.0, 65 / nodes)))
    last = len(links.t) - 2
    if last < NEEDED:
        return f"{source.name}: {len(links.t)} records"
    k = np.unique(np.rint(np.linspace(1, last, wanted)).astype(int))
    velocities = (pins[k + 1] - pins[k - 1]) / (links.t[k + 1] - links.t[k - 1])[:, None, None]
    at = np.clip(np.searchsorted(inputs.t, links.t[k] + 1e-9) - 1, 0, len(inputs.t) - 1)
    wheels = _wheels(inputs.values[at].reshape(len(k), -1, STATE), frame)
    near, slow = np.abs(pins[k]).max(axis=(1, 2)) < FARTHEST, np.abs(velocities).max(axis=(1, 2)) < FASTEST
    good = near & slow  # not NaN either
    if good.sum() < NEEDED:
        return f"{source.name}: nothing that could be kept"
    shape = scene.vehicle.track.pitch, bool(part.config["track"]["closed"])
    kept = keep(pins[k][good], velocities[good], wheels[good], *shape)
    parameters = {name: value for name, value in part.parameters.items() if name not in ("integrator", "step")}
    return Gathered(source.name, part.config, parameters, kept)


def _seen(vectors: Floats, frame: Floats) -> Floats:
    """Vectors (..., 3) of the world in the plane of a track: ahead and up."""
    return np.stack([frame[3] * vectors[..., 0] + frame[4] * vectors[..., 1], vectors[..., 2]], axis=-1)


def _wheels(u: Floats, frame: Floats) -> Floats:
    """Wheels (S, m, 13) of the world as ``chain_states.keep`` wants them."""
    place, pace = _seen(u[..., :3] - frame[:3], frame), _seen(u[..., 7:10], frame)
    half = 0.5 * np.arctan2(frame[4], frame[3])
    c, s = np.cos(half), np.sin(half)
    w, y = c * u[..., 3] + s * u[..., 6], c * u[..., 5] - s * u[..., 4]  # the heading's quaternion taken back
    spin = frame[3] * u[..., 11] - frame[4] * u[..., 10]
    return np.concatenate([place, np.arctan2(-y, w)[..., None], pace, spin[..., None]], axis=-1)
