"""Entries for steps that are too long for the contacts; known before the run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import sqrt
from typing import Any

from orchestrator.results.run_data import RunData
from orchestrator.results.validity import limits
from orchestrator.results.validity.exceedance import WARNING, Exceedance
from orchestrator.results.validity.piece import Piece

IMPLICIT = (None, "generalized_alpha", "hht")  # explicit integrators limit their steps themselves
INTERNAL = 1e-3  # s, default of a track


def signals(run: RunData) -> Iterator[str]:
    """No signals: the scene suffices."""
    return iter(())


def find(piece: Piece) -> Iterator[Exceedance]:
    """Entries for the scene of the run."""
    yield from of_scene(piece.run.scene)


def of_scene(scene: Mapping[str, Any]) -> Iterator[Exceedance]:
    """Entries for links in the internal step and wheels in the communication step.

    Steps that follow an error estimate are left out.
    """
    run, track, vehicle = (scene.get(key) or {} for key in ("run", "track", "vehicle"))
    if run.get("variable") or scene.get("assembly") not in ("vehicle", "rig", "bench"):
        return
    stiffness = {pair: vehicle["contact"][pair]["stiffness"] for pair in ("wheel", "ground", "sprocket")}
    internal = min(track.get("step") or INTERNAL, run["step"])
    # link between a road wheel and the ground: both springs act on its mass
    link = sqrt((stiffness["wheel"] + stiffness["ground"]) / vehicle["track"]["mass"]) * internal
    # lightest body on the exchanged wrenches, in contact with the pins or links of its wrap
    wrap = 0.5 * vehicle["sprocket"]["teeth"]
    wheel = sqrt(wrap * stiffness["wheel"] / vehicle["idler"]["mass"]) * run["step"]
    for place, value in (("link", link if track.get("integrator") in IMPLICIT else 0.0), ("idler", wheel)):
        if value > limits.STEP:
            yield Exceedance("contact_step", "tracks", 0.0, place, value, limits.STEP, WARNING)
