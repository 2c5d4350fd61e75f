"""Parts of a monolith: the components of a scene, their models, and the parts that mirror others.

A track's model is a part by its equations, its state in and out, and its mirror image.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fmus.chassis.observe import put_sides
from fmus.components import COMPONENT_KINDS, model_of
from fmus.drives import mount as mounts
from fmus.drives import shaft
from fmus.interface.model import Floats, InvalidParameter
from fmus.interface.ports import STATE
from fmus.physics.chain.flexible import cholesky
from fmus.physics.chain.flexible.state import State as Flexible
from fmus.physics.chain.interface import accelerate, observe
from fmus.physics.chain.on_links import MIRRORED, begin_interval, count_step
from fmus.physics.chain.report import GROUND, SUMMED
from fmus.physics.chain.rigid.jointed import to_joint_coordinates
from fmus.physics.chain.rigid.state import State as Rigid
from fmus.physics.chain.state import integrated_views, store_evaluation
from fmus.physics.rotation import quat_rotate
from fmus.physics.vector import vector
from fmus.track.choices import TRACKS
from fmus.track.model import TrackModel

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
    if kind not in COMPONENT_KINDS:
        raise InvalidParameter(f"a monolith has no part of kind '{kind}'")
    model = model_of(kind)(config)
    defaults = {port.name: port.start for port in model.ports if port.causality == "parameter"}
    unknown = [name for name in parameters if name not in defaults]
    if unknown:
        raise InvalidParameter(f"there is no parameter '{unknown[0]}'")
    model.initialise({**defaults, **parameters})
    return model


class DriveSprocket(NamedTuple):
    """Sprocket among the variables and in the state of its drive."""

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


# signs under reflection in the plane of the track:
FORCE = np.array([1.0, -1, 1])  # force
WRENCH = np.array([1.0, -1, 1, -1, 1, -1])  # wrench, or velocity and angular velocity
POSE = np.array([1.0, -1, 1, 1, -1, 1, -1])  # position and quaternion
PIN = np.array([1.0, -1, 1, 1, 1, 1, 1, -1])  # coordinates of a pin of cables
CABLE_END = np.array([1.0, -1, 1, 1, -1, 1])  # coordinates of an end of a cable with constrained joints
# free axes: rotation, origin with its rates, angular rates, their auxiliary variables, middle of the wheels
AXES = np.concatenate([np.outer(FORCE, FORCE).ravel(), *3 * [FORCE], *2 * [-FORCE], [-1.0, -1.0], FORCE, FORCE])
MIRRORS = {
    Flexible: {"q": PIN, "v": PIN, "axes": AXES},
    Rigid: {"q": POSE, "v": WRENCH, "lam": FORCE, "load": FORCE, "along": np.ones(1)},
}


class ChainSlot(NamedTuple):
    """Indices of a chain in the monolith, and its sums of a step; m wheels."""

    start: int  # begin of its part of the state
    end: int  # end of it
    motions: np.ndarray  # (m) index of each wheel's motion in ``PortMap.motion``
    wrench: int  # index in ``PortMap.wrench`` of the first of its m + 1 wrenches; the last one is the ground's
    frame: np.ndarray  # (12) track frame, see fmus.physics.wheels
    impulse: np.ndarray  # (m + 1, 6) impulses of its wrenches over the step, track frame, N s and N m s
    on_links: np.ndarray  # (k, c) impulses of the forces on each link over the step, N s
    report_sums: np.ndarray  # (REPORT) report entries integrated over the step, J and m


class ChainSystem(NamedTuple):
    """Arguments of ``physics.chain.kinds`` for a chain of any kind of link."""

    slot: ChainSlot
    links: Any  # parameters of the links
    contacts: Any  # contact partners; None without contacts
    env: Any  # gravity, ends and wheel frame
    s: Any  # state; its integrated parts are views of the stage's argument
    w: Any  # work arrays


def chain_size(model: TrackModel) -> int:
    """Number of integrated variables; raises InvalidParameter for elements other than cables."""
    kind = getattr(model, "kind", None)  # of flexible links
    if kind is not None and kind.element != "cable":
        raise InvalidParameter(f"element = '{kind.element}': the monolith knows chains of cables only")
    if model.bushed:
        raise InvalidParameter("track.bushing: the monolith knows pins without bushes only")
    if model.s.soil.size > 0:
        raise InvalidParameter(
            "ground.soil: the monolith knows hard ground only; its steps are not accepted one by one"
        )
    if type(model.s.parts) not in MIRRORS:
        raise InvalidParameter(f"the monolith knows no mirror image of the state of {type(model.link).__name__}")
    return sum(part.size for part in integrated_views(model.s).values())


def chain_system(model: TrackModel, slot: ChainSlot, y: Floats) -> ChainSystem:
    """Chain of an initialised model, whose state is a view of the part ``y`` of the stage's argument."""
    views, start = {}, 0
    for name, part in integrated_views(model.s).items():
        views[name] = y[start : start + part.size].reshape(part.shape)
        start += part.size
    return ChainSystem(slot, *model.system(), model.s._replace(**views), model.work)


def copy_state(model: TrackModel, x: Floats) -> None:
    """Copy the model's integrated variables into ``x``."""
    x[:] = model.s.flat[: x.size]


def set_state(model: TrackModel, slot: ChainSlot, x: Floats, h: float) -> None:
    """Set state, mean wrenches and report of the model after a step of length ``h``, s, and evaluate it."""
    model.s.flat[: x.size] = x
    begin_interval(model.s, model.interval)
    model.s.mean[:] = slot.impulse / h
    model.s.on_links_sum[:] += slot.on_links
    count_step(model.s, h)
    accelerate(*model.system(), model.s, model.work)
    store_evaluation(model.s, model.work)
    observe(model.link, model.environment, model.s, model.work, model.report)
    model.report[[*SUMMED]] += slot.report_sums[[*SUMMED]]


def mirror_chain(original: TrackModel, model: TrackModel) -> None:
    """Make ``model`` the mirror image of ``original`` on the other side of the vehicle."""
    s, original_state = model.s, original.s
    for name, signs in MIRRORS[type(s.parts)].items():
        view, original_view = getattr(s, name), getattr(original_state, name)
        if signs is PIN and original_view.shape[-1] == CABLE_END.size:
            signs = CABLE_END
        size = min(signs.size, original_view.shape[-1])
        view[..., :size] = original_view[..., :size] * signs[:size]
    if "joints" in integrated_views(s):
        to_joint_coordinates(model.link.links, s)
    if "p" in integrated_views(s):
        cholesky.to_cholesky(model.link, s, model.work)
    s.on_links_sum[:], s.span[:] = (
        original_state.on_links_sum * MIRRORED[: original_state.on_links_sum.shape[1]],
        original_state.span,
    )
    s.wrench[:], s.mean[:], s.sums[:] = (
        original_state.wrench * WRENCH,
        original_state.mean * WRENCH,
        original_state.sums,
    )
    model.report[:] = original.report
    model.report[GROUND + 1] *= -1.0
    model.counters[:] = original.counters
