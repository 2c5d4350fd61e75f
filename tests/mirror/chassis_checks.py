"""Expected outputs of a chassis."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from mirror.check import Check, View
from mirror.hull import Y, ground_contacts
from mirror.links import UP
from mirror.motion import ground_frame
from mirror.record import Floats

PARTS = {"position": "xyz", "orientation": "wxyz", "velocity": "xyz", "angular_velocity": "xyz"}
PLACE = r"(chassis|hitch|seat\.\w+|(left|right)\.(road_wheel\[\d+\]|idler|sprocket))"


def mean(a: Floats) -> Floats:
    """Mean over each step of a quantity that changes smoothly."""
    return 0.5 * (a[1:] + a[:-1])


def running_sum(start, gains: Floats) -> Floats:
    """Cumulative sum of the gains of each step from a start."""
    return start + np.concatenate([np.zeros((1, *gains.shape[1:])), np.cumsum(gains, axis=0)])


def at_instants(means: Floats) -> Floats:
    """Values at instants from means over the steps on both sides; NaN at both ends."""
    none = np.full((1, *means.shape[1:]), np.nan)
    return np.concatenate([none, mean(means), none])


# --- positions and motion --------------------------------------------------------------------------


def motion(view: View, names: Sequence[str]) -> Floats:
    """Pose and rates from the state, by geometry; velocities are differences of places a moment apart."""
    motions, columns = {}, []
    for name in names:
        place, part, axis = name.rsplit(".", 2)
        if place not in motions:
            m = view.hull.motion_of(place)
            motions[place] = {"position": m.position, "velocity": m.velocity, "angular_velocity": m.spin,
                             "orientation": m.attitude.as_quat(scalar_first=True)}  # fmt: skip
        columns.append(motions[place][part][:, PARTS[part].index(axis)])
    return np.stack(columns, axis=1)


def angles(view: View, names: Sequence[str]) -> Floats:
    columns = dict(zip(("yaw", "pitch", "roll"), view.hull.attitude.as_euler("ZYX").T, strict=True))
    return np.stack([columns[name] for name in names], axis=1)


def body_rates(view: View, names: Sequence[str]) -> Floats:
    """Angular velocity, of differences of attitudes a moment apart, along the axes of the chassis."""
    rates = view.hull.attitude.inv().apply(view.hull.motion_of("chassis").spin)
    return rates[:, ["xyz".index(name[-1]) for name in names]]


def progress(view: View, names: Sequence[str]) -> Floats:
    """Forward speed, distance along the initial heading, and settlement below the drawn height, on the ground there."""
    h = view.hull
    ahead, _, normal = ground_frame(view.part.parameters).as_matrix().T
    way, (origin, attitude) = h.place - h.place[0], h.start
    drawn = origin + attitude.apply(h.vehicle["chassis"]["centre"])
    quantities = {
        "speed": (h.velocity * h.attitude.apply([1.0, 0.0, 0.0])).sum(1),
        "distance": way @ ahead,
        "settlement": (drawn - h.place) @ normal,
    }
    return np.stack([quantities[name] for name in names], axis=1)


def weight(view: View) -> Floats:
    return -view.hull.vehicle["gravity"] * UP


def integrated_position(view: View, names: Sequence[str]) -> Floats:
    """Place of the chassis, integrated from its velocity outputs."""
    part = view.part
    position = running_sum(view.hull.place[0], part.h[:, None] * mean(part.vector("chassis.velocity")))
    return position[:, ["xyz".index(name[-1]) for name in names]]


def velocity(view: View, names: Sequence[str]) -> Floats:
    """Velocity of the chassis: impulses from rest, less the momentum of all other bodies."""
    bodies, part = view.hull.bodies(without_rates=True), view.part
    mass = sum(body.mass for body in bodies)
    force = sum(f for _, f, _ in view.hull.wrenches) + mass * weight(view)
    others = sum(body.mass * body.velocity for body in bodies[1:])
    momentum = running_sum(np.zeros(3), part.h[:, None] * force)
    return ((momentum - others) / bodies[0].mass)[:, ["xyz".index(name[-1]) for name in names]]


def angular_velocity(view: View, names: Sequence[str]) -> Floats:
    """Angular velocity of the chassis from its angular momentum.

    It is the sum of the moments about the start, less the angular momentum of all other bodies.
    """
    h, part = view.hull, view.part
    attitude, bodies, about = h.output_attitude, h.bodies(without_rates=True), h.place[0]
    moment = sum(np.cross(mean(part.vector(f"{name}.position")) - about, f) + t for name, f, t in h.wrenches)
    moment = moment + sum(body.mass * np.cross(mean(body.place) - about, weight(view)) for body in bodies)
    momentum = running_sum(np.zeros(3), part.h[:, None] * moment)
    momentum -= sum(np.cross(body.place - about, body.mass * body.velocity) for body in bodies)
    momentum -= sum(body.spin for body in bodies[1:])
    body_rates = attitude.inv().apply(momentum) / np.array(h.vehicle["chassis"]["inertia"])
    return attitude.apply(body_rates)[:, ["xyz".index(name[-1]) for name in names]]


# --- springs ---------------------------------------------------------------------------------------


def leaf(view: View, name: str) -> int:
    """Index of the leaf of an output of an arm, a spring or a tensioner."""
    side, rest = name.split(".", 1)
    number = re.search(r"\[(\d+)\]", rest)
    return view.hull.names.index(f"{side}.road_wheel[{number.group(1)}]" if number else f"{side}.idler")


def arm_angles(view: View, names: Sequence[str]) -> Floats:
    return np.stack([view.hull.arm_angle(leaf(view, name)) for name in names], axis=1)


def lengths(view: View, names: Sequence[str]) -> Floats:
    h = view.hull
    return np.stack([h.spring(k, h.arm_angle(k))[0] for k in (leaf(view, name) for name in names)], axis=1)


def leaf_forces(view: View, k: int) -> tuple[Floats, Floats]:
    """Forces of the spring and of the damper of a leaf, N."""
    h, p = view.hull, view.part.parameters
    if h.is_road(k):
        table, (length, lever) = h.vehicle["suspension"], h.spring(k, h.arm_angle(k))
        free, _ = h.spring(k, np.zeros(1))
        spring = float(p["suspension.preload"]) + table["stiffness"] * (free - length)
        return spring, table["damping"] * lever * h.arm_rate(k)
    table, (way, rate) = h.vehicle["tensioner"], h.idler_travel(k)
    return float(p["tensioner.preload"]) + table["stiffness"] * way, table["damping"] * rate


def spring_forces(view: View, names: Sequence[str]) -> Floats:
    return np.stack([sum(leaf_forces(view, leaf(view, name))) for name in names], axis=1)


def inertia_forces(view: View, names: Sequence[str]) -> Floats:
    """Force that the leaf's own motion needs in addition to its wheel's wrench and its weight."""
    return np.stack([_inertia_force(view, leaf(view, name)) for name in names], axis=1)


def _inertia_force(view: View, k: int) -> Floats:
    """On the spring of a leaf; of a beam all springs but this one have their share already."""
    h, part = view.hull, view.part
    if not h.is_road(k):  # rearward, along the slide
        aw = np.diff(h.output_motion(h.names[k])[1], axis=0) / part.h[:, None]
        force = next(f for name, f, _ in h.wrenches if name == h.names[k])
        rear = mean(h.output_attitude.apply(-h.slide))
        return at_instants(((h.vehicle["idler"]["mass"] * (aw - weight(view)) - force) * rear).sum(1))
    about = sum(_about_pivot(view, leaf) for leaf in h.beam(k))
    levers = {leaf: h.spring(leaf, h.arm_angle(leaf))[1] for leaf in h.beam(k)}
    about += sum(mean(sum(leaf_forces(view, leaf)) * lever) for leaf, lever in levers.items() if leaf != k)
    return at_instants(-about / mean(levers[k]))


def _about_pivot(view: View, k: int) -> Floats:
    """Moment about its pivot that the motion of an arm needs in addition to its wheel's wrench and weights, N m."""
    h, part = view.hull, view.part
    x, u, w = h.output_motion("chassis")
    xw, uw, _ = h.output_motion(h.names[k])
    force = next(f for name, f, _ in h.wrenches if name == h.names[k])
    aw = np.diff(uw, axis=0) / part.h[:, None]
    table, wheel = h.arm(k), h.wheel(k)
    arm, y = h.output_attitude.apply(h.pins[k]), h.output_attitude.apply(Y)
    pin, pin_rate = x + arm, u + np.cross(w, arm)
    am = np.diff(0.5 * (pin_rate + uw), axis=0) / part.h[:, None]
    reach = mean(xw - pin)
    spin = (w * y).sum(1) + h.arm_rate(k)
    moment = np.cross(reach, wheel["mass"] * (aw - weight(view)) - force)
    moment += np.cross(0.5 * reach, table["mass"] * (am - weight(view)))
    return (moment * mean(y)).sum(1) + table["pin_inertia"] * np.diff(spin) / part.h


# --- energies --------------------------------------------------------------------------------------


def kinetic(view: View, names: Sequence[str]) -> Floats:
    h = view.hull
    energy = sum(0.5 * body.mass * (body.velocity**2).sum(1) + body.energy for body in h.bodies())
    return h.copies * energy[:, None]


def gravity(view: View, names: Sequence[str]) -> Floats:
    h = view.hull
    rise = sum(body.mass * (body.place[:, 2] - body.place[0, 2]) for body in h.bodies())
    return h.copies * h.vehicle["gravity"] * rise[:, None]


def spring_table(view: View, k: int) -> dict[str, float]:
    return view.hull.vehicle["suspension" if view.hull.is_road(k) else "tensioner"]


def springs(view: View, names: Sequence[str]) -> Floats:
    h = view.hull
    stored = (0.5 * leaf_forces(view, k)[0] ** 2 / spring_table(view, k)["stiffness"] for k in h.shown_leaves)
    return h.copies * sum(stored)[:, None]


def dissipated(view: View, names: Sequence[str]) -> Floats:
    """Energy lost in dampers and, where there is one, on the ground, J."""
    h = view.hull
    power = h.copies * sum(leaf_forces(view, k)[1] ** 2 / spring_table(view, k)["damping"] for k in h.shown_leaves)
    if on_ground(view):
        t, push, _ = ground_contacts(h)
        np.add.at(power, t, push.friction_loss + push.damping_loss)
    return running_sum(0.0, view.part.h * mean(power))[:, None]


def ledger(view: View, names: Sequence[str]) -> Floats:
    """Work that is neither kinetic nor stored, J."""
    part = view.part
    stored = ["kinetic", "gravity", "spring", *(["contact"] if on_ground(view) else [])]
    stored_energy = sum(part[f"energy.{name}"] for name in stored)
    towed = part["energy.towed"] if tows(view) else 0.0
    return (part["port.work"] - towed - (stored_energy - stored_energy[0]))[:, None]


def port_work(view: View, names: Sequence[str]) -> Floats:
    """Work of the wrenches along the ways of their places, J."""
    h, part = view.hull, view.part
    gains = sum(
        (f * np.diff(part.vector(f"{name}.position"), axis=0)).sum(1)
        + part.h * (t * mean(part.vector(f"{name}.angular_velocity"))).sum(1)
        for name, f, t in h.wrenches
    )
    return h.copies * running_sum(0.0, gains)[:, None]


# --- ground ----------------------------------------------------------------------------------------


def on_ground(view: View) -> bool:
    return "ground" in view.part.config["chassis"]


def ground_force(view: View, names: Sequence[str]) -> Floats:
    t, push, _ = ground_contacts(view.hull)
    force = np.zeros((len(view.part.t), 3))
    np.add.at(force, t, push.force)
    return force[:, ["xyz".index(name[-1]) for name in names]]


def ground_energy(view: View, names: Sequence[str]) -> Floats:
    t, push, _ = ground_contacts(view.hull)
    energy = np.zeros(len(view.part.t))
    np.add.at(energy, t, push.stored)
    return energy[:, None]


# --- hitch and seats -------------------------------------------------------------------------------


def tows(view: View) -> bool:
    return bool(view.part.config["chassis"].get("hitch"))


def accelerations(view: View, names: Sequence[str]) -> Floats:
    """Change of the velocity over each step, over its length; 0 at the start."""
    columns = []
    for name in names:
        seat, _, axis = name.rsplit(".", 2)
        gain = np.diff(view.part[f"{seat}.velocity.{axis}"]) / view.part.h
        columns.append(np.concatenate([[0.0], gain]))
    return np.stack(columns, axis=1)


def hitch_speed(view: View, names: Sequence[str]) -> Floats:
    return (view.hull.motion_of("hitch").velocity * view.hull.attitude.apply([1.0, 0.0, 0.0])).sum(1)[:, None]


def load_at(view: View, t: Floats, speed: Floats) -> Floats:
    """Load at times and speeds of the hitch, from its parameters, N."""
    p = view.part.parameters
    start, end = (float(p[f"hitch.load.ramp.{key}"]) for key in ("start", "end"))
    points = np.array([pair.split() for pair in p["hitch.load.points"].split(";")], dtype=float)
    share = 0.5 - 0.5 * np.cos(np.pi * np.clip((t - start) / (end - start), 0.0, 1.0))
    return share * (float(p["hitch.load.force"]) + np.interp(speed, *points.T))


def pull(view: View, names: Sequence[str]) -> Floats:
    return load_at(view, view.part.t, view.part["hitch.speed"])[:, None]


def towed(view: View, names: Sequence[str]) -> Floats:
    """Work of the load, which pulls rearward and level, and of the input force, along the way of the hitch, J."""
    part = view.part
    ahead = view.hull.attitude.apply([1.0, 0.0, 0.0]) * [1.0, 1.0, 0.0]
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    way = np.diff(part.vector("hitch.position"), axis=0)
    force = mean(part["hitch.pull"])[:, None] * mean(ahead) - part.input_vectors("hitch.force")
    return running_sum(0.0, (force * way).sum(1))[:, None]


# --- counters --------------------------------------------------------------------------------------


def steps(view: View, names: Sequence[str]) -> Floats:
    counts = np.ceil(view.part.h / float(view.part.parameters["step"]) - 1e-9)
    return running_sum(0.0, counts)[:, None]


def evaluations(view: View, names: Sequence[str]) -> Floats:
    """Four evaluations per step."""
    return 4.0 * steps(view, names)


def both_sides_in_air(view: View) -> bool:
    """Whether both sides have outputs and only wrenches act."""
    return len(view.hull.sides) == 2 and not on_ground(view)


def off_ground(view: View) -> bool:
    return not on_ground(view)


SPRING = r"(left|right)\.(suspension\[\d+\]|tensioner)\.force"

CHECKS = (
    Check(PLACE + r"\.position\.[xyz]", "geometry", motion, 1e-12),
    Check(PLACE + r"\.orientation\.[wxyz]", "geometry", motion, 1e-12, 1e-12),
    Check(PLACE + r"\.(angular_)?velocity\.[xyz]", "differences of places", motion, 1e-6, 1e-7),
    Check(r"chassis\.position\.[xyz]", "velocities, summed", integrated_position, 0.0, 1e-4, balance=True),
    Check(r"chassis\.velocity\.[xyz]", "impulses", velocity, 1e-2, 1e-5, balance=True, applies=both_sides_in_air),
    Check(r"chassis\.angular_velocity\.[xyz]", "moments", angular_velocity, 1e-2, 1e-5, balance=True,
          applies=both_sides_in_air),
    Check("pitch|roll|yaw", "attitude", angles, 1e-12, 1e-12),
    Check(r"body_rate\.[xyz]", "differences of attitudes", body_rates, 1e-6, 1e-7),
    Check("speed|distance|settlement", "motion", progress, 1e-9, 1e-12),
    Check(r"(left|right)\.road_arm\[\d+\]\.angle", "places shown", arm_angles, 1e-9, 1e-9, balance=True),
    Check(r"(left|right)\.suspension\[\d+\]\.length", "places shown", lengths, 1e-9, 1e-9, balance=True),
    Check(SPRING, "lengths and their rates", spring_forces, 1e-6, 1e-3, balance=True),
    Check(SPRING, "motion of what it pushes", inertia_forces, 0.03, 20.0, balance=True, applies=off_ground),
    Check(r"energy\.kinetic", "bodies", kinetic, 1e-9, 1e-9, balance=True),
    Check(r"energy\.gravity", "heights", gravity, 1e-9, 1e-6, balance=True),
    Check(r"energy\.spring", "lengths", springs, 1e-9, 1e-6, balance=True),
    Check(r"energy\.dissipated", "dampers and friction", dissipated, 0.02, 0.1, balance=True),
    Check(r"energy\.dissipated", "ledger", ledger, 0.01, 0.1, balance=True),
    Check(r"energy\.contact", "penetrations", ground_energy, 1e-6, 1e-6),
    Check(r"port\.work", "wrenches on their ways", port_work, 1e-4, 1e-3, balance=True),
    Check(r"seat\.\w+\.acceleration\.[xyz]", "velocities", accelerations, 1e-9, 1e-9, balance=True),
    Check(r"hitch\.speed", "motion", hitch_speed, 1e-6, 1e-7),
    Check(r"hitch\.pull", "speed and ramp", pull, 1e-9, 1e-6, balance=True),
    Check(r"energy\.towed", "forces on the way", towed, 1e-3, 0.1, balance=True),
    Check(r"ground\.force\.[xyz]", "contact laws", ground_force, 1e-6, 1e-3),
    Check(r"solver\.steps", "steps of the given length", steps, 0.0),
    Check(r"solver\.evaluations", "four a step", evaluations, 0.0),
)  # fmt: skip
