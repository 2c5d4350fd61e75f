"""Pin forces of a chain from the motion of its links, by Newton's and Euler's equations of each link.

The n force equations of a loop leave one common force of all pins undetermined. Pins carry no moment about their own
axis, so if all axes are parallel, n moment equations give its part in the plane of the chain. Its part along the axis
depends on the lateral constraint of links: the first pin of rigid links slides along its axis and transmits only half
of the lateral tooth forces; elements bend. A chain of beams twists, so there the whole force comes from the gradient of
one link's strain energy and its inertia.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mirror.links import UP, Beam, Chain, Rigid
from mirror.record import Floats

if TYPE_CHECKING:
    from mirror.check import View

STEP = 1e-6  # m, of the difference of energies


def across(chain: Chain) -> tuple[Floats, Floats]:
    """Damping of the pins' velocity across the chain: force (T, nodes, 3), N, and lost power (T,), W."""
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
    """Constant forces (3,), N, world, on the first and on the last pin."""
    ends = chain.part.config["track"]["ends"]
    if not ends or ends["kind"] != "pulled":
        return np.zeros(3), np.zeros(3)
    return tuple(chain.turn.apply([x, 0.0, z]) for x, z in (ends["first"], ends["last"]))


def joints(view: View) -> Floats:
    """Force (T, nodes, 3), N, of each pin on the link that begins there; last open pin: on its carrier.

    The first 30 of the T instants are NaN, because the reconstruction of accelerations needs a history.
    """
    c, touch = view.chain, view.touch
    d_linear, d_angular = c.momentum_rates(view.accelerations)
    arms = [end - c.middle for end in c.ends[:2]]
    # tooth and damping forces of a pin act on the link that ends there, with the reaction of the other one
    load = (touch.teeth + across(c)[0])[:, c.second]
    if not c.closed:
        load[:, -1] = 0.0
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
    found = common[:, None] + sums
    sideways = -(found[:, 0] * axis).sum(1)
    if c.closed and isinstance(c, Rigid):
        sideways += 0.5 * (touch.teeth[:, 0] * axis).sum(1)
    found = found + sideways[:, None, None] * axis[:, None]
    if c.closed and not isinstance(c, Rigid):
        free, force = elastic_force(view)
        missing = force - found[np.arange(len(found)), free]
        if not isinstance(c, Beam):  # laterally only
            missing = (missing * axis).sum(1, keepdims=True) * axis
        found = found + missing[:, None]
    found[:30] = np.nan
    return found[:, : c.nodes]


def elastic_force(view: View) -> tuple[Floats, Floats]:
    """Number of a link without contact at each instant (T,), and the force of its first pin (T, 3), N.

    The force is the gradient of strain energy, at coordinates advanced by the material's relaxation time, plus inertia.
    """
    c = view.chain
    free = np.argmax(abs(view.touch.force).max(-1) == 0.0, axis=1)
    t = np.arange(len(free))
    e = c.e[t, free] + float(view.part.parameters["material.relaxation_time"]) * c.v[t, free]
    force = np.einsum("a,tai->ti", c.mass_matrix[0], c.accelerated(view.accelerations)[t, free])
    force += c.mass * c.gravity * 0.5 * UP
    for axis in range(3):
        shift = np.zeros(e.shape[1:])
        shift[0, axis] = STEP
        force[:, axis] += (c.energies(e + shift) - c.energies(e - shift)) / (2.0 * STEP)
    return free, force
