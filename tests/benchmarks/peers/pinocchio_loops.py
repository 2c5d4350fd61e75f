"""Chain in Pinocchio, called from Python: a tree of hinges, a loop's from a planar free body, closed at a point.

``lcaba`` eliminates the constraint along the tree, with the classical Runge-Kutta method in equal steps;
``constraintDynamics`` factors the joint space, with scipy's DOP853 by its tolerance. Both need a proximal parameter:
the constraint has three equations, of which two are independent. At its default, 0, the second one returns no numbers.
An open chain has neither: ``aba``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from tests.benchmarks import motion
from tests.benchmarks.motion import Case, Floats, Loop
from tests.benchmarks.timing import cpu, least

STEPS = (14e-3, 12.5e-3, 10e-3, 5e-3, 2e-3, 1e-3)  # s, of the Runge-Kutta method
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)  # of DOP853
QUICK_TOLERANCES = (1e-6,)
PROXIMAL = 1e-8
FIXED, BY_ERROR = "lcaba, RK4", "constraintDynamics, DOP853"


def measure(case: str, quick: bool, repeats: int) -> list[dict[str, Any]]:
    """Runs of the case of rigid links without ground."""
    wanted = motion.CASES[case]
    if wanted.track != "rigid" or wanted.ground:
        return []
    stop = wanted.quick if quick else wanted.stop
    runs = []
    for code, points in (
        (FIXED, wanted.steps(STEPS[-1:] if quick else STEPS)),
        (BY_ERROR, QUICK_TOLERANCES if quick else TOLERANCES),
    ):
        for point in points:
            spent, (pins, step) = least(repeats, run, wanted, stop, code, point)
            name = code if wanted.scene == motion.SCENE else f"aba, {code.split(', ')[1]}"
            runs.append({"code": name, "step": step, "cpu": spent, "pins": pins.tolist()})
    return runs


def run(case: Case, stop: float, code: str, point: float) -> tuple[float, tuple[Floats, float]]:
    """CPU time, s; pins at ``stop`` and mean step, s. ``point``: step, s, or tolerance."""
    loop = motion.loop(case)
    rates, places = system(loop, code) if loop.closed else open_system(loop)
    turns = (np.diff(loop.angle) + np.pi) % (2.0 * np.pi) - np.pi
    x = np.concatenate([[loop.angle[0]], turns, np.diff(loop.rate, prepend=0.0)])
    if loop.closed:
        n = len(loop.pins)
        x = np.concatenate([loop.pins[0], x[:n], loop.velocity[0], x[n:]])
    if code == FIXED:
        steps = round(stop / point)
        spent, end = cpu(lambda: runge_kutta(rates, x, stop / steps, steps))
    else:
        spent, found = cpu(lambda: solve_ivp(lambda _, y: rates(y), (0.0, stop), x, "DOP853", rtol=point, atol=point))
        steps, end = len(found.t) - 1, found.y[:, -1]
    return spent, (places(end), stop / steps)


def runge_kutta(f: Callable[[Floats], Floats], x: Floats, h: float, steps: int) -> Floats:
    """State after ``steps`` of the classical method, of ``h`` s each."""
    for _ in range(steps):
        a = f(x)
        b = f(x + 0.5 * h * a)
        c = f(x + 0.5 * h * b)
        x = x + h / 6.0 * (a + 2.0 * (b + c) + f(x + h * c))
    return x


def tree(loop: Loop, first: Any, place: Any) -> tuple[Any, Any]:
    """Model of links from the joint ``first`` at ``place``, and the place of a link's end from its beginning."""
    import pinocchio as pin

    p, model, link = loop.pitch, pin.Model(), 0
    model.gravity.linear = np.array([0.0, -loop.gravity, 0.0])
    rod = pin.Inertia(loop.mass, np.array([0.5 * p, 0.0, 0.0]), np.diag([0.0, 1.0, 1.0]) * loop.mass * p**2 / 12.0)
    ahead = pin.SE3(np.eye(3), np.array([p, 0.0, 0.0]))
    for k in range(len(loop.angle)):
        link = model.addJoint(link, pin.JointModelRZ() if k else first, ahead if k else place, f"link {k}")
        model.appendBodyToJoint(link, rod, pin.SE3.Identity())
    return model, ahead


def open_system(loop: Loop) -> tuple[Callable[[Floats], Floats], Callable[[Floats], Floats]]:
    """Rates of a state (2 n) of an open chain, angles and their rates, and its pins (n + 1, 2)."""
    import pinocchio as pin

    model, ahead = tree(loop, pin.JointModelRZ(), pin.SE3(np.eye(3), np.array([*loop.pins[0], 0.0])))
    data, n = model.createData(), model.nv
    torque = np.zeros(n)

    def rates(x: Floats) -> Floats:
        return np.concatenate([x[n:], pin.aba(model, data, x[:n], x[n:], torque)])

    def places(x: Floats) -> Floats:
        pin.forwardKinematics(model, data, x[:n])
        last = data.oMi[n].act(ahead.translation)
        return np.array([*(data.oMi[k + 1].translation[:2] for k in range(n)), last[:2]])

    return rates, places


def system(loop: Loop, code: str) -> tuple[Callable[[Floats], Floats], Callable[[Floats], Floats]]:
    """Rates of a state (2 n + 4), and its pins (n, 2).

    The state is the place of the first pin, the angle of the first link and those between links, and their rates.
    """
    import pinocchio as pin

    n = len(loop.pins)
    model, ahead = tree(loop, pin.JointModelPlanar(), pin.SE3.Identity())
    link = model.njoints - 1
    closing = pin.RigidConstraintModel(
        pin.ContactType.CONTACT_3D, model, link, ahead, 1, pin.SE3.Identity(), pin.ReferenceFrame.LOCAL
    )
    data = model.createData()
    constraints, memory = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    constraints.append(closing)
    memory.append(closing.createData())
    proximal = pin.ProximalSettings(1e-12, PROXIMAL, 10)
    if code == FIXED:
        pin.computeJointMinimalOrdering(model, data, constraints)
        dynamics = pin.lcaba
    else:
        pin.initConstraintDynamics(model, data, constraints, memory)
        dynamics = pin.constraintDynamics
    torque, q, v = np.zeros(model.nv), np.empty(model.nq), np.empty(model.nv)

    def positions(x: Floats) -> tuple[float, float]:
        c, s = np.cos(x[2]), np.sin(x[2])
        q[:2], q[2], q[3], q[4:] = x[:2], c, s, x[3 : n + 2]
        return c, s

    def rates(x: Floats) -> Floats:
        c, s = positions(x)
        speed = x[n + 2 :]
        v[:] = speed
        v[0], v[1] = c * speed[0] + s * speed[1], c * speed[1] - s * speed[0]
        acceleration = dynamics(model, data, q, v, torque, constraints, memory, proximal)
        k = np.concatenate([speed, acceleration])
        # of the first pin, in axes that do not turn
        a, b = acceleration[0] - speed[2] * v[1], acceleration[1] + speed[2] * v[0]
        k[n + 2], k[n + 3] = c * a - s * b, s * a + c * b
        return k

    def places(x: Floats) -> Floats:
        positions(x)
        pin.forwardKinematics(model, data, q)
        return np.array([data.oMi[k + 1].translation[:2] for k in range(n)])

    return rates, places
