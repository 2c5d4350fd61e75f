"""Vehicle without tracks as a star-shaped tree: a free body, and leaves with one coordinate each.

A leaf is a road arm with its wheel (turns about a pin), an idler or further wheel on a slide along the chassis, or a
wheel on a fixed axle (a slide without travel, whose coordinate stays 0); its wheel has a separate spin. The arms of a
bogie share one coordinate. Leaves are ordered side by side, left first: road wheels, idler, further wheels, rollers.
Frame B is the chassis' own, axes x forward, y left, z up in the drawn position, origin O in the chassis'
centre of mass. Pins lie along B's y axis and slides across it, so a leaf moves in a plane y = const of B.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fmus.kernels.jit import by_reference, kernel, plain
from fmus.physics.arrays import Floats, Integers, Matrix, Vector
from fmus.physics.elementary import cos, hypot, sin
from fmus.vehicles.sides import SIDES, beams, of_side, of_wheels, places_of_wheels, road_arms, smooth_wheels

BODY, WHOLE = range(2)  # indices into ``VehicleTree.masses``


class LinearSprings(NamedTuple):
    """Suspension of linear spring-dampers alone, whose numbers are those of the tree."""

    wheels: int  # of a side


class VehicleTree(NamedTuple):
    """Numbers of a vehicle without its tracks, SI, frame B; n leaves, n + 2 units on which wrenches act."""

    gravity: Floats  # (1,) m/s2, downward
    masses: Floats  # (2,) BODY: chassis with both sprockets, WHOLE: with all leaves, kg
    centre: Floats  # (3,) centre of mass of chassis with sprockets, m
    inertia: Floats  # (3, 3) of chassis with sprockets about that centre, without the sprockets' spin, kg m2
    is_arm: Integers  # (n,) 1 for a road arm, 0 for the others
    joined: Integers  # (n,) 1 for a further arm of a bogie, which has the coordinate of the leaf before it
    hinge: Floats  # (n, 3) pin of the arm, or drawn wheel centre of the others, m
    # (n, 2) x and z of the wheel centre from the pin in the drawn position, m; of the others the direction of the slide
    arm: Floats
    fraction: Floats  # (n,) centre of mass of arm and wheel on the line from pin to wheel centre; 1 for the others
    leaf_mass: Floats  # (n,) arm and wheel, kg
    # Inertia of a leaf about its centre of mass: J w = across w - along (r.w) r + transverse (w_x, 0, w_z), r
    # from the pin to the wheel centre; without the wheel's spin.
    across: Floats  # (n,) kg m2
    along: Floats  # (n,) kg
    transverse: Floats  # (n,) wheel's transverse inertia, kg m2
    spin_inertia: Floats  # (n,) kg m2
    # (n, 2) x and z of the spring's end on the arm, from the pin, drawn position, m; of a wheel on a slide 1 behind the
    # sprocket and -1 ahead of it, then 0: the sense in which its way compresses its spring; 0 on a fixed axle
    on_arm: Floats
    on_chassis: Floats  # (n, 2) x and z of the spring's end on the chassis, from the pin, m
    drawn_length: Floats  # (n,) of the spring-damper in the drawn position, m; 0 without one
    stiffness: Floats  # (n,) N/m
    damping: Floats  # (n,) N s/m
    preload: Floats  # (n,) push of the spring in the drawn position, N
    travel: Floats  # (n,) largest motion of a wheel on a slide, m; 0 on a fixed axle
    sprocket: Floats  # (2, 3) centres of the sprocket mounts, left and right, m
    input_index: Integers  # (n + 2,) index of the wrench input that acts on a unit: leaves, left mount, right mount
    suspension: Any  # LinearSprings, or ``suspension.elements.Elements``
    mirror: Floats  # (n + 2,) 1, or -1 where the input is that of the other side, mirrored in the plane y = 0 of B
    # Work arrays of the equations of motion (``dynamics.rates``).
    rotation: Floats  # (3, 3) B to world
    root_mass: Floats  # (6, 6) of the root with the leaves
    root_force: Floats  # (6,) on the root, then its accelerations
    tensor: Floats  # (3, 3) inertia of a leaf
    coupling: Floats  # (n, 6) rows that couple leaves to the root, divided by the leaves' masses
    leaf_force: Floats  # (n,) on a leaf over its mass


def tree(vehicle: Mapping[str, Any], sides: int) -> VehicleTree:
    """Tree of a vehicle table; with ``sides`` = 1 the right side gets the left side's wrenches, mirrored."""
    body, sprocket, lateral = vehicle["chassis"], vehicle["sprocket"], vehicle["track"]["lateral"]
    tables = [of_side(vehicle, side) for side in SIDES]
    left, right = (_leaves(table) for table in tables)
    each: dict[str, Any] = {key: np.concatenate([left[key], right[key]]) for key in left}
    origin = np.array(body["centre"])
    each["hinge"] = np.concatenate([left["hinge"], right["hinge"] * [1, -1, 1]]) - origin
    mounts = np.array([[0.0, lateral, 0.0], [0.0, -lateral, 0.0]]) - origin
    wheels, count = len(vehicle["road_wheel"]["x"]), len(left["is_arm"])

    centre, inertia = np.zeros(3), np.zeros((3, 3))
    masses = body["mass"], body["inertia"], sprocket["mass"], sprocket["transverse_inertia"]
    mass = plain(with_sprockets)(*masses, mounts, centre, inertia)
    suspension: Any = LinearSprings(wheels)
    if has_elements(tables):
        from fmus.chassis.suspension.elements import elements

        suspension = elements(tables, count - wheels - 1, -np.sign(each["arm"][:, 0]))
    input_index, mirror = _inputs(count, sides)
    whole = VehicleTree(
        gravity=np.array([float(vehicle["gravity"])]),
        masses=np.array([mass, plain(with_leaves)(mass, each["leaf_mass"])]),
        centre=centre,
        inertia=inertia,
        **each,
        sprocket=mounts,
        suspension=suspension,
        input_index=input_index,
        mirror=mirror,
        rotation=np.eye(3),
        root_mass=np.zeros((6, 6)),
        root_force=np.zeros(6),
        tensor=np.zeros((3, 3)),
        coupling=np.zeros((2 * count, 6)),
        leaf_force=np.zeros(2 * count),
    )
    return by_reference(whole)


def has_elements(sides: Sequence[Mapping[str, Any]]) -> bool:
    """Whether the tables of sides have more than linear spring-dampers."""
    tables = [(table["suspension"], *(wheel["tensioner"] for wheel in smooth_wheels(table))) for table in sides]
    return any(isinstance(part, Mapping) for each in tables for table in each for part in (table or {}).values())


def _leaves(table: Mapping[str, Any]) -> dict[str, Any]:
    """Arrays of the leaves of a side from its vehicle table, but hinges in the vehicle frame, at the left."""
    every, lateral, wheels = smooth_wheels(table), table["track"]["lateral"], len(table["road_wheel"]["x"])
    others = every[wheels:]  # without a tensioner on fixed axles
    mass = np.array([wheel["mass"] for wheel in every])
    arms = road_arms(table) or [{"mass": 0.0, "pin_inertia": 0.0, "long_inertia": 0.0, "pivot": (0.0, 0.0)}] * wheels
    arm = {key: np.array([each[key] for each in arms]) for key in arms[0]}
    spring, pivot = table["suspension"] or {}, arm["pivot"]  # from the wheel centre, as all points
    has_line = spring.get("on_arm") is not None
    on_arm, on_chassis = (
        (np.array(places_of_wheels(spring[key], wheels)) if has_line else pivot) - pivot
        for key in ("on_arm", "on_chassis")
    )

    def leaves(road: Any, other: Any = 0.0) -> Floats:
        """Array over the leaves from that of the road wheels and that of the others, or one value for these."""
        return np.array([*road, *np.broadcast_to(other, (len(others), *np.shape(road)[1:]))], dtype=float)

    leaf_mass = mass[:wheels] + arm["mass"]
    # arm and wheel: point masses at a distance of half an arm, on the line of the arm
    reduced = 0.25 * mass[:wheels] * arm["mass"] / leaf_mass
    length_squared = (pivot * pivot).sum(axis=1)
    slender = arm["pin_inertia"] - arm["long_inertia"]  # a wheel at the pivot of its beam has an arm without direction
    along = np.divide(slender, length_squared, out=np.zeros(wheels), where=length_squared > 0.0) + reduced
    places = np.array([(wheel["x"], lateral, wheel["z"]) for wheel in every])
    further = {k for beam in beams(table["road_arm"] or {}, wheels) for k in beam[1:]}
    slides = [wheel["tensioner"] or {} for wheel in others]
    sense = [(-1.0 if wheel["x"] > 0.0 else 1.0) if wheel["tensioner"] else 0.0 for wheel in others]
    return {
        "is_arm": leaves([1 if table["road_arm"] else 0] * wheels).astype(np.int64),
        "joined": leaves([k in further for k in range(1, wheels + 1)]).astype(np.int64),
        "hinge": places + np.insert(leaves(pivot), 1, 0.0, axis=1),
        "arm": leaves(-pivot, [way(wheel) for wheel in others]),
        "fraction": leaves((mass[:wheels] + 0.5 * arm["mass"]) / leaf_mass, 1.0),
        "leaf_mass": leaves(leaf_mass, mass[wheels:]),
        "across": leaves(arm["pin_inertia"] + reduced * length_squared),
        "along": leaves(along),
        "transverse": np.array([wheel["transverse_inertia"] for wheel in every]),
        "spin_inertia": np.array([wheel["spin_inertia"] for wheel in every]),
        "on_arm": leaves(on_arm, [(towards, 0.0) for towards in sense]),
        "on_chassis": leaves(on_chassis),
        "drawn_length": leaves([hypot(*line) for line in (on_chassis - on_arm).tolist()]),
        **{
            key: leaves(of_wheels(spring.get(key) or 0.0, wheels), [slide.get(key, 0.0) for slide in slides])
            for key in ("stiffness", "damping", "preload")
        },
        "travel": leaves([0.0] * wheels, [wheel["radius"] if wheel["tensioner"] else 0.0 for wheel in others]),
    }


def way(wheel: Mapping[str, Any]) -> tuple[float, float]:
    """Direction x, z of the slide of a wheel of ``smooth_wheels``; forward without one."""
    angle = (wheel["tensioner"] or {}).get("angle", 0.0)
    return cos(angle), sin(angle)


def _inputs(leaves: int, sides: int) -> tuple[Integers, Floats]:
    """Fields ``input_index`` and ``mirror`` of a tree with so many ``leaves`` a side and wrenches of so many sides."""
    per_unit = np.arange(2 * leaves)
    sources = np.concatenate([per_unit + per_unit // leaves, [leaves, 2 * leaves + 1]])  # leaves, then the mount
    mirrored = np.concatenate([per_unit >= leaves, [False, True]]) & (sides == 1)
    return np.where(mirrored, sources - leaves - 1, sources), np.where(mirrored, -1.0, 1.0)


def fastest_rate(tree: VehicleTree) -> float:
    """Bound of the rates of the springs and dampers on their leaves with the hull at rest, 1/s."""
    fastest = 0.0
    for k in range(len(tree.is_arm)):
        mass, slope_squared = float(tree.leaf_mass[k]), 1.0
        if tree.is_arm[k]:
            (x, z), end = tree.arm[k], tree.on_arm[k]
            mass = mass * tree.fraction[k] ** 2 * (x * x + z * z) + tree.across[k]
            slope_squared = float((end * end).sum())  # a spring across the line to its end has the largest lever
        stiffness, damping = (float(slope_squared * each[k] / mass) for each in (tree.stiffness, tree.damping))
        if tree.is_arm[k] and not isinstance(tree.suspension, LinearSprings):
            from fmus.chassis.suspension.elements import slopes

            further = slopes(tree.suspension, tree, k, slope_squared)
            stiffness, damping = stiffness + further[0] / mass, damping + further[1] / mass
        fastest = max(fastest, damping, float(np.sqrt(stiffness)))
    return fastest


@kernel
def with_sprockets(
    mass: float,
    moments: Vector,
    sprocket_mass: float,
    transverse_inertia: float,
    mounts: Floats,
    centre: Floats,
    inertia: Matrix,
) -> float:
    """Mass, kg, of the chassis with sprockets on the mounts (2, 3), m.

    ``moments``: principal moments of inertia of the chassis alone, kg m2. Writes the centre of mass (3), m, and the
    inertia about it (3, 3), kg m2, without the sprockets' spin.
    """
    whole = mass + 2 * sprocket_mass
    for i in range(3):
        centre[i] = sprocket_mass * (mounts[0, i] + mounts[1, i]) / whole
        for j in range(3):
            inertia[i, j] = moments[i] if i == j else 0.0
    for body in range(3):  # parallel axes: chassis, left, right sprocket
        m = mass if body == 0 else sprocket_mass
        side, at = max(body - 1, 0), 1.0 if body > 0 else 0.0
        r = at * mounts[side, 0] - centre[0], at * mounts[side, 1] - centre[1], at * mounts[side, 2] - centre[2]
        square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
        for i in range(3):
            for j in range(3):
                inertia[i, j] += m * ((square if i == j else 0.0) - r[i] * r[j])
    inertia[0, 0] += 2.0 * transverse_inertia
    inertia[2, 2] += 2.0 * transverse_inertia
    return whole


@kernel
def with_leaves(mass: float, leaf_mass: Floats) -> float:
    """Mass of the vehicle, kg, from that of the chassis with sprockets and those of the leaves (n).

    Neighbours of one mass count by a product, and both sides are alike.
    """
    side, first, count = 0.0, 0, leaf_mass.size // 2
    for k in range(1, count + 1):
        if k == count or leaf_mass[k] != leaf_mass[first]:
            side += (k - first) * leaf_mass[first]
            first = k
    return mass + 2 * side
