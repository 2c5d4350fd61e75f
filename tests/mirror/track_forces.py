"""Expected wrenches, strains, and forces of a track's links and pins."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from mirror.check import View
from mirror.forces import STEP, across, pin_loads, pulls
from mirror.links import UP, Rigid, gauss
from mirror.record import Floats
from mirror.track_series import AXES, link_number, wheel_names, with_start

# --- wrenches --------------------------------------------------------------------------------------


def wrenches(view: View, names: Sequence[str]) -> Floats:
    """Wrenches of the contact laws at all instants, as means over steps by the integrator's recursion."""
    forces, wheels = view.touch.wrench, wheel_names(view)
    means = with_start(forces[0], view.recursion.means(forces))
    columns = []
    for name in names:
        wheel, part, axis = re.fullmatch(r"(.+)\.(force|torque)\.([xyz])", name).groups()
        columns.append(means[:, wheels.index(wheel), AXES[axis] + 3 * (part == "torque")])
    return np.stack(columns, axis=1)


def ground(view: View, names: Sequence[str]) -> Floats:
    """Ground forces, on all links or on each, as means by the recursion."""
    means = with_start(view.touch.ground[0], view.recursion.means(view.touch.ground))
    whole = means.sum(1)
    columns = []
    for name in names:
        link = re.match(r"link\[(\d+)\]", name)
        columns.append((means[:, int(link[1]) - 1] if link else whole)[:, AXES[name[-1]]])
    return np.stack(columns, axis=1)


def ground_of_links(view: View, names: Sequence[str]) -> Floats:
    """Ground force of a link: that of the track less those of the other links."""
    (name,) = names
    axis = name[-1]
    others = [f"link[{i}].ground.force.{axis}" for i in range(1, view.chain.n + 1)]
    return (view.part[f"ground.force.{axis}"] - sum(view.part[other] for other in others if other != name))[:, None]


def wheels_of_links(view: View, names: Sequence[str]) -> Floats:
    """Forces of rims and guides on each link, with those of teeth on the pin at its end.

    In an open chain the first link also takes those on the first pin.
    """
    c, forces = view.chain, view.touch.force - view.touch.ground + view.touch.teeth[:, view.chain.second]
    if not c.closed:
        forces[:, 0] += view.touch.teeth[:, 0]
    return of_links(view, forces, names)


def parts_of_wheels(view: View, names: Sequence[str]) -> Floats:
    """Forces of teeth on each pin, of rims and of discs and wheels on the horn of each link."""
    touch = view.touch
    parts = {"tooth": touch.teeth, "rim": touch.force - touch.ground - touch.horns, "horn": touch.horns}
    means = {name: with_start(part[0], view.recursion.means(part)) for name, part in parts.items()}
    return np.stack([means[name.split(".")[1]][:, link_number(name), AXES[name[-1]]] for name in names], axis=1)


def part_of_wheels(view: View, names: Sequence[str]) -> Floats:
    """Force of the wheels on a link less its other parts."""
    (name,), c, part, axis = names, view.chain, view.part, names[0][-1]
    i = link_number(name)
    if ".tooth." in name:
        i = i - 1 if i > 0 else (c.n - 1 if c.closed else 0)
    teeth = [c.second[i]] if c.closed or i > 0 else [0, c.second[i]]
    others = [f"joint[{j + 1}].tooth.force.{axis}" for j in teeth]
    others += [f"link[{i + 1}].{what}.force.{axis}" for what in ("rim", "horn")]
    found = part[f"link[{i + 1}].wheels.force.{axis}"] - sum(part[other] for other in others if other != name)
    return found[:, None]


def of_links(view: View, forces: Floats, names: Sequence[str]) -> Floats:
    """Means over the steps, by the recursion, of a force on each link (T, n, 3)."""
    means = with_start(forces[0], view.recursion.means(forces))
    return np.stack([means[:, link_number(name), AXES[name[-1]]] for name in names], axis=1)


def sliding(view: View, names: Sequence[str]) -> Floats:
    return of_links(view, view.touch.sliding, names)


def ground_depth(view: View, names: Sequence[str]) -> Floats:
    means = with_start(view.touch.link_depth[0], view.recursion.means(view.touch.link_depth))
    return np.stack([means[:, link_number(name)] for name in names], axis=1)


def links_on_wheels(view: View, names: Sequence[str]) -> Floats:
    """Wheel force of a link: the reaction on all wheels less the forces on other links."""
    (name,) = names
    axis = name[-1]
    others = [f"link[{i}].wheels.force.{axis}" for i in range(1, view.chain.n + 1)]
    on_wheels = sum(view.part[f"{wheel}.force.{axis}"] for wheel in wheel_names(view))
    return (-on_wheels - sum(view.part[other] for other in others if other != name))[:, None]


def newton(view: View, names: Sequence[str]) -> Floats:
    """Balance at rest: residual of joint forces, ground force and weight of a link."""
    (name,) = names
    c, part, i, axis = view.chain, view.part, link_number(names[0]) + 1, name[-1]
    forces = np.full(len(part.t), np.nan)
    force = part[f"joint[{c.second[i - 1] + 1}].force.{axis}"] - part[f"joint[{i}].force.{axis}"]
    weight = c.mass * c.gravity if axis == "z" else 0.0
    forces[0] = (force + weight - part[f"link[{i}].ground.force.{axis}"])[0]
    return forces[:, None]


def momentum(view: View, names: Sequence[str]) -> Floats:
    """Force from the change of the chain's momentum over each step less all other forces."""
    (name,), part, c = names, view.part, view.chain
    damped = view.recursion.means(across(c)[0].sum(1))
    gained = np.diff(chain_momentum(view), axis=0) / part.h[:, None]
    others = sum(pulls(c)) - c.n * c.mass * c.gravity * UP + damped
    forces = [(f"{wheel}.force", -1.0) for wheel in wheel_names(view)] + [("ground.force", 1.0)]
    sign = 0.0
    for other, way in forces:
        for axis, k in AXES.items():
            if f"{other}.{axis}" == name:
                sign, column = way, k
            else:
                others = others + np.where(np.arange(3) == k, way * part[f"{other}.{axis}"][1:, None], 0.0)
    return with_start(np.array(np.nan), sign * (gained - others)[:, column])[:, None]


def chain_momentum(view: View) -> Floats:
    """Linear momentum of the chain, world frame (T, 3)."""
    c = view.chain
    if isinstance(c, Rigid):
        return c.mass * c.velocity.sum(1)
    return np.einsum("ab,tnbi->ti", c.mass_matrix[[0, len(c.mass_matrix) // 2]], c.v)


# --- strains and forces of links -------------------------------------------------------------------


def tensions(view: View) -> Floats:
    """Tensions (K + 1, n): from strain and rotation, or of a rod with pin forces, contacts and rotation."""
    c = view.chain
    if not isinstance(c, Rigid):
        tension_of_links = c.tension + c.slope_inertia_force(view.accelerations)
        tension_of_links[:30] = np.nan  # accelerations need the preceding instants
        return tension_of_links
    first, last = pin_pulls(view)
    rotation = c.mass * c.pitch / 12.0 * (c.body_rates[..., 1:] ** 2).sum(-1)
    return 0.5 * ((first + last) * c.body[..., 0]).sum(-1) + view.touch.along + rotation


def pin_pulls(view: View) -> tuple[Floats, Floats]:
    """Forces that stretch links (K + 1, n, 3): of their first pins, reversed, and of their last pins."""
    c, forces = view.chain, view.joints
    return -forces[:, : c.n], pin_loads(view) - forces[:, c.second]


def tension(view: View, names: Sequence[str]) -> Floats:
    return tensions(view)[:, [link_number(name) for name in names]]


def tension_of_all(view: View, names: Sequence[str]) -> Floats:
    how = {"tension.min": np.min, "tension.mean": np.mean, "tension.max": np.max}
    return np.stack([how[name](tensions(view), axis=1) for name in names], axis=1)


def tension_bounds(view: View, names: Sequence[str]) -> tuple[Floats, Floats]:
    """Bounds of a link's tension from the forces of its two pins along it, while it has no contact.

    The bounds are the two forces, extended by their difference: rims pull the halves of a link apart, and an impact
    passes through it as a wave. A link that turns, at 150 rad/s where a slack run is pulled straight, adds m L w^2 /
    12, the mean of a rod over its length.
    """
    c = view.chain
    a, b, va, vb = c.ends
    along = (b - a) / np.linalg.norm(b - a, axis=-1, keepdims=True)
    turning = np.cross(along, vb - va) / np.linalg.norm(b - a, axis=-1, keepdims=True)
    rotation = c.mass * c.pitch / 12.0 * (turning**2).sum(-1)
    first, last = ((pull * along).sum(-1) for pull in pin_pulls(view))
    difference = abs(first - last)
    low, high = np.minimum(first, last) - difference + rotation, np.maximum(first, last) + difference + rotation
    low[abs(view.touch.force).max(-1) > 0.0] = np.nan
    which = [link_number(name) for name in names]
    return low[:, which], high[:, which]


def stresses(view: View) -> Floats:
    c = view.chain
    return np.zeros((len(view.part.t), c.n)) if isinstance(c, Rigid) else c.stress


def stress(view: View, names: Sequence[str]) -> Floats:
    return stresses(view)[:, [link_number(name) for name in names]]


def stress_of_all(view: View, names: Sequence[str]) -> Floats:
    return stresses(view).max(1)[:, None]


def joint_forces(view: View, names: Sequence[str]) -> Floats:
    """Pin forces as means over the steps by the recursion, known from the 30th instant on."""
    forces = view.joints.copy()
    forces[:30] = forces[30]
    means = with_start(forces[0], view.recursion.means(forces))
    means[:60] = np.nan
    return np.stack([means[:, link_number(name), AXES[name[-1]]] for name in names], axis=1)


def joints_by_momentum(view: View, names: Sequence[str]) -> Floats:
    """Pin force: change of one link's momentum over each step, less all other forces on it."""
    (name,), c, part = names, view.chain, view.part
    j, axis = link_number(name), name[-1]
    i = min(j, c.n - 1)
    gained = np.diff(c.momentum[:, i, AXES[axis]]) / part.h
    others = -c.mass * c.gravity * (axis == "z") * np.ones(len(part.h))
    for what in ("ground", "wheels"):
        if f"link[{i + 1}].{what}.force.{axis}" in part.outputs:
            others = others + part[f"link[{i + 1}].{what}.force.{axis}"][1:]
    other, sign = (c.second[i], 1.0) if j < c.n else (i, -1.0)
    force = sign * (gained - others) + part[f"joint[{other + 1}].force.{axis}"][1:]
    return with_start(np.array(np.nan), force)[:, None]


def moments(view: View, names: Sequence[str]) -> Floats:
    """Pin moments as means over the steps by the recursion, known from the 30th instant on."""
    found = moments_of_rigid_links(view) if isinstance(view.chain, Rigid) else moments_of_elements(view)
    found[:30] = found[30]
    means = with_start(found[0], view.recursion.means(found))
    means[:60] = np.nan
    return np.stack([means[:, link_number(name), AXES[name[-1]]] for name in names], axis=1)


def moments_of_rigid_links(view: View) -> Floats:
    """Moments by Euler's equations, link by link from the first pin; where both ends are joined, of least squares."""
    c, touch, F = view.chain, view.touch, view.joints
    arms = [end - c.middle for end in c.ends[:2]]
    rest = c.momentum_rates(view.accelerations)[1] - touch.torque
    rest -= 0.5 * (touch.twist[:, : c.n] + touch.twist[:, c.second])  # each link of a pin gets half
    rest -= np.cross(arms[0], F[:, : c.n]) + np.cross(arms[1], pin_loads(view) - F[:, c.second])
    found = np.concatenate([np.zeros_like(rest[:, :1]), -np.cumsum(rest, axis=1)], axis=1)
    kind = "closed" if c.closed else view.track["ends"]["kind"]
    if kind == "held":
        return found - found[:, -1:]
    found = found[:, : c.nodes]
    if kind == "pulled":  # the last pin has none either
        return found - np.linspace(0.0, 1.0, c.nodes)[:, None] * found[:, -1:]
    axis = c.axes.mean(1, keepdims=True)
    for now, pins, y in zip(found[30:], c.pins[30:], axis[30:], strict=True):
        now -= (now * y).sum(-1, keepdims=True) * y
        unit = np.concatenate([np.cross(pins, y).reshape(-1, 1), np.tile(np.eye(3), (c.nodes, 1))], axis=1)
        now -= (unit @ np.linalg.lstsq(unit, now.ravel(), rcond=1e-9)[0]).reshape(-1, 3)
    return found


def moments_of_elements(view: View) -> Floats:
    """Work of a link's strain, inertia and contacts in a change of the gradient that it shares at its first pin."""
    c = view.chain
    a, tau = c.coordinate_accelerations(view.accelerations), float(view.part.parameters["material.relaxation_time"])
    x, w = gauss(4)
    weight, found = c.mass * c.gravity * np.einsum("p,pa->a", w, c.centreline(x)), np.zeros((*c.pins.shape,))
    for end, own in enumerate((slice(0, c.n), slice(c.n, c.nodes))):
        row = c.shared_row + end * (c.e.shape[2] // 2)
        G = np.zeros((len(c.e), c.n, 3))
        for k, nudge in enumerate(c.shared_nudges):
            unit = c.nudged(row, nudge).e[:, :, row] - c.e[:, :, row]
            shift = np.zeros_like(c.e)
            shift[:, :, row] = STEP * unit
            e = c.e + tau * c.v
            work = (c.energies(e + shift) - c.energies(e - shift)) / (2.0 * STEP)
            work += (np.einsum("b,tnbi->tni", c.mass_matrix[row], a) * unit).sum(-1) + weight[row] * unit[..., 2]
            G += (work - view.touch.shared[:, :, end, k])[..., None] * unit
        moment = np.cross(c.e[:, :, row], G) * (1.0 - 2.0 * end)
        found[:, own] = moment[:, own] if end == 0 else moment[:, -1:][:, : c.nodes - c.n]
    return found


def joint_axes(view: View, names: Sequence[str]) -> Floats:
    return np.stack([view.chain.pin_axes[:, link_number(name), AXES[name[-1]]] for name in names], axis=1)


def fibre(view: View, names: Sequence[str]) -> Floats:
    c = view.chain
    if isinstance(c, Rigid):
        return np.zeros((len(view.part.t), len(names)))
    return np.stack([c.fibres[name.endswith("inner")][:, link_number(name)] for name in names], axis=1)


def gradients(view: View, names: Sequence[str]) -> Floats:
    ends = {"first": view.chain.gradients_at(0.0), "last": view.chain.gradients_at(1.0)}
    return np.stack([ends[name.split(".")[-2]][:, link_number(name), AXES[name[-1]]] for name in names], axis=1)


def joint_places(view: View, names: Sequence[str]) -> Floats:
    return np.stack([view.chain.pins[:, link_number(name), AXES[name[-1]]] for name in names], axis=1)


def joint_ways(view: View, names: Sequence[str]) -> Floats:
    """Positions of the pins, integrated from their start by the rates of the state."""
    c, h = view.chain, view.part.h[:, None, None]
    positions = c.pins[:1] + with_start(
        np.zeros(c.pins.shape[1:]), np.cumsum(0.5 * h * (c.rates[1:] + c.rates[:-1]), axis=0)
    )
    return np.stack([positions[:, link_number(name), AXES[name[-1]]] for name in names], axis=1)
