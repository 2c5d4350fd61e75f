"""Expected outputs of a track."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from mirror.check import Check, View, forward
from mirror.forces import across, pulls
from mirror.links import UP, Rigid
from mirror.motion import rotation_of
from mirror.record import Floats
from mirror.touch import CAUSES, touch

AXES = {axis: k for k, axis in enumerate("xyz")}
SPLIT = 0.1  # rad, angle between the neighbours of a link above which the run is not straight
MOMENT = 1e-7  # s, for differences of stored energies


def wheel_names(view: View) -> list[str]:
    return [wheel["name"] for wheel in view.track["wheels"]]


def with_start(first: Floats, steps: Floats) -> Floats:
    """Prepend the value at the start to those of the steps."""
    return np.concatenate([first[None], steps])


def integrated(view: View, rates: Floats) -> Floats:
    """Integral of a rate at instants by the trapezium rule, as the component sums it."""
    return np.concatenate([[0.0], np.cumsum(0.5 * view.part.h * (rates[1:] + rates[:-1]))])


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


# --- motion along the chain -----------------------------------------------------------------------


def attitude(view: View):
    """Rotation and angular velocity (K + 1, 3) of the wheels' support: the chassis, where there is one."""
    if "chassis" in view.record.parts:
        chassis = view.record["chassis"]
        return rotation_of(chassis.vector("chassis.orientation", "wxyz")), chassis.vector("chassis.angular_velocity")
    turn = view.chain.turn
    return type(turn).concatenate([turn] * len(view.part.t)), np.zeros((len(view.part.t), 3))


def over_carrier(view: View) -> Floats:
    """Mean velocity of the straight runs along the chain, relative to the sprocket's mount (K + 1)."""
    c = view.chain
    a, b, va, vb = c.ends
    _, spin = attitude(view)
    if view.on_wheels():
        centre, v = view.wheels.centre[:, :1], view.wheels.velocity[:, :1]
        va, vb = (u - v - np.cross(spin[:, None], x - centre) for x, u in ((a, va), (b, vb)))
    along = (b - a) / np.linalg.norm(b - a, axis=-1, keepdims=True)
    if c.closed:
        before, after = np.roll(along, 1, axis=1), np.roll(along, -1, axis=1)
    else:
        before, after = (along[:, np.clip(np.arange(c.n) + k, 0, c.n - 1)] for k in (-1, 1))
    bend = 2.0 * (1.0 - (before * after).sum(-1)) / SPLIT**2
    weight = 1.0 / (1.0 + bend**2)
    return (weight * (0.5 * (va + vb) * along).sum(-1)).sum(1) / weight.sum(1)


def speed(view: View, names: Sequence[str]) -> Floats:
    return over_carrier(view)[:, None]


def travel(view: View, names: Sequence[str]) -> Floats:
    return integrated(view, over_carrier(view))[:, None]


def pin_travel(view: View) -> tuple[Floats, Floats]:
    """Distance of pins past lines fixed on the vehicle, on the upper and the lower run (K + 1), m."""
    c, (turn, _) = view.chain, attitude(view)
    matrix = turn.as_matrix()
    local = np.einsum("tji,tnj->tni", matrix, c.pins - view.wheels.centre[:, :1])
    places = np.array([wheel["position"] for wheel in view.track["wheels"]])
    x, z, far, height = local[..., 0], local[..., 2], places[:, 0].min(), places[:, 1].mean()
    runs = []
    for upper in (True, False):
        travel_bounds = []
        for line in np.linspace(0.8 * far, 0.2 * far, 12):
            d, e = x - line, np.roll(x - line, -1, axis=1)
            crosses = (d * e <= 0.0) & ((z > height) == upper) & (abs(d - e) < 2.0 * c.pitch)
            i, t = np.argmax(crosses, axis=1), np.arange(len(x))
            phase = np.unwrap(i + d[t, i] / (d[t, i] - e[t, i]), period=c.n)
            travel_bounds.append(c.pitch * (phase[0] - phase))
        runs.append(np.median(travel_bounds, axis=0))
    return runs[0], runs[1]


def travel_bounds(view: View, names: Sequence[str]) -> tuple[Floats, Floats]:
    """Bounds of the travel: the distances on the upper and on the lower run."""
    above, below = pin_travel(view)
    return np.minimum(above, below)[:, None], np.maximum(above, below)[:, None]


def growth_of_travel(view: View, names: Sequence[str]) -> Floats:
    """Speed at the end of a step from the travel: twice the mean speed less the speed at the other end."""
    mean = np.diff(view.part["travel"]) / view.part.h
    speed_now = over_carrier(view)
    return np.concatenate([[np.nan], 2.0 * mean - speed_now[:-1]])[:, None]


def slip(view: View, names: Sequence[str]) -> Floats:
    """Rearward velocity of the ground's contact points, averaged by their load."""
    t = view.touch
    back = -(t.slide * forward(view)).sum(1)
    return (back / np.where(t.load > 0.0, t.load, np.inf))[:, None]


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
    load = (view.touch.teeth + across(c)[0])[:, c.second]
    if not c.closed:
        load[:, -1] = 0.0
    return -forces[:, : c.n], load - forces[:, c.second]


def link_number(name: str) -> int:
    return int(re.search(r"\[(\d+)\]", name).group(1)) - 1


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


# --- energies --------------------------------------------------------------------------------------


def kinetic(view: View, names: Sequence[str]) -> Floats:
    return view.chain.kinetic[:, None]


def strain(view: View, names: Sequence[str]) -> Floats:
    return (view.chain.strain_energy * np.ones(len(view.part.t)))[:, None]


def gravity(view: View, names: Sequence[str]) -> Floats:
    c = view.chain
    return (c.mass * c.gravity * (c.height - c.origin[2]).sum(1))[:, None]


def contact_energy(view: View, names: Sequence[str]) -> Floats:
    return view.touch.stored[:, None]


def losses(view: View, names: Sequence[str]) -> Floats:
    """Energy lost in contacts, in the material of links, and by damping across the chain."""
    c = view.chain
    powers = {cause: view.touch.losses[:, k] for k, cause in enumerate(CAUSES)}
    powers["material"] = np.zeros(len(view.part.t)) if isinstance(c, Rigid) else c.material_loss
    powers["joints"] = across(c)[1]
    powers["dissipated"] = sum(powers.values())
    return np.stack([integrated(view, powers[name.rpartition(".")[2]]) for name in names], axis=1)


def causes_together(view: View, names: Sequence[str]) -> Floats:
    return sum(view.part[name] for name in view.part.outputs if name.startswith("energy.dissipated."))[:, None]


def ledger(view: View, names: Sequence[str]) -> Floats:
    """Work of wheels and end loads that is neither stored nor lost by covering.

    A wheel whose next position differs from its extrapolation has jumped; the wrenches of both steps do work on it.
    """
    part, put_in = view.part, np.zeros(len(view.part.h))
    for m, wheel in enumerate(wheel_names(view)):
        wrench = np.hstack([part.vector(f"{wheel}.{what}")[1:] for what in ("force", "torque")])
        rates = np.hstack([part.input_vectors(f"{wheel}.{what}") for what in ("velocity", "angular_velocity")])
        shift = part.input_vectors(f"{wheel}.position")[1:] - view.wheels.centre[1:-1, m]
        input_attitude = rotation_of(part.input_vectors(f"{wheel}.orientation", "wxyz"))
        end_attitude = (
            Rotation.from_rotvec(part.h[:, None] * part.input_vectors(f"{wheel}.angular_velocity")) * input_attitude
        )
        jump = np.hstack([shift, (input_attitude[1:] * end_attitude[:-1].inv()).as_rotvec()])
        put_in -= part.h * (wrench * rates).sum(1)
        put_in[1:] -= (0.5 * (wrench[1:] + wrench[:-1]) * jump).sum(1)
    stored_energy = sum(part[f"energy.{name}"] for name in ("kinetic", "strain", "gravity", "contact", "covered"))
    balance = np.concatenate([[0.0], np.cumsum(put_in)]) + part["energy.work"] - (stored_energy - stored_energy[0])
    return balance[:, None]


def patch_defect(view: View, names: Sequence[str]) -> Floats:
    """Power into contacts less their losses and the growth of stored energy a moment later, integrated, J."""
    c, w = view.chain, view.wheels
    after, before = (touch(c.advanced(tau), w.advanced(tau), covering=True) for tau in (MOMENT, -MOMENT))
    now = touch(c, w, covering=True)
    grown = (after.stored - before.stored) / (2.0 * MOMENT)
    return integrated(view, now.power_in - now.losses.sum(1) - grown)[:, None]


def end_load_work(view: View, names: Sequence[str]) -> Floats:
    """Work of the constant end forces, J."""
    c = view.chain
    first, last = pulls(c)
    way = c.pins - c.pins[0]
    return (way[:, 0] @ first + way[:, -1] @ last)[:, None]


def deepest(view: View, names: Sequence[str]) -> Floats:
    return view.touch.depth[:, None]


# --- counters --------------------------------------------------------------------------------------


def steps(view: View, names: Sequence[str]) -> Floats:
    """Number of steps by the largest internal step, in runs without a halving."""
    counts = np.ceil(view.part.h / float(view.part.parameters["step"]) - 1e-9)
    return np.concatenate([[0.0], np.cumsum(counts)])[:, None]


def stages(view: View, names: Sequence[str]) -> Floats:
    return 4.0 * view.part["solver.steps"][:, None]


def tension_known(view: View) -> bool:
    """True if tensions are known: from strain for elements, from accelerations for rigid links."""
    return implicit(view) or (not isinstance(view.chain, Rigid) and view.chain.excess_inertia == 0.0)


def on_wheels(view: View) -> bool:
    return view.on_wheels()


def implicit(view: View) -> bool:
    """Whether the recursion gives impulses: one implicit internal step per communication step."""
    p = view.part.parameters
    return p["integrator"] in ("generalized_alpha", "hht") and bool((view.part.h < 1.001 * float(p["step"])).all())


def implicit_on_wheels(view: View) -> bool:
    return implicit(view) and view.on_wheels()


def explicit(view: View) -> bool:
    return view.part.parameters["integrator"] == "runge_kutta"


def undamped(view: View) -> bool:
    """Whether a chain on wheels has no transverse damping, or one that the recursion gives.

    Transverse damping is known at instants only.
    """
    return view.on_wheels() and not turning(view) and (implicit(view) or not view.track["transverse_damping"])


def turning(view: View) -> bool:
    return view.kind == "turning"


def in_free_air(view: View) -> bool:
    return not view.on_wheels()


def on_a_vehicle(view: View) -> bool:
    return "chassis" in view.record.parts


def straight_on(view: View) -> bool:
    return on_a_vehicle(view) and not turning(view)


def in_one_frame(view: View) -> bool:
    """Whether axes stay fixed and pins are undamped across.

    The recursion leaves out the rotation of the axes, and transverse damping is no output.
    """
    return not turning(view) and not view.track["transverse_damping"]


def implicit_elements(view: View) -> bool:
    return implicit_on_wheels(view) and not isinstance(view.chain, Rigid)


WHEEL = r"(sprocket|road_wheel\[\d+\]|idler)"

CHECKS = (
    Check(WHEEL + r"\.force\.[xyz]", "contact laws", wrenches, 1e-3, 0.2, applies=implicit_on_wheels),
    Check(WHEEL + r"\.torque\.[xyz]", "contact laws", wrenches, 1e-3, 0.05, applies=implicit_on_wheels),
    Check(WHEEL + r"\.force\.[xyz]", "balance of momentum", momentum, 1e-3, 1.0, balance=True, applies=undamped),
    # the recursion leaves out the rotation of the axes: its jitter leaves some 5 N of 34 kN, at shorter steps too
    Check(rf"({WHEEL}|ground)\.force\.[xyz]", "balance of momentum", momentum, 1e-3, 5.0, balance=True,
          applies=turning),
    Check(r"ground\.force\.[xyz]", "contact laws", ground, 1e-3, 2.0, applies=implicit),
    Check(r"link\[\d+\]\.ground\.force\.[xyz]", "contact laws", ground, 1e-3, 2.0, applies=implicit),
    Check(r"link\[\d+\]\.ground\.force\.[xyz]", "the track's less that of others", ground_of_links, 1e-9, 1e-7,
          balance=True),
    Check(r"link\[\d+\]\.wheels\.force\.[xyz]", "contact laws", wheels_of_links, 1e-3, 2.0, applies=implicit),
    Check(r"link\[\d+\]\.wheels\.force\.[xyz]", "the reaction of wheels less that of others", links_on_wheels, 1e-9,
          1e-7, balance=True),
    Check(r"link\[\d+\]\.wheels\.force\.[xyz]", "what balances a link at rest", newton, 1e-3, 1.0, balance=True,
          applies=straight_on),
    Check(r"link\[\d+\]\.ground\.sliding\.[xyz]", "points on the ground", sliding, 1e-3, 1e-4, applies=implicit),
    Check(r"link\[\d+\]\.ground\.depth", "points on the ground", ground_depth, 1e-4, 1e-7, applies=implicit),
    Check(r"ground\.force\.[xyz]", "balance of momentum", momentum, 1e-3, 1.0, balance=True, applies=straight_on),
    Check("travel", "straight runs over the carrier, summed", travel, 5e-3, 1e-4),
    Check("travel", "pins that have passed, counted", travel_bounds, 0.02, 2e-3, applies=on_a_vehicle),
    Check("speed", "straight runs over the carrier", speed, 5e-3, 1e-3),
    Check("speed", "growth of travel", growth_of_travel, 0.01, 1e-3, balance=True),
    Check("slip", "points on the ground against the present heading", slip, 1e-3, 1e-5, applies=on_wheels),
    Check(r"link\[\d+\]\.tension", "strain, or pin forces from motion", tension, 1e-3, 2.0, applies=tension_known),
    Check(r"link\[\d+\]\.tension", "between what its pins carry", tension_bounds, 0.03, 50.0,
          applies=implicit_elements),
    Check(r"tension\.(min|mean|max)", "of all links", tension_of_all, 1e-3, 2.0, applies=tension_known),
    Check(r"link\[\d+\]\.stress", "strain at the outer fibre", stress, 1e-4, 1e-2),
    Check(r"link\[\d+\]\.fibre\.(outer|inner)", "strain in the middle", fibre, 1e-4, 0.5),
    Check(r"joint\[\d+\]\.axis\.[xyz]", "coordinates", joint_axes, 1e-12, 1e-15),
    Check(r"link\[\d+\]\.slope\.(first|last)\.[xyz]", "coordinates", gradients, 1e-12, 1e-15),
    Check(r"stress\.max", "of all links", stress_of_all, 1e-4, 1e-2),
    Check(r"joint\[\d+\]\.force\.[xyz]", "motion of the links", joint_forces, 2e-3, 4.0, applies=implicit),
    Check(r"joint\[\d+\]\.force\.[xyz]", "balance of a link's momentum", joints_by_momentum, 1e-6, 5e-3, balance=True,
          applies=in_one_frame),
    Check(r"joint\[\d+\]\.position\.[xyz]", "coordinates", joint_places, 1e-12),
    Check(r"joint\[\d+\]\.position\.[xyz]", "ways of the pins", joint_ways, 0.0, 1e-3),
    Check(r"energy\.kinetic", "bodies", kinetic, 1e-9, 1e-9),
    Check(r"energy\.strain", "own quadrature", strain, 1e-6, 1e-7),
    Check(r"energy\.gravity", "heights", gravity, 1e-9, 1e-9),
    Check(r"energy\.contact", "penetrations", contact_energy, 1e-5, 1e-6),
    Check(r"energy\.dissipated", "laws of friction and damping", losses, 2e-3, 1e-3, applies=implicit),
    Check(r"energy\.dissipated\..*", "laws of friction and damping", losses, 3e-3, 1e-6, applies=implicit),
    Check(r"energy\.dissipated", "sum of its causes", causes_together, 1e-12, 1e-15, balance=True),
    Check(r"energy\.dissipated", "ledger", ledger, 0.03, 2.0, balance=True, applies=on_wheels),
    Check(r"energy\.dissipated", "ledger", ledger, 0.02, 1e-4, balance=True, applies=in_free_air),
    Check(r"energy\.covered", "taken in, not stored, not lost", patch_defect, 0.03, 1e-3, applies=implicit_on_wheels),
    Check(r"energy\.work", "end loads times their way", end_load_work, 1e-4, 1e-6),
    Check(r"penetration\.max", "places", deepest, 1e-5, 1e-8),
    Check(r"solver\.steps", "steps of the given length", steps, 0.0, applies=implicit),
    Check(r"solver\.evaluations", "four a step", stages, 0.0, balance=True, applies=explicit),
)  # fmt: skip
