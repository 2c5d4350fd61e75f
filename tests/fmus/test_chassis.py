"""The chassis: exact solutions, conserved quantities, an independent formulation, order, ledger, symmetry."""

import copy

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fmus.chassis.dynamics import ROOT, energies, rates
from fmus.chassis.model import Model
from fmus.chassis.tree import tree
from fmus.model import InvalidParameter, StepFailed
from fmus.vehicle import read_table, vehicle

TABLE = vehicle(*read_table("m113")).model_dump()
IDLER = TABLE["idler"]["x"]
G = 9.81
BODY_MASS = 15891.58 - 128 * 18.02
LEAVES = 12  # left arms, left idler, right arms, right idler


def cross2(a, b):
    """The plane cross product."""
    return a[0] * b[1] - a[1] * b[0]


class Probe:
    """A model with its variables by name; inputs that are not set stay 0, as unconnected."""

    def __init__(self, changes=None, sides=("left", "right"), **parameters):
        table = copy.deepcopy(TABLE)
        for key, value in (changes or {}).items():
            *path, last = key.split(".")
            part = table
            for name in path:
                part = part[name]
            part[last] = value
        self.model = Model({"vehicle": table, "chassis": {"sides": list(sides)}})
        real = [port for port in self.model.ports if isinstance(port.start, float) and port.causality != "parameter"]
        self.inputs = [port.name for port in real if port.causality == "input"]
        self.names = [port.name for port in real if port.causality == "output"]
        self.u, self.y, self.t = np.zeros(len(self.inputs)), np.zeros(len(self.names)), 0.0
        self.model.initialise({name.replace("__", "."): value for name, value in parameters.items()})

    def __setitem__(self, name, value):
        self.u[self.inputs.index(name)] = value

    def __getitem__(self, name):
        self.model.outputs(self.y)
        if name in self.names:
            return self.y[self.names.index(name)]
        return np.array([self.y[self.names.index(f"{name}.{axis}")] for axis in "xyz"])

    def run(self, duration, h=1e-3):
        for _ in range(round(duration / h)):
            self.model.step(self.t, h, self.u)
            self.t += h
        return self

    @property
    def energy(self):
        return self["energy.kinetic"] + self["energy.gravity"] + self["energy.spring"]


UNDAMPED = {"suspension.damping": 0.0, "tensioner.damping": 0.0}
FLOATING = {**UNDAMPED, "gravity": 0.0}


def stir(model, scale=1.0, seed=5):
    """A lively state: turned, moving, arms and idlers displaced, wheels spinning."""
    rng, x, n = np.random.default_rng(seed), model.state, LEAVES
    x[:3] = rng.normal(size=3)
    x[3:7] = Rotation.from_rotvec(scale * rng.normal(size=3)).as_quat(scalar_first=True)
    x[7:13] = scale * rng.normal(size=6)
    x[ROOT : ROOT + n] = 0.05 * scale * rng.normal(size=n)
    x[ROOT + 2 * n : ROOT + 3 * n] = scale * rng.normal(size=n)
    x[ROOT + 3 * n : ROOT + 4 * n] = 20 * scale * rng.normal(size=n)
    return x


# --- exact solutions ---


def test_drawn_position_at_the_start_pose():
    probe = Probe(start__heading=0.7, **{"start.position.x": 3.0, "start.position.z": 1.0})
    turn = Rotation.from_rotvec([0, 0, 0.7])
    for name, place in (
        ("left.road_wheel[2]", (-1.322, 1.0795, -0.215)),
        ("right.idler", (IDLER, -1.0795, -0.12)),
        ("right.sprocket", (0.0, -1.0795, 0.0)),
        ("chassis", TABLE["chassis"]["centre"]),
    ):
        assert np.allclose(probe[f"{name}.position"], turn.apply(place) + np.array([3.0, 0.0, 1.0]), rtol=0, atol=1e-14)
    assert probe["yaw"] == pytest.approx(0.7, abs=1e-15)
    assert probe["left.suspension[1].length"] == pytest.approx(np.hypot(0.484, 0.406), abs=1e-15)


def test_free_fall_moves_no_spring():
    probe = Probe().run(0.5)
    assert probe["settlement"] == pytest.approx(0.5 * G * 0.25, rel=1e-13)
    assert probe["chassis.velocity"] == pytest.approx([0, 0, -G * 0.5], rel=1e-13, abs=1e-12)
    assert np.abs(probe.model.state[ROOT : ROOT + LEAVES]).max() < 1e-14
    assert abs(probe.energy) < 1e-9 * probe["energy.kinetic"]
    twin = Probe({"gravity": 1.01 * G}).run(0.5)
    assert twin["settlement"] != pytest.approx(0.5 * G * 0.25, rel=1e-3)


def test_wheel_rate_from_the_geometry():
    """A held force on a wheel: small deflection = F 0.288^2 / (k arm^2), arm 0.2507 m from the pin."""
    arm = abs(cross2([-0.104, -0.240], [-0.588, 0.166])) / np.hypot(0.484, 0.406)
    assert arm == pytest.approx(0.251, abs=5e-4)
    rate = 1e6 * arm**2 / 0.288**2
    assert rate == pytest.approx(0.76e6, rel=5e-3)

    def deflection(changes=None, force=20.0):
        """Static deflection of a wheel under equal forces on all, with a chassis too heavy to move."""
        heavy = {"chassis.mass": 1e12, "chassis.inertia": (1e12, 1e12, 1e12), "gravity": 0.0}
        probe = Probe({**heavy, "suspension.damping": 6e4, **(changes or {})})
        for side in ("left", "right"):
            for i in range(1, 6):
                probe[f"{side}.road_wheel[{i}].force.z"] = force
        probe.run(2.0)
        assert abs(probe["left.suspension[3].force"] * arm - force * 0.288) < 1e-4 * force
        return probe["left.road_wheel[3].position"][2] + 0.215

    assert deflection() == pytest.approx(20.0 / rate, rel=2e-3)
    assert deflection({"suspension.stiffness": 1.02e6}) != pytest.approx(20.0 / rate, rel=1e-2)


def test_a_deep_static_deflection_by_hand():
    """Moment balance about the pin at the angle found, from the drawn points alone."""
    heavy = {
        "chassis.mass": 1e12,
        "chassis.inertia": (1e12, 1e12, 1e12),
        "suspension.damping": 6e4,
        "gravity": 0.0,
    }
    probe = Probe(heavy, **{"suspension.preload": 5e3})
    probe["right.road_wheel[4].force.z"] = 25e3
    probe.run(3.0)
    angle = probe["right.road_arm[4].angle"]
    assert angle > 0.05  # up
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])  # about +y, on (x, z)
    wheel, end, top = turn @ [-0.288, -0.134], turn @ [-0.104, -0.240], np.array([-0.588, 0.166])
    line = top - end
    length = np.hypot(*line)
    push = 5e3 + 1e6 * (np.hypot(0.484, 0.406) - length)
    moment = -wheel[0] * 25e3  # upward force on a trailing wheel lifts it
    spring = push * cross2(end, line / length)  # the push on the arm is along -line
    assert abs(spring) == pytest.approx(moment, rel=1e-6)
    assert probe["right.suspension[4].force"] == pytest.approx(push, rel=1e-6)
    assert probe["right.suspension[4].length"] == pytest.approx(length, rel=1e-12)
    assert push * 1.02 * abs(cross2(end, line / length)) != pytest.approx(moment, rel=1e-2)


def test_tensioner_pushes_rearward():
    heavy = {
        "chassis.mass": 1e12,
        "chassis.inertia": (1e12, 1e12, 1e12),
        "gravity": 0.0,
        "tensioner.damping": 4e4,
    }
    probe = Probe(heavy, **{"tensioner.preload": 15e3})
    assert probe["left.tensioner.force"] == 15e3
    probe["left.idler.force.x"] = 17e3  # the track pulls forward
    probe.run(2.0)
    assert probe["left.idler.position"][0] - IDLER == pytest.approx(2e3 / 1e6, rel=1e-4)
    assert probe["left.tensioner.force"] == pytest.approx(17e3, rel=1e-7)
    assert probe["right.idler.position"][0] - IDLER == pytest.approx(-15e-3, rel=1e-4)  # nothing holds it


def test_a_torque_spins_a_wheel_and_nothing_else():
    probe = Probe({"gravity": 0.0})
    probe["right.road_wheel[1].torque.y"] = 100.0
    probe.run(0.7)
    assert probe["right.road_wheel[1].angular_velocity"][1] == pytest.approx(100 * 0.7 / 26.06, rel=1e-13)
    assert np.abs(probe["chassis.velocity"]).max() < 1e-15
    half = 0.5 * (0.5 * 100 / 26.06 * 0.7**2)
    assert probe["right.road_wheel[1].orientation.w"] == pytest.approx(np.cos(half), abs=1e-13)
    assert probe["right.road_wheel[1].orientation.y"] == pytest.approx(np.sin(half), abs=1e-13)
    assert probe["energy.kinetic"] == pytest.approx(0.5 * 26.06 * (100 * 0.7 / 26.06) ** 2, rel=1e-12)


def top(changes=None):
    """All mass but the chassis negligible, one idler spinning: a gyrostat, symmetric about y."""
    light = {
        "gravity": 0.0,
        "chassis.inertia": (1000.0, 600.0, 1000.0), "chassis.centre": (0.0, 0.0, 0.0), "chassis.mass": 1e3,
        "sprocket.mass": 1e-9, "sprocket.transverse_inertia": 1e-9,
        "road_arm.mass": 1e-5, "road_arm.pin_inertia": 1e-7, "road_arm.long_inertia": 1e-7,
        "road_wheel.mass": 1e-5, "road_wheel.transverse_inertia": 1e-9, "road_wheel.spin_inertia": 1e-9,
        "idler.mass": 1e-5, "idler.transverse_inertia": 1e-9,
        "suspension.stiffness": 0.1, "suspension.damping": 1e-3,
        "tensioner.stiffness": 0.1, "tensioner.damping": 1e-3,
    }  # fmt: skip
    return Probe({**light, **(changes or {})}, step=2e-3)


@pytest.mark.parametrize("spin", [0.0, 40.0])
def test_precession_of_a_symmetric_gyrostat(spin):
    """Torque-free: the axis turns about the momentum H at |H| / I_t, with the wheel's spin in H."""

    def axis_after(time, changes=None):
        probe = top(changes)
        x = probe.model.state
        x[10:13] = 0.3, 0.8, 0.0
        x[ROOT + 3 * LEAVES + 5] = spin  # the left idler
        probe.run(time, 2e-3)
        return Rotation.from_quat(x[3:7], scalar_first=True).apply([0, 1, 0])

    H = np.array([1000 * 0.3, 600 * 0.8 + 14.70 * spin, 0.0])
    expected = Rotation.from_rotvec(H / 1000 * 2.0).apply([0, 1, 0])
    assert np.allclose(axis_after(2.0), expected, rtol=0, atol=2e-5)
    if spin:
        assert not np.allclose(axis_after(2.0, {"idler.spin_inertia": 1.03 * 14.70}), expected, atol=1e-3)


# --- an independent formulation ---


def accelerations_by_constraints(table, x, u):
    """Accelerations of the same state from maximal coordinates: every body free, pins as equations.

    Bodies with full inertia tensors and Euler's equations, constraint forces by one dense solve. Returns what
    ``rates`` calls dx/dt from index 7 (without bookkeeping).
    """
    n, half = LEAVES, LEAVES // 2
    A = Rotation.from_quat(x[3:7], scalar_first=True).as_matrix()
    v0, w0, a_y, a_x = x[7:10], A @ x[10:13], A[:, 1], A[:, 0]
    centre = np.array(table["chassis"]["centre"])
    wheel, arm, spring, idler = table["road_wheel"], table["road_arm"], table["suspension"], table["idler"]
    mass, inertia, place, velocity, omega, force, torque = [], [], [], [], [], [], []
    rows, gammas = [], []

    def body(m, J, R, r, v, w):
        mass.append(m)
        inertia.append(R @ np.diag(J) @ R.T)
        place.append(r)
        velocity.append(v)
        omega.append(w)
        force.append(np.array([0, 0, -m * table["gravity"]]))
        torque.append(np.zeros(3))
        return len(mass) - 1

    def row(terms, gamma):
        rows.append(terms)
        gammas.append(gamma)

    def same_point(i, j, p, directions=np.eye(3)):  # noqa: B008
        """The point p of bodies i and j moves alike along the directions."""
        ri, rj = p - place[i], p - place[j]
        gi = np.cross(omega[i], np.cross(omega[i], ri))
        gj = np.cross(omega[j], np.cross(omega[j], rj))
        for e in directions:
            row(
                {i: np.concatenate([e, np.cross(ri, e)]), j: -np.concatenate([e, np.cross(rj, e)])},
                -e @ (gi - gj),
            )

    def same_turn(i, j, directions):
        """No relative rotation about directions e fixed in body i."""
        for e in directions:
            g = np.cross(omega[i], e) @ (omega[j] - omega[i])
            row({j: np.concatenate([np.zeros(3), e]), i: -np.concatenate([np.zeros(3), e])}, -g)

    def load(i, p, f, t):
        force[i] += f
        torque[i] += np.cross(p - place[i], f) + t

    root = body(table["chassis"]["mass"], table["chassis"]["inertia"], A, x[:3], v0, w0)
    units, hinges = [], []
    for side, sign in enumerate((1, -1)):
        lateral = sign * table["track"]["lateral"]
        for i, wx in enumerate([*wheel["x"], None]):
            k = side * half + i
            d, rate, spin = x[ROOT + k], x[ROOT + 2 * n + k], x[ROOT + 3 * n + k]
            w_wheel = w0 - (w0 @ a_y) * a_y + spin * a_y
            if wx is None:
                p0 = np.array([idler["x"], lateral, idler["z"]]) - centre
                r = A @ (p0 + np.array([d, 0, 0]))
                v = v0 + np.cross(w0, r) + rate * a_x
                J = (idler["transverse_inertia"], idler["spin_inertia"], idler["transverse_inertia"])
                b = body(idler["mass"], J, A, x[:3] + r, v, w_wheel)
                same_turn(root, b, [a_x, A[:, 2]])
                for e in (a_y, A[:, 2]):  # stays on the slide: e.(r_b - r_0) constant, e fixed in the chassis
                    g = 2 * np.cross(w0, e) @ (v - v0) + np.cross(w0, np.cross(w0, e)) @ r
                    row({b: np.concatenate([e, np.zeros(3)]), root: np.concatenate([-e, np.cross(e, r)])}, -g)
                t = table["tensioner"]
                push = t["preload"] + t["stiffness"] * d + t["damping"] * rate
                load(b, x[:3] + r, -push * a_x, np.zeros(3))
                load(root, x[:3] + r, push * a_x, np.zeros(3))
                units.append(b)
                hinges.append((b, None))
                continue
            R = A @ Rotation.from_rotvec([0, d, 0]).as_matrix()
            pivot = np.array([wx + arm["pivot"][0], lateral, wheel["z"] + arm["pivot"][1]]) - centre
            to_wheel = np.array([-arm["pivot"][0], 0, -arm["pivot"][1]])
            pin = x[:3] + A @ pivot
            w_arm = w0 + rate * a_y
            v_pin = v0 + np.cross(w0, pin - x[:3])
            long = to_wheel / np.linalg.norm(to_wheel)
            frame = R @ np.column_stack([long, [0, 1, 0], np.cross(long, [0, 1, 0])])
            r_arm, r_wheel = R @ (0.5 * to_wheel), R @ to_wheel
            J = (arm["long_inertia"], arm["pin_inertia"], arm["pin_inertia"])
            ia = body(arm["mass"], J, frame, pin + r_arm, v_pin + np.cross(w_arm, r_arm), w_arm)
            J = (wheel["transverse_inertia"], wheel["spin_inertia"], wheel["transverse_inertia"])
            iw = body(wheel["mass"], J, A, pin + r_wheel, v_pin + np.cross(w_arm, r_wheel), w_wheel)
            same_point(root, ia, pin)
            same_turn(root, ia, [a_x, A[:, 2]])
            same_point(ia, iw, pin + r_wheel)
            same_turn(ia, iw, [R[:, 0], R[:, 2]])
            low = pin + R @ (to_wheel + np.array([spring["on_arm"][0], 0, spring["on_arm"][1]]))
            high = pin + A @ (to_wheel + np.array([spring["on_chassis"][0], 0, spring["on_chassis"][1]]))
            drawn = np.hypot(*(np.array(spring["on_arm"]) - spring["on_chassis"]))
            length = np.linalg.norm(high - low)
            e = (high - low) / length
            growth = e @ (v0 + np.cross(w0, high - x[:3]) - v_pin - np.cross(w_arm, low - pin))
            push = spring["preload"] + spring["stiffness"] * (drawn - length) - spring["damping"] * growth
            load(ia, low, -push * e, np.zeros(3))
            load(root, high, push * e, np.zeros(3))
            units.append(iw)
            hinges.append((iw, ia))
        s = table["sprocket"]
        r = A @ (np.array([0, lateral, 0]) - centre)
        J = (s["transverse_inertia"], 0.0, s["transverse_inertia"])
        b = body(s["mass"], J, A, x[:3] + r, v0 + np.cross(w0, r), w0)
        same_point(root, b, x[:3] + r)
        same_turn(root, b, np.eye(3))
        units.append(b)
    for unit, wrench in zip(units, u.reshape(-1, 6), strict=True):
        load(unit, place[unit], wrench[:3], wrench[3:])

    size, m = 6 * len(mass), len(rows)
    K, f = np.zeros((size + m, size + m)), np.zeros(size + m)
    for b in range(len(mass)):
        K[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = mass[b] * np.eye(3)
        K[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = inertia[b]
        f[6 * b : 6 * b + 3] = force[b]
        f[6 * b + 3 : 6 * b + 6] = torque[b] - np.cross(omega[b], inertia[b] @ omega[b])
    for i, (terms, gamma) in enumerate(zip(rows, gammas, strict=True)):
        for b, g in terms.items():
            K[size + i, 6 * b : 6 * b + 6] = g
            K[6 * b : 6 * b + 6, size + i] = g
        f[size + i] = gamma
    acc = np.linalg.solve(K, f)[:size].reshape(-1, 6)
    rate_dots, spin_dots = np.zeros(n), np.zeros(n)
    for k, (b, on) in enumerate(hinges):
        spin_dots[k] = a_y @ acc[b, 3:]  # the axis turns across itself: d(a.w) = a.w'
        if on is None:  # along the slide
            r, v = place[b] - x[:3], velocity[b] - v0
            rate = x[ROOT + 2 * n + k]
            relative = acc[b, :3] - acc[root, :3] - np.cross(acc[root, 3:], r) - np.cross(w0, np.cross(w0, r))
            rate_dots[k] = a_x @ (relative - 2 * np.cross(w0, rate * a_x))
            assert np.allclose(v, np.cross(w0, r) + rate * a_x)
        else:
            rate_dots[k] = a_y @ (acc[on, 3:] - acc[root, 3:])
    return acc[root, :3], A.T @ acc[root, 3:], rate_dots, spin_dots


@pytest.mark.parametrize("seed", range(3))
def test_accelerations_agree_with_maximal_coordinates(seed):
    table = copy.deepcopy(TABLE)
    table["chassis"]["centre"] = (-2.006, 0.13, 0.406)  # nothing may hide behind symmetry
    table["suspension"]["preload"], table["tensioner"]["preload"] = 4e3, 9e3
    model = Model({"vehicle": table, "chassis": {"sides": ["left", "right"]}})
    model.initialise({})
    x = stir(model, seed=seed)
    u = 1e4 * np.random.default_rng(seed).normal(size=84)
    linear, angular, rate, spin = accelerations_by_constraints(table, x, u)
    n = LEAVES

    def agrees(numbers, tolerance):
        out = np.empty_like(x)
        rates(numbers, None, x, u, out)
        return all(
            np.allclose(ours, theirs, rtol=tolerance, atol=tolerance * np.abs(theirs).max())
            for ours, theirs in (
                (out[7:10], linear),
                (out[10:13], angular),
                (out[ROOT + 2 * n : ROOT + 3 * n], rate),
                (out[ROOT + 3 * n : ROOT + 4 * n], spin),
            )
        )

    numbers = tree(table, 2)
    assert agrees(numbers, 1e-9)
    for name in (
        "across",
        "along",
        "transverse",
        "spin_inertia",
        "leaf_mass",
        "stiffness",
        "damping",
        "inertia",
    ):
        assert not agrees(numbers._replace(**{name: 1.03 * getattr(numbers, name)}), 1e-6), name


# --- conserved quantities ---


def momenta(model):
    """Linear momentum, and angular momentum about the world's origin, body by body from the table."""
    x, n, table = model.state, LEAVES, TABLE
    A = Rotation.from_quat(x[3:7], scalar_first=True).as_matrix()
    v, w = x[7:10], A @ x[10:13]
    P, L = np.zeros(3), np.zeros(3)

    def add(mass, r, J, omega):
        nonlocal P, L
        velocity = v + np.cross(w, r) if not isinstance(r, tuple) else r[1]
        r = r if not isinstance(r, tuple) else r[0]
        P = P + mass * velocity
        L = L + mass * np.cross(x[:3] + r, velocity) + J @ omega

    centre = np.array(table["chassis"]["centre"])
    add(table["chassis"]["mass"], np.zeros(3), A @ np.diag(table["chassis"]["inertia"]) @ A.T, w)
    for side, sign in enumerate((1, -1)):
        lateral = sign * table["track"]["lateral"]
        s = table["sprocket"]
        J = A @ np.diag([s["transverse_inertia"], 0, s["transverse_inertia"]]) @ A.T
        add(s["mass"], A @ (np.array([0, lateral, 0]) - centre), J, w)
        for i in range(6):
            k = 6 * side + i
            d, rate, spin = x[ROOT + k], x[ROOT + 2 * n + k], x[ROOT + 3 * n + k]
            part = table["idler"] if i == 5 else table["road_wheel"]
            J = A @ np.diag([part["transverse_inertia"], part["spin_inertia"], part["transverse_inertia"]]) @ A.T
            w_wheel = w + (spin - w @ A[:, 1]) * A[:, 1]
            if i == 5:
                r = A @ (np.array([part["x"] + d, lateral, part["z"]]) - centre)
                add(part["mass"], (r, v + np.cross(w, r) + rate * A[:, 0]), J, w_wheel)
                continue
            arm = table["road_arm"]
            pin = A @ (np.array([part["x"][i] + 0.288, lateral, part["z"] + 0.134]) - centre)
            R, w_arm = A @ Rotation.from_rotvec([0, d, 0]).as_matrix(), w + rate * A[:, 1]
            to_wheel = np.array([-0.288, 0, -0.134])
            e = R @ to_wheel / np.linalg.norm(to_wheel)
            J_arm = arm["pin_inertia"] * np.eye(3) - (arm["pin_inertia"] - arm["long_inertia"]) * np.outer(e, e)
            for mass, share, J_part, turn in (
                (arm["mass"], 0.5, J_arm, w_arm),
                (part["mass"], 1.0, J, w_wheel),
            ):
                r = R @ to_wheel * share
                add(mass, (pin + r, v + np.cross(w, pin) + np.cross(w_arm, r)), J_part, turn)
    return np.concatenate([P, L])


def drift(h, changes=FLOATING, what=momenta, time=0.4):
    probe = Probe(changes, step=h)
    stir(probe.model)
    before = what(probe.model)
    probe.run(time, h)
    return np.abs(what(probe.model) - before).max() / np.abs(before).max()


def total_energy(model):
    return np.array([sum(energies(model.tree, model.state))])


@pytest.mark.parametrize("what", [momenta, total_energy])
def test_free_flight_conserves(what):
    """Springs oscillate and wheels spin; the drift falls with the integrator's order and is small at 1 ms."""
    coarse, fine = drift(4e-3, what=what), drift(2e-3, what=what)
    assert drift(1e-3, what=what) < 1e-8
    assert 3.6 < np.log2(coarse / fine) < 5.4
    if what is total_energy:
        assert drift(1e-3, changes={**FLOATING, "suspension.damping": 1.0}, what=what) > 1e-7


def test_convergence_rate_is_four():
    def end(h):
        probe = Probe(step=h)
        stir(probe.model)
        probe["left.sprocket.force.x"], probe["right.road_wheel[2].torque.x"] = 3e4, 1e4
        return probe.run(0.16, 0.16).model.state.copy()

    exact = end(1.25e-4)
    errors = [np.linalg.norm(end(h) - exact) for h in (4e-3, 2e-3, 1e-3)]
    slopes = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all(np.abs(slopes - 4.0) < 0.25), slopes


def test_energy_ledger_closes():
    """Kinetic + gravity + spring + dissipated - work of the wrenches stays, with everything in motion."""

    def residual(work=1.0):
        probe = Probe()
        stir(probe.model)
        before = probe.energy
        probe["left.road_wheel[1].force.z"], probe["right.idler.force.x"] = 2e4, 1e4
        probe["left.sprocket.torque.y"], probe["right.road_wheel[5].torque.x"] = -5e3, 4e3
        probe.run(0.3)
        assert probe["energy.dissipated"] > 100.0
        return probe.energy + probe["energy.dissipated"] - before - work * probe["port.work"], probe["port.work"]

    rest, work = residual()
    assert abs(rest) < 1e-7 * abs(work)
    assert abs(residual(1.01)[0]) > 1e-3 * abs(work)


# --- symmetries ---


def test_heading_changes_nothing():
    def driven(heading):
        probe = Probe(**{"start.heading": heading, "start.position.x": 2.0})
        c, s = np.cos(heading), np.sin(heading)
        for name, (fx, fy, fz) in {
            "left.sprocket": (2e4, 500, 100),
            "right.road_wheel[3]": (0, -900, 4e4),
        }.items():
            probe[f"{name}.force.x"], probe[f"{name}.force.y"] = c * fx - s * fy, s * fx + c * fy
            probe[f"{name}.force.z"] = fz
        probe.run(0.3)
        return np.array([probe[k] for k in ("distance", "speed", "settlement", "pitch", "roll")]), probe["yaw"]

    straight, turned = driven(0.0), driven(np.radians(37))
    assert np.allclose(straight[0], turned[0], rtol=1e-11, atol=1e-13)
    assert turned[1] - straight[1] == pytest.approx(np.radians(37), abs=1e-12)


def test_mirrored_wrenches_mirror_the_motion():
    def driven(side, other, mirror):
        probe = Probe()
        probe[f"{side}.road_wheel[2].force.z"], probe[f"{side}.road_wheel[2].force.y"] = 3e4, mirror * 2e3
        probe[f"{side}.idler.torque.x"], probe[f"{other}.sprocket.force.x"] = mirror * 500.0, 1e4
        return probe.run(0.2)

    a, b = driven("left", "right", 1), driven("right", "left", -1)
    assert np.allclose(a["chassis.position"], b["chassis.position"] * [1, -1, 1], rtol=0, atol=1e-13)
    for name, sign in (("roll", -1), ("yaw", -1), ("pitch", 1), ("settlement", 1)):
        assert a[name] == pytest.approx(sign * b[name], abs=1e-13)
    assert a["left.road_arm[2].angle"] == pytest.approx(b["right.road_arm[2].angle"], abs=1e-13)
    assert abs(a["roll"]) > 1e-4


def test_left_side_alone_runs_as_both_sides_driven_alike():
    def driven(sides):
        probe = Probe(sides=sides)
        for side in sides:
            sign = 1 if side == "left" else -1
            probe[f"{side}.road_wheel[4].force.z"], probe[f"{side}.sprocket.force.x"] = 3e4, 2e4
            probe[f"{side}.road_wheel[4].force.y"], probe[f"{side}.road_wheel[4].torque.z"] = (
                sign * 900,
                sign * 300,
            )
        return probe.run(0.2)

    half, whole = driven(["left"]), driven(["left", "right"])
    assert len(half.inputs) == 42
    assert not [name for name in half.names if name.startswith("right")]
    assert np.allclose(half.model.state, whole.model.state, rtol=1e-12, atol=1e-12)


# --- manners ---


def test_cost_in_evaluations():
    probe = Probe(step=1e-3)
    probe.run(0.01, 2.5e-3)
    assert list(probe.model.counters) == [4 * 3, 4 * 3 * 4]
    for name, kind in (("solver.steps", int), ("solver.evaluations", int)):
        assert [type(port.start) for port in probe.model.ports if port.name == name] == [kind]


def test_saving_is_copying_the_state():
    probe = Probe()
    stir(probe.model)
    saved = probe.model.state.copy()
    first = probe.run(0.02).model.state.copy()
    probe.model.state[:] = saved
    assert np.array_equal(probe.run(0.02).model.state, first)


@pytest.mark.parametrize(
    ("inputs", "words"),
    [
        ({"left.idler.force.x": np.nan}, ("left.idler.force.x", "not finite")),
        ({"right.road_wheel[3].force.z": 1e6}, ("right road_arm[3]", "beyond its reach")),
        ({"left.idler.force.x": -2e6}, ("left idler", "beyond its reach")),
    ],
)
def test_absurd_motion_fails_with_a_sentence(inputs, words):
    probe = Probe()
    for name, value in inputs.items():
        probe[name] = value
    with pytest.raises(StepFailed) as failure:
        probe.run(1.0)
    assert all(word in str(failure.value) for word in ("t = ", *words))
    assert np.all(np.isfinite(probe.model.state))


@pytest.mark.parametrize("parameters", [{"step": 0.0}, {"step": np.nan}, {"start__heading": np.inf}])
def test_bad_parameters_are_refused(parameters):
    with pytest.raises(InvalidParameter, match=next(iter(parameters)).replace("__", ".")):
        Probe(**parameters)


def test_a_step_that_takes_for_ever_is_refused():
    probe = Probe()
    with pytest.raises(StepFailed, match="a communication step of 1e\\+300 s takes 1e\\+303 internal steps"):
        probe.model.step(0.0, 1e300, probe.u)


def test_sides_must_include_the_left():
    with pytest.raises(InvalidParameter, match="sides"):
        Probe(sides=["right"])


def test_mass_is_the_vehicle_without_its_links():
    probe = Probe()
    assert probe.model.tree.total_mass == pytest.approx(BODY_MASS, abs=1e-9)
