"""Steps that are long for the contacts: known before the run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import sqrt
from typing import Any

from orchestrator.results.run_data import RunData
from orchestrator.results.validity import limits
from orchestrator.results.validity.entry import WARNING, Entry
from orchestrator.results.validity.piece import Piece

IMPLICIT = (None, "generalized_alpha", "hht")  # explicit integrators keep to steps that their contacts bear
INTERNAL = 1e-3  # s, of a track that is not told another


def signals(run: RunData) -> Iterator[str]:
    """None: the scene says it all."""
    return iter(())


def find(piece: Piece) -> Iterator[Entry]:
    """Of the scene."""
    yield from of_scene(piece.run.scene)


def of_scene(scene: Mapping[str, Any]) -> Iterator[Entry]:
    """Of links in the internal step, of wheels in the communication step; steps that follow an error are left out."""
    run, track, vehicle = (scene.get(key) or {} for key in ("run", "track", "vehicle"))
    if run.get("variable") or scene.get("assembly") not in ("vehicle", "rig", "bench"):
        return
    stiffness = {pair: vehicle["contact"][pair]["stiffness"] for pair in ("wheel", "ground", "sprocket")}
    internal = min(track.get("step") or INTERNAL, run["step"])
    # a link between a road wheel and the ground: both springs on its mass
    link = sqrt((stiffness["wheel"] + stiffness["ground"]) / vehicle["track"]["mass"]) * internal
    # the lightest thing that hangs on the exchanged wrenches, with the pins or links of its wrap in contact
    wrap = 0.5 * vehicle["sprocket"]["teeth"]
    wheel = sqrt(wrap * stiffness["wheel"] / vehicle["idler"]["mass"]) * run["step"]
    for place, value in (("link", link if track.get("integrator") in IMPLICIT else 0.0), ("idler", wheel)):
        if value > limits.STEP:
            yield Entry("contact_step", "tracks", 0.0, place, value, limits.STEP, WARNING)
