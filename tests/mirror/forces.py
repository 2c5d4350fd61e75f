"""Pin forces of a chain from the motion of its links: Newton's and Euler's equations, link by link.

The n force equations leave one force open that all pins may have in common. Pins carry no moment about their own axis:
where all axes are parallel, n moment equations give its part in the plane of the chain. Its part along the axis depends
on the lateral support of the links: the first pin of rigid ones is free along its axis and passes on no more than the
halves of the teeth's forces; elements are bent. A chain of beams twists: there all of it is the gradient of one link's
strain energy, and its inertia.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mirror.beams import Beam
from mirror.links import UP, Chain, Rigid
from mirror.record import Floats

if TYPE_CHECKING:
    from mirror.check import View

STEP = 1e-6  # m, for differences of energies


def across(chain: Chain) -> tuple[Floats, Floats]:
    """Transverse damping of the pins: force (T, nodes, 3), N, and loss (T), W."""
    damping = float(chain.part.config["track"].get("transverse_damping") or 0.0)
    v = chain.rates
    if isinstance(chain, Rigid):
        x = chain.body[..., 0]
        before, after = np.roll(x, 1, 1), x
        if not chain.closed:
            before, after = (np.concatenate(p, 1) for p in ((0 * x[:, :1], x), (x, 0 * x[:, :1])))
        along = before + after
    else:
        k = np.arange(chain.nodes)
        pair = ((k + 1) % chain.nodes, (k - 1) % chain.nodes)
        if not chain.closed:
            pair = np.minimum(k + 1, k[-1]), np.maximum(k - 1, 0)
        along = chain.pins[:, pair[0]] - chain.pins[:, pair[1]]
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    force = -damping * (v - (v * along).sum(-1, keepdims=True) * along)
    return force, -(force * v).sum((1, 2))


def pulls(chain: Chain) -> tuple[Floats, Floats]:
    """Constant forces on the first and on the last pin, world frame, N."""
    ends = chain.part.config["track"]["ends"]
    if not ends or ends["kind"] != "pulled":
        return np.zeros(3), np.zeros(3)
    return tuple(chain.turn.apply([x, 0.0, z]) for x, z in (ends["first"], ends["last"]))


def pin_loads(view: View) -> Floats:
    """Forces of teeth and damping on the last pin of each link (T, n, 3), which pass to it; none on the support."""
    c = view.chain
    load = (view.touch.teeth + across(c)[0])[:, c.second]
    if not c.closed:
        load[:, -1] = 0.0
    return load


def joints(view: View) -> Floats:
    """Force of each pin on the link that begins there, N, shape (T, nodes, 3).

    The last pin of an open chain: on its support. T instants; the first 30 are NaN, because accelerations are found
    from the preceding instants.
    """
    c, touch = view.chain, view.touch
    d_linear, d_angular = c.momentum_rates(view.accelerations)
    arms = [end - c.middle for end in c.ends[:2]]
    load = pin_loads(view)  # with the reaction of the next link
    needed = d_linear + c.mass * c.gravity * UP - touch.force - load
    moment = d_angular - touch.torque - np.cross(arms[1], load)
    sums = np.concatenate([np.zeros_like(needed[:, :1]), -np.cumsum(needed, axis=1)], axis=1)
    rest = moment - np.cross(arms[0], sums[:, :-1]) + np.cross(arms[1], sums[:, 1:])
    rest = (rest * c.axes).sum(-1)
    G = np.cross(c.axes, arms[0] - arms[1])
    axis = c.axes.mean(1)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    M = np.einsum("tni,tnj->tij", G, G) + c.pitch**2 * c.n * axis[:, :, None] * axis[:, None]
    common = np.linalg.solve(M, np.einsum("tni,tn->ti", G, rest)[..., None])[..., 0]
    pin_forces = common[:, None] + sums
    lateral = -(pin_forces[:, 0] * axis).sum(1)
    if c.closed and isinstance(c, Rigid):
        lateral += 0.5 * (touch.teeth[:, 0] * axis).sum(1)
    pin_forces = pin_forces + lateral[:, None, None] * axis[:, None]
    if c.closed and not isinstance(c, Rigid):
        free, force = elastic_force(view)
        missing = force - pin_forces[np.arange(len(pin_forces)), free]
        if not isinstance(c, Beam):  # the lateral component only
            missing = (missing * axis).sum(1, keepdims=True) * axis
        pin_forces = pin_forces + missing[:, None]
    pin_forces[:30] = np.nan
    return pin_forces[:, : c.nodes]


def elastic_force(view: View) -> tuple[Floats, Floats]:
    """Return for each instant a link without contact, and the force of its first pin (T, 3), N.

    The force is the gradient of the link's strain energy, at coordinates advanced by the damping's relaxation time,
    plus its inertia.
    """
    c = view.chain
    free = np.argmax(abs(view.touch.force).max(-1) == 0.0, axis=1)
    t = np.arange(len(free))
    e = c.e[t, free] + float(view.part.parameters["material.relaxation_time"]) * c.v[t, free]
    force = np.einsum("a,tai->ti", c.mass_matrix[0], c.coordinate_accelerations(view.accelerations)[t, free])
    force += c.mass * c.gravity * 0.5 * UP
    for axis in range(3):
        shift = np.zeros(e.shape[1:])
        shift[0, axis] = STEP
        force[:, axis] += (c.energies(e + shift) - c.energies(e - shift)) / (2.0 * STEP)
    return free, force
