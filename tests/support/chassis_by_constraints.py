"""Accelerations of a chassis from constraint equations: an independent computation for ``fmus.chassis``.

The chassis, its arms, wheels, idlers and sprockets are free rigid bodies in the world frame with full inertia tensors
and Euler's equations; pins and slides are constraint equations. One dense solve gives the accelerations a and the
constraint forces, with inertia M, constraint rows G, forces f and the remaining accelerations gamma:

    [M  G^T] [    a   ]   [  f  ]
    [G   0 ] [-lambda ] = [gamma]

Of the component it knows the layout of the state alone: ``ROOT`` and the order of the leaves (arms, idler and
return rollers by side).
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from fmus.chassis.leaf import ROOT

SPRING = ("stiffness", "damping", "preload", "on_arm", "on_chassis")
CHASSIS = 0  # number of the chassis among the bodies


class Frame(NamedTuple):
    """Motion of the chassis in the world frame."""

    centre: np.ndarray  # centre of mass, m
    axes: np.ndarray  # columns
    velocity: np.ndarray  # m/s
    omega: np.ndarray  # rad/s

    def velocity_at(self, r):
        """Velocity of the point of the chassis at ``r`` from its centre of mass, m/s."""
        return self.velocity + np.cross(self.omega, r)


class Leaf(NamedTuple):
    """State of an arm or idler and of its wheel, relative to the chassis."""

    position: float  # angle of an arm, rad, or displacement of an idler, m
    rate: float
    spin: float  # rad/s


class Bodies:
    """Free rigid bodies: inertia, motion, and the loads on them, in the world frame."""

    def __init__(self, gravity):
        self.gravity = gravity
        self.mass, self.inertia, self.place, self.velocity, self.omega = [], [], [], [], []
        self.force, self.torque = [], []

    def add(self, mass, inertia, axes, place, velocity, omega):
        """Add a body with principal moments of inertia along the columns of ``axes``; return its number."""
        self.mass.append(mass)
        self.inertia.append(axes @ np.diag(inertia) @ axes.T)
        self.place.append(place)
        self.velocity.append(velocity)
        self.omega.append(omega)
        self.force.append(np.array([0, 0, -mass * self.gravity]))
        self.torque.append(np.zeros(3))
        return len(self.mass) - 1

    def load(self, i, point, force, torque=0.0):
        """Apply a force at a point, N, and a torque, N m, to body i."""
        self.force[i] += force
        self.torque[i] += np.cross(point - self.place[i], force) + torque


class Constraints:
    """Equations on the accelerations of bodies: the sum over bodies of a row (6) times (v', omega') is gamma."""

    def __init__(self, bodies):
        self.bodies, self.rows, self.gammas = bodies, [], []

    def add(self, row, gamma):
        """Add an equation; ``row`` has the factors by body."""
        self.rows.append(row)
        self.gammas.append(gamma)

    def same_point(self, i, j, point):
        """Bodies i and j share a point."""
        place, omega = self.bodies.place, self.bodies.omega
        ri, rj = point - place[i], point - place[j]
        gi = np.cross(omega[i], np.cross(omega[i], ri))
        gj = np.cross(omega[j], np.cross(omega[j], rj))
        for e in np.eye(3):
            row = {i: np.concatenate([e, np.cross(ri, e)]), j: -np.concatenate([e, np.cross(rj, e)])}
            self.add(row, -e @ (gi - gj))

    def same_rotation(self, i, j, directions):
        """Bodies i and j have no relative rotation about directions that are fixed in body i."""
        omega = self.bodies.omega
        for e in directions:
            gamma = -(np.cross(omega[i], e) @ (omega[j] - omega[i]))
            self.add({j: np.concatenate([np.zeros(3), e]), i: -np.concatenate([np.zeros(3), e])}, gamma)

    def same_distance(self, i, j, r, directions):
        """Body j, at r from body i, has constant coordinates e.r along directions e that are fixed in body i."""
        w, v = self.bodies.omega[i], self.bodies.velocity[j] - self.bodies.velocity[i]
        for e in directions:
            gamma = -(2 * np.cross(w, e) @ v + np.cross(w, np.cross(w, e)) @ r)
            self.add({j: np.concatenate([e, np.zeros(3)]), i: np.concatenate([-e, np.cross(e, r)])}, gamma)


class Assembly(NamedTuple):
    """Bodies of a vehicle without chains, with their constraints."""

    table: dict  # vehicle's table
    frame: Frame
    bodies: Bodies
    constraints: Constraints
    units: list[int]  # bodies that the inputs' wrenches load, in the order of the inputs
    leaves: list[tuple[int, int | None]]  # wheel and its arm; the others have no arm

    def from_centre(self, point):
        """Vector from the centre of mass to a point of the drawing, in the chassis frame, m."""
        return np.array(point) - np.array(self.table["chassis"]["centre"])

    def wheel_omega(self, spin):
        """Angular velocity of a wheel that spins about the lateral axis, rad/s."""
        w, a_y = self.frame.omega, self.frame.axes[:, 1]
        return w - (w @ a_y) * a_y + spin * a_y


class Arm(NamedTuple):
    """Motion of a road arm in the world frame."""

    pin: np.ndarray
    axes: np.ndarray
    velocity: np.ndarray  # of the pin
    omega: np.ndarray
    to_wheel: np.ndarray  # from the pin as drawn, m


def of_wheel(table, key, k):
    """Number or place of wheel k of a side, from that of all or from a list."""
    value = table[key]
    is_list = isinstance(value, tuple) and (len(value) != 2 or isinstance(value[0], tuple))
    return value[k] if is_list else value


def arm_motion(assembly, wheel_x, lateral, leaf, k):
    """Motion of the arm of wheel k, which is drawn at ``wheel_x`` and ``lateral``."""
    frame, table = assembly.frame, assembly.table
    px, pz = of_wheel(table["road_arm"], "pivot", k)
    pivot = assembly.from_centre([wheel_x + px, lateral, table["road_wheel"]["z"] + pz])
    pin = frame.centre + frame.axes @ pivot
    return Arm(
        pin=pin,
        axes=frame.axes @ Rotation.from_rotvec([0, leaf.position, 0]).as_matrix(),
        velocity=frame.velocity_at(pin - frame.centre),
        omega=frame.omega + leaf.rate * frame.axes[:, 1],
        to_wheel=np.array([-px, 0, -pz]),
    )


def add_arm(assembly, arm, k):
    """Add the arm of wheel k on its pin; return its number."""
    table, A = assembly.table["road_arm"], assembly.frame.axes
    data = {key: of_wheel(table, key, k) for key in ("mass", "pin_inertia", "long_inertia")}
    long = arm.to_wheel / np.linalg.norm(arm.to_wheel)
    axes = arm.axes @ np.column_stack([long, [0, 1, 0], np.cross(long, [0, 1, 0])])
    inertia = (data["long_inertia"], data["pin_inertia"], data["pin_inertia"])
    r = arm.axes @ (0.5 * arm.to_wheel)
    body = assembly.bodies.add(
        data["mass"], inertia, axes, arm.pin + r, arm.velocity + np.cross(arm.omega, r), arm.omega
    )
    assembly.constraints.same_point(CHASSIS, body, arm.pin)
    assembly.constraints.same_rotation(CHASSIS, body, [A[:, 0], A[:, 2]])
    return body


def add_road_wheel(assembly, arm, on, spin):
    """Add a road wheel on the end of its arm, which is the body ``on``."""
    wheel, r, R = assembly.table["road_wheel"], arm.axes @ arm.to_wheel, arm.axes
    inertia = (wheel["transverse_inertia"], wheel["spin_inertia"], wheel["transverse_inertia"])
    velocity = arm.velocity + np.cross(arm.omega, r)
    omega = assembly.wheel_omega(spin)
    body = assembly.bodies.add(wheel["mass"], inertia, assembly.frame.axes, arm.pin + r, velocity, omega)
    assembly.constraints.same_point(on, body, arm.pin + r)
    assembly.constraints.same_rotation(on, body, [R[:, 0], R[:, 2]])
    assembly.units.append(body)
    assembly.leaves.append((body, on))


def add_suspension(assembly, arm, on, table, k):
    """Load the arm of wheel k, which is the body ``on``, and the chassis with the force of a spring and damper."""
    frame, spring = assembly.frame, {key: of_wheel(table, key, k) for key in table}
    low = arm.pin + arm.axes @ (arm.to_wheel + np.array([spring["on_arm"][0], 0, spring["on_arm"][1]]))
    high = arm.pin + frame.axes @ (arm.to_wheel + np.array([spring["on_chassis"][0], 0, spring["on_chassis"][1]]))
    drawn = np.hypot(*(np.array(spring["on_arm"]) - spring["on_chassis"]))
    length = np.linalg.norm(high - low)
    e = (high - low) / length
    growth = e @ (frame.velocity_at(high - frame.centre) - arm.velocity - np.cross(arm.omega, low - arm.pin))
    push = spring["preload"] + spring["stiffness"] * (drawn - length) - spring["damping"] * growth
    assembly.bodies.load(on, low, -push * e)
    assembly.bodies.load(CHASSIS, high, push * e)


def add_idler(assembly, lateral, leaf):
    """Add an idler on its slide, with the force of its tensioner."""
    frame, idler = assembly.frame, assembly.table["idler"]
    a_x, a_y, a_z = frame.axes.T
    tensioner, turn = assembly.table["tensioner"], Rotation.from_rotvec([0, -assembly.table["tensioner"]["angle"], 0])
    slide, across = frame.axes @ turn.as_matrix()[:, 0], frame.axes @ turn.as_matrix()[:, 2]
    r = frame.axes @ assembly.from_centre([idler["x"], lateral, idler["z"]]) + leaf.position * slide
    inertia = (idler["transverse_inertia"], idler["spin_inertia"], idler["transverse_inertia"])
    velocity, omega = frame.velocity_at(r) + leaf.rate * slide, assembly.wheel_omega(leaf.spin)
    body = assembly.bodies.add(idler["mass"], inertia, frame.axes, frame.centre + r, velocity, omega)
    assembly.constraints.same_rotation(CHASSIS, body, [a_x, a_z])
    assembly.constraints.same_distance(CHASSIS, body, r, [a_y, across])
    away = np.sign(idler["x"]) * slide  # from the sprocket
    inwards = -np.sign(idler["x"])
    push = tensioner["preload"] + inwards * (tensioner["stiffness"] * leaf.position + tensioner["damping"] * leaf.rate)
    assembly.bodies.load(body, frame.centre + r, push * away)
    assembly.bodies.load(CHASSIS, frame.centre + r, -push * away)
    assembly.units.append(body)
    assembly.leaves.append((body, None))


def add_return_roller(assembly, lateral, roller_x, spin):
    """Add a return roller, whose centre is fixed to the chassis; its wheel spins freely."""
    frame, roller = assembly.frame, assembly.table["return_roller"]
    a_x, _, a_z = frame.axes.T
    r = frame.axes @ assembly.from_centre([roller_x, lateral, roller["z"]])
    inertia = (roller["transverse_inertia"], roller["spin_inertia"], roller["transverse_inertia"])
    place, omega = frame.centre + r, assembly.wheel_omega(spin)
    body = assembly.bodies.add(roller["mass"], inertia, frame.axes, place, frame.velocity_at(r), omega)
    assembly.constraints.same_point(CHASSIS, body, place)
    assembly.constraints.same_rotation(CHASSIS, body, [a_x, a_z])
    assembly.units.append(body)
    assembly.leaves.append((body, None))


def add_sprocket(assembly, lateral):
    """Add a sprocket without spin, fixed to the chassis."""
    frame, sprocket = assembly.frame, assembly.table["sprocket"]
    r = frame.axes @ assembly.from_centre([0, lateral, 0])
    inertia = (sprocket["transverse_inertia"], 0.0, sprocket["transverse_inertia"])
    place = frame.centre + r
    body = assembly.bodies.add(sprocket["mass"], inertia, frame.axes, place, frame.velocity_at(r), frame.omega)
    assembly.constraints.same_point(CHASSIS, body, place)
    assembly.constraints.same_rotation(CHASSIS, body, np.eye(3))
    assembly.units.append(body)


def add_side(assembly, lateral, leaves, suspension):
    """Add road wheels on their arms, idler, return rollers and sprocket of one side."""
    count = len(assembly.table["road_wheel"]["x"])
    of_arms, of_idler, of_rollers = leaves[:count], leaves[count], leaves[count + 1 :]
    before, arms = None, assembly.table["road_arm"]
    beams = [(k, k + 1) for k in range(1, count, 2)] if arms["pairs"] else arms["beams"] or ()
    further = {k - 1 for beam in beams for k in beam[1:]}
    for k, (wheel_x, leaf) in enumerate(zip(assembly.table["road_wheel"]["x"], of_arms, strict=True)):
        arm = arm_motion(assembly, wheel_x, lateral, leaf, k)
        on = add_arm(assembly, arm, k)
        add_road_wheel(assembly, arm, on, leaf.spin)
        if suspension:
            add_suspension(assembly, arm, on, suspension, k)
        if k in further:  # one piece with the arm before
            row = np.concatenate([np.zeros(3), assembly.frame.axes[:, 1]])
            assembly.constraints.add({on: row, before: -row}, 0.0)
        before = on
    add_idler(assembly, lateral, of_idler)
    for roller_x, leaf in zip((assembly.table["return_roller"] or {"x": ()})["x"], of_rollers, strict=True):
        add_return_roller(assembly, lateral, roller_x, leaf.spin)
    add_sprocket(assembly, lateral)


def assemble(table, x):
    """Assemble all bodies and constraints of both sides in the state x, without the wrenches of the inputs."""
    A = Rotation.from_quat(x[3:7], scalar_first=True).as_matrix()
    frame, bodies = Frame(x[:3], A, x[7:10], A @ x[10:13]), Bodies(table["gravity"])
    assembly = Assembly(table, frame, bodies, Constraints(bodies), [], [])
    bodies.add(table["chassis"]["mass"], table["chassis"]["inertia"], A, frame.centre, frame.velocity, frame.omega)
    half = len(table["road_wheel"]["x"]) + 1 + len((table["return_roller"] or {"x": ()})["x"])
    n = 2 * half
    leaves = [Leaf(*x[[ROOT + k, ROOT + 2 * n + k, ROOT + 3 * n + k]]) for k in range(n)]
    left = table["suspension"] and {key: table["suspension"][key] for key in SPRING}
    right = (table["right"] or {}).get("suspension") or {}
    add_side(assembly, table["track"]["lateral"], leaves[:half], left)
    add_side(assembly, -table["track"]["lateral"], leaves[half:], left and {**left, **right})
    return assembly


def solve(bodies, constraints):
    """Accelerations (bodies, 6): of the centres of mass, m/s2, and angular, rad/s2."""
    size, m = 6 * len(bodies.mass), len(constraints.rows)
    K, f = np.zeros((size + m, size + m)), np.zeros(size + m)
    for b, (inertia, omega) in enumerate(zip(bodies.inertia, bodies.omega, strict=True)):
        K[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = bodies.mass[b] * np.eye(3)
        K[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = inertia
        f[6 * b : 6 * b + 3] = bodies.force[b]
        f[6 * b + 3 : 6 * b + 6] = bodies.torque[b] - np.cross(omega, inertia @ omega)
    for i, (row, gamma) in enumerate(zip(constraints.rows, constraints.gammas, strict=True)):
        for b, factors in row.items():
            K[size + i, 6 * b : 6 * b + 6] = factors
            K[6 * b : 6 * b + 6, size + i] = factors
        f[size + i] = gamma
    return np.linalg.solve(K, f)[:size].reshape(-1, 6)


def along_slide(assembly, acceleration, idler, rate):
    """Acceleration of an idler along its slide, m/s2."""
    frame, bodies = assembly.frame, assembly.bodies
    w, angle = frame.omega, assembly.table["tensioner"]["angle"]
    slide = frame.axes @ [np.cos(angle), 0.0, np.sin(angle)]
    r, v = bodies.place[idler] - frame.centre, bodies.velocity[idler] - frame.velocity
    assert np.allclose(v, np.cross(w, r) + rate * slide)
    at_chassis = acceleration[CHASSIS]
    relative = acceleration[idler, :3] - at_chassis[:3] - np.cross(at_chassis[3:], r) - np.cross(w, np.cross(w, r))
    return slide @ (relative - 2 * np.cross(w, rate * slide))


def accelerations_by_constraints(table, x, u):
    """Accelerations in the state x under the wrenches u: what ``rates`` calls dx/dt from index 7 on, without energies.

    Returns the acceleration of the centre of mass, m/s2, the angular acceleration in the chassis frame, rad/s2, and by
    leaf the accelerations of arms (rad/s2) and idlers (m/s2), and those of the wheels' spins, rad/s2.
    """
    assembly = assemble(table, x)
    bodies, frame, n = assembly.bodies, assembly.frame, len(assembly.leaves)
    for unit, wrench in zip(assembly.units, u.reshape(-1, 6), strict=True):
        bodies.load(unit, bodies.place[unit], wrench[:3], wrench[3:])
    acceleration, a_y = solve(bodies, assembly.constraints), frame.axes[:, 1]
    rate_dots, spin_dots = np.zeros(n), np.zeros(n)
    for k, (wheel, arm) in enumerate(assembly.leaves):
        spin_dots[k] = a_y @ acceleration[wheel, 3:]  # perpendicular change of the axis: d(a.w) = a.w'
        if arm is None:
            rate_dots[k] = along_slide(assembly, acceleration, wheel, x[ROOT + 2 * n + k])
        else:
            rate_dots[k] = a_y @ (acceleration[arm, 3:] - acceleration[CHASSIS, 3:])
    return acceleration[CHASSIS, :3], frame.axes.T @ acceleration[CHASSIS, 3:], rate_dots, spin_dots
