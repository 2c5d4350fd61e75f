"""A track's model as a part of the monolith: its equations, its state in and out, its mirror image."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fmus.interface.model import Floats, InvalidParameter
from fmus.physics.chain.flexible import cholesky
from fmus.physics.chain.flexible.state import State as Flexible
from fmus.physics.chain.interface import accelerate, observe
from fmus.physics.chain.on_links import MIRRORED, begin_interval, count_step
from fmus.physics.chain.report import GROUND, REPORT, SUMMED
from fmus.physics.chain.rigid.jointed import to_joint_coordinates
from fmus.physics.chain.rigid.state import State as Rigid
from fmus.physics.chain.state import integrated_views
from fmus.physics.chain.state import store_evaluation as store_evaluation
from fmus.track.model import TrackModel

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

REPORT_SUMS = REPORT


class ChainSlot(NamedTuple):
    """Indices of a chain in the monolith, and its sums of a step; m wheels."""

    start: int  # begin of its part of the state
    end: int  # end of it
    motions: np.ndarray  # (m) index of each wheel's motion in ``PortMap.motion``
    wrench: int  # index in ``PortMap.wrench`` of the first of its m + 1 wrenches; the last one is the ground's
    frame: np.ndarray  # (12) track frame, see fmus.physics.wheels
    impulse: np.ndarray  # (m + 1, 6) impulses of its wrenches over the step, track frame, N s and N m s
    on_links: np.ndarray  # (k, c) impulses of the forces on each link over the step, N s
    report_sums: np.ndarray  # (REPORT_SUMS) report entries integrated over the step, J and m


class ChainSystem(NamedTuple):
    """Arguments of ``physics.chain.kinds`` for a chain of any kind of link."""

    slot: ChainSlot
    links: Any  # parameters of the links
    contacts: Any  # contact partners; None without contacts
    env: Any  # gravity, ends and carrier
    s: Any  # state; its integrated parts are views of the stage's argument
    w: Any  # work arrays


def size(model: TrackModel) -> int:
    """Number of integrated variables; raises InvalidParameter for elements other than cables."""
    kind = getattr(model, "kind", None)  # of flexible links
    if kind is not None and kind.element != "cable":
        raise InvalidParameter(f"element = '{kind.element}': the monolith knows chains of cables only")
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


def mirror(original: TrackModel, model: TrackModel) -> None:
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
