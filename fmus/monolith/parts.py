"""Parts of a monolith: the components of a scene, their models, and the parts that mirror others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fmus.chassis.observe import put_sides
from fmus.components import KINDS, model_of
from fmus.drives import mount as mounts
from fmus.drives import shaft
from fmus.interface.model import Floats, InvalidParameter
from fmus.interface.ports import STATE
from fmus.physics.rotation import quat_rotate
from fmus.physics.vector import vector
from fmus.track.choices import TRACKS

CHAINS = tuple(track.fmu for track in TRACKS.values())  # kinds of parts that are chains
DIFFERENTIAL = "SteeringDifferential"
# prefixes of the sprockets of a kind of drive, and where each begins in its state
SPROCKETS = {"SprocketDrive": {"": 0}, DIFFERENTIAL: {"left.": 0, "right.": mounts.WIDTH}}
# where each shaft begins in its state
SHAFTS = {"SprocketDrive": (0,), DIFFERENTIAL: (2 * mounts.WIDTH, 2 * mounts.WIDTH + shaft.SHAFT)}


class MonolithPart(NamedTuple):
    """Component of a scene before it is initialised."""

    name: str  # of the instance
    kind: str  # of the FMU
    config: Mapping[str, Any]  # as packed into the FMU
    parameters: Mapping[str, float | int | str]  # set before initialisation


def initialised_model(kind: str, config: Mapping[str, Any], parameters: Mapping[str, float | int | str]) -> Any:
    """Initialised model of a component; raises InvalidParameter or StepFailed."""
    if kind not in KINDS:
        raise InvalidParameter(f"a monolith has no part of kind '{kind}'")
    model = model_of(kind)(config)
    defaults = {port.name: port.start for port in model.ports if port.causality == "parameter"}
    unknown = [name for name in parameters if name not in defaults]
    if unknown:
        raise InvalidParameter(f"there is no parameter '{unknown[0]}'")
    model.initialise({**defaults, **parameters})
    return model


class DriveSprocket(NamedTuple):
    """Sprocket of a drive."""

    name: str  # of the drive
    prefix: str  # of its variables there
    inertia: float  # of its spin, kg m2
    state: Floats  # (WIDTH) view of the drive's state
    rest_motion: Floats  # (13) motion of its mount if that is not connected


def sprockets(part: MonolithPart, model: Any) -> list[DriveSprocket]:
    """Sprockets of a drive with its initialised model."""
    standing = model.rest_motion.reshape(-1, STATE)
    return [
        DriveSprocket(part.name, prefix, model.inertia, model.state[at : at + mounts.WIDTH], mount)
        for (prefix, at), mount in zip(SPROCKETS[part.kind].items(), standing, strict=True)
    ]


def shaft_states(part: MonolithPart, model: Any) -> list[Floats]:
    """State (SHAFT) of each shaft of a drive, views of its initialised model's."""
    return [model.state[at : at + shaft.SHAFT] for at in SHAFTS[part.kind]]


def mirrored(parts: Sequence[MonolithPart]) -> dict[str, str]:
    """Left part of each right part that mirrors it, by name; empty if the sides differ in anything."""
    named = {part.name: part for part in parts}
    pairs = {name: name.replace("right", "left", 1) for name in named if name.startswith("right")}
    chassis = next((part for part in parts if part.kind == "Chassis"), None)
    if chassis is None or list(chassis.config["chassis"]["sides"]) != ["left", "right"]:
        return {}
    for right, left in pairs.items():
        if left not in named or (named[left].kind, named[left].config) != (
            named[right].kind,
            named[right].config,
        ):
            return {}
        mirrored = dict(named[right].parameters)
        mirrored["start.lateral"] = -float(mirrored["start.lateral"])
        if dict(named[left].parameters) != mirrored:
            return {}
    return pairs if len(parts) == 2 * len(pairs) + 1 else {}


def mirror_drive(original: Any, model: Any, chassis: Any) -> None:
    """Make ``model`` the mirror image of the drive ``original`` the other side; the chassis moves symmetrically."""
    motions = np.zeros(STATE * (len(chassis.tree.is_arm) + 2))
    put_sides(chassis.tree, chassis.state, 2, motions, 0)
    mount, state = motions[-STATE:], model.state
    axis = np.array(quat_rotate(mount[3:7], (0.0, 1.0, 0.0)))
    state[:] = original.state
    mounts.put_sprocket_motion(state, vector(mount, 0), mount[3:7], vector(mount, 7), vector(mount, 10))
    for first, sign in ((mounts.MOUNT, 1.0), (mounts.MOUNT + 3, -1.0), (mounts.MOMENTUM, -1.0)):
        v = original.state[first : first + 3]
        state[first : first + 3] = sign * (v - 2.0 * (v * axis).sum() * axis)
