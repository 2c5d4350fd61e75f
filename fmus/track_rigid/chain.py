"""The rigid chain in time: residual with contact, Newton, ``settle`` to static equilibrium and ``advance``.

Index-3 generalised-alpha on the Lie group of the links' poses: the equations of motion and the pins' position
equations hold at the end of every step, to the tolerances below.

    M vdot + w cross J w - f(t, q, v) - B(q)^T lambda = 0,    C(q) + D lambda = 0

Unknowns of Newton are the links' increments over the step and the multipliers (rigid/augmented.py). What a
wheel gets is the reaction to what its contacts give to the links, passed through the recursion of the
velocities. All in the track's frame.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.jit import allocating, kernel
from fmus.physics.carrier import carrier
from fmus.physics.chain.rigid_links import act, lever, rate
from fmus.physics.chain.touch import roll
from fmus.physics.chain_speed import chain_speed
from fmus.physics.integrate.generalized_alpha import GeneralizedAlpha, auxiliary, slopes
from fmus.physics.point import Memory, memory, points, sharpen
from fmus.physics.rigid import augmented, body, pin
from fmus.physics.rigid.augmented import System
from fmus.physics.vector import add, dot, scale, vector
from fmus.physics.wheels import WIDTH, move
from fmus.track_rigid.loads import (
    CONTACT,
    COVERED,
    COVERING,
    DEPTH,
    DISSIPATED,
    LOAD,
    LOAD_POWER,
    NOW,
    POWER,
    SIDESLIP,
    SLIP,
    TALLY,
    TRAVEL,
    WORK,
)

GAP = 1e-11  # largest misfit of a pin, m and rad: 1e-12 of the length of a track
FORCE = 1e-6  # largest residual of a link, relative to weight and pull; what is left goes into the accelerations
ITERATIONS = 15  # of Newton, before a step is given up
NONE = (0.0,) * 9  # the matrix of a constant force
SLOW = 0.5  # a new tangent that leaves more than this of it: friction is sharp
REUSE = 0.1  # keep the tangent while an iteration leaves less than this of the residual
BACKWARD = GeneralizedAlpha(0.0, 0.0, 1.0, 1.0)  # of the pseudo-transient: backward Euler
LONG = 50.0  # longest pseudo step towards equilibrium, s
STILL = 1e-11  # largest movement over it at equilibrium, m and rad


class Link(NamedTuple):
    """A link, SI units."""

    half: float  # half the pitch, m
    face: float  # from the pin line to the inner and to the outer face, m
    lateral: float  # of the contact points from the middle, m
    mass: float  # kg
    inertia: np.ndarray  # (3) about its own axes, kg m2


class State(NamedTuple):
    """Views into the flat state of a chain: n links, p pins, m wheels."""

    q: np.ndarray  # (n, 7) poses: centre of mass, quaternion
    v: np.ndarray  # (n, 6) velocity, angular velocity in body axes
    a: np.ndarray  # (n, 6) auxiliary accelerations
    vdot: np.ndarray  # (n, 6) accelerations
    lam: np.ndarray  # (p, 5) multipliers of the pins
    F: np.ndarray  # (m + 1, 6) wrench on each wheel now; the last row is the ground's on the chain
    W: np.ndarray  # (m + 1, 6) auxiliary wrenches
    load: np.ndarray  # (p, 3) force of teeth and damping on each pin now: half of it on either of its links, N
    tally: np.ndarray  # (TALLY)


class Work(NamedTuple):
    """Scratch of one chain."""

    system: System
    contact: Memory
    q0: np.ndarray  # (n, 7), and the state at the beginning of the step
    v0: np.ndarray
    a0: np.ndarray
    vdot0: np.ndarray
    lam0: np.ndarray
    F0: np.ndarray
    x: np.ndarray  # (n, 6) increments over the step
    rows: np.ndarray  # (m, 15) the wheels at the end of the step
    impulse: np.ndarray  # (m + 1, 6) over the communication step
    tally0: np.ndarray
    pins: np.ndarray  # (2, nodes, 3) their positions and velocities
    lever: np.ndarray  # (3) of a contact point
    N: np.ndarray  # (3, 3) its derivative by the link's turning
    ground: np.ndarray  # (2, 7) poses of the bodies that hold the first and the last pin
    still: np.ndarray  # (3, 3) their rotation matrix, ones


def shapes(n: int, closed: bool, wheels: int) -> tuple[tuple[int, ...], ...]:
    """Shapes of the arrays of a State, in order."""
    p, m = n if closed else n + 1, wheels + 1
    return ((n, 7), (n, 6), (n, 6), (n, 6), (p, 5), (m, 6), (m, 6), (p, 3), (TALLY,))


def views(flat: np.ndarray, n: int, closed: bool, wheels: int) -> State:
    """A State that looks into the flat array."""
    table = shapes(n, closed, wheels)
    parts = np.split(flat, np.cumsum([int(np.prod(shape)) for shape in table])[:-1])
    return State(*(part.reshape(shape) for part, shape in zip(parts, table, strict=True)))


def place(link: Link, pins: np.ndarray, s: State, w: Work) -> None:
    """Put the links between ``pins`` (nodes, 2; x and z) at rest, and the ground's pins where the chain ends."""
    n = len(s.q)
    chord = (np.roll(pins, -1, axis=0) - pins)[:n]
    angle = np.arctan2(chord[:, 1], chord[:, 0])  # from x towards z, that is about -y
    s.q[:] = 0.0
    s.q[:, [0, 2]] = pins[:n] + 0.5 * chord
    s.q[:, 3], s.q[:, 5] = np.cos(0.5 * angle), -np.sin(0.5 * angle)
    w.ground[0, [0, 2]] = pins[0] - [link.half, 0.0]
    w.ground[1, [0, 2]] = pins[-1] + [link.half, 0.0]


def work(n: int, closed: bool, wheels: int) -> Work:
    """Zeroed scratch."""
    z, p = np.zeros, n if closed else n + 1
    ground = z((2, 7))
    ground[:, 3] = 1.0
    return Work(
        augmented.system(n, closed),
        memory(points(wheels, p)),
        *(z((n, 7)), z((n, 6)), z((n, 6)), z((n, 6)), z((p, 5)), z((wheels + 1, 6)), z((n, 6))),
        *(
            z((wheels, WIDTH)),
            z((wheels + 1, 6)),
            z(TALLY),
            z((2, p, 3)),
            z(3),
            z((3, 3)),
            ground,
            np.eye(3),
        ),
    )


@kernel
def _across(link, closed, damping, s, w, by_v, tangent):
    """Damping of the pins' velocity across the chain, half on each of a pin's links."""
    A, r, K, n = w.system.A, w.system.r, w.system.K, s.q.shape[0]
    for j in range(s.lam.shape[0]):
        before, after = (j - 1 if j > 0 or not closed else n - 1), (j if j < n else -1)
        share = 1.0 if before < 0 or after < 0 else 0.5
        t = (0.0, 0.0, 0.0)
        for i in (before, after):
            if i >= 0:
                t = add(t, (A[i, 0, 0], A[i, 1, 0], A[i, 2, 0]))
        t = scale(1.0 / np.sqrt(dot(t, t)), t)
        for i, end in ((before, link.half), (after, -link.half)):
            if i < 0:
                continue
            u = rate(A[i], s.v[i], end, 0.0, 0.0)
            f = scale(-damping, add(u, scale(-dot(u, t), t)))
            c = by_v * damping
            g = (
                c * (t[0] * t[0] - 1.0), c * t[0] * t[1], c * t[0] * t[2],
                c * t[1] * t[0], c * (t[1] * t[1] - 1.0), c * t[1] * t[2],
                c * t[2] * t[0], c * t[2] * t[1], c * (t[2] * t[2] - 1.0),
            )  # fmt: skip
            for a in range(3):
                s.load[j, a] += share * f[a]
            s.tally[POWER] -= share * dot(f, u)
            act(A[i], lever(A[i], end, 0.0, 0.0), share, f, g, tangent, w.N, r[i], K[i])


@kernel
def _pull(link, ends, env, s, w):
    """Constant forces on the free ends of an open chain."""
    n = s.q.shape[0]
    for end in range(2):
        if ends.first if end == 0 else ends.last:
            continue
        i, at, f = end * (n - 1), (2.0 * end - 1.0) * link.half, vector(env.pull[end], 0)
        A = w.system.A[i]
        s.tally[LOAD_POWER] += dot(f, rate(A, s.v[i], at, 0.0, 0.0))
        act(A, lever(A, at, 0.0, 0.0), 1.0, f, NONE, False, w.N, w.system.r[i], w.system.K[i])


@kernel
def pins(link, ends, s, w):
    """Rotation matrices of the links, equations and axis rows of the pins."""
    y, n, p = w.system, s.q.shape[0], s.lam.shape[0]
    for i in range(n):
        body.rotation(s.q[i], y.A[i])
    for j in range(p):
        if ends.closed or 0 < j < n:
            b = j - 1 if j > 0 else n - 1
            pin.equations(link.half, s.q[b], y.A[b], s.q[j], y.A[j], y.C[j])
            pin.axis_rows(y.A[b], y.A[j], y.WP[j], y.WQ[j])
        elif j == 0 and ends.first:
            pin.equations(link.half, w.ground[0], w.still, s.q[0], y.A[0], y.C[0])
            pin.axis_rows(w.still, y.A[0], y.WP[0], y.WQ[0])
        elif j == n and ends.last:
            pin.equations(link.half, s.q[n - 1], y.A[n - 1], w.ground[1], w.still, y.C[n])
            pin.axis_rows(y.A[n - 1], w.still, y.WP[n], y.WQ[n])


@kernel
def _inertia(link, gravity, s, w, by, tangent):
    """Inertia less weight less pins into the residual of the links, and their tangent."""
    J, m, p = link.inertia, link.mass, s.lam.shape[0]
    A, R, KK, WP, WQ = w.system.A, w.system.r, w.system.K, w.system.WP, w.system.WQ
    vdot, v, lam, xx = s.vdot, s.v, s.lam, w.x
    g0, g1, g2 = (J[2] - J[1]), (J[0] - J[2]), (J[1] - J[0])
    h = 0.5 * by.vdot
    for i in range(s.q.shape[0]):
        r, j = R[i], (i + 1) % p
        o0, o1, o2 = v[i, 3], v[i, 4], v[i, 5]
        for a in range(6):
            r[a] = 0.0
        pin.reaction(link.half, A[i], lam[i], lam[j], WQ[i], WP[j], r)
        for a in range(3):
            r[a] = m * vdot[i, a] - r[a]
            r[3 + a] = J[a] * vdot[i, 3 + a] - r[3 + a]
        r[2] += m * gravity
        r[3] += g0 * o1 * o2
        r[4] += g1 * o2 * o0
        r[5] += g2 * o0 * o1
        if not tangent:
            continue
        K = KK[i]
        x0, x1, x2 = xx[i, 3], xx[i, 4], xx[i, 5]
        for a in range(6):
            for b in range(6):
                K[a, b] = 0.0
        for a in range(3):
            K[a, a] = m * by.vdot
            K[3 + a, 3 + a] = J[a] * by.vdot
        # gyroscopic part, then J T^-1(x) to first order: the increment turns the end of the step
        K[3, 4] = g0 * o2 * by.v - h * J[0] * x2
        K[3, 5] = g0 * o1 * by.v + h * J[0] * x1
        K[4, 3] = g1 * o2 * by.v + h * J[1] * x2
        K[4, 5] = g1 * o0 * by.v - h * J[1] * x0
        K[5, 3] = g2 * o1 * by.v - h * J[2] * x1
        K[5, 4] = g2 * o0 * by.v + h * J[2] * x0
        pin.stiffness(link.half, A[i], lam[i], lam[j], K[3:, 3:])


@kernel
def residual(link, ends, env, contacts, s, w, by, tangent):
    """Residuals of links and pins into the system, with ``tangent`` also its K; wrenches and the tally."""
    for k in range(NOW, TALLY):
        s.tally[k] = 0.0
    s.F[:] = 0.0
    s.load[:] = 0.0
    pins(link, ends, s, w)
    augmented.compliance(ends, w.system, s.lam)
    _inertia(link, env.gravity, s, w, by, tangent)
    if contacts is not None:
        roll(link, contacts, s, w, w.rows, s.F, s.tally[NOW:], w.contact, by.v, tangent)
    if env.transverse > 0.0:
        _across(link, ends.closed, env.transverse, s, w, by.v, tangent)
    if not ends.closed:
        _pull(link, ends, env, s, w)


@kernel
def _misfit(link, tolerance, s, w):
    """Largest residual over its tolerance, and the link (or pin) that has it."""
    pull = 0.0
    for j in range(s.lam.shape[0]):
        pull = max(pull, abs(s.lam[j, 0]), abs(s.lam[j, 2]))
    scale = tolerance * (link.mass * 9.81 + pull)
    worst, where = 0.0, -1
    y = w.system
    for i in range(s.q.shape[0]):
        for a in range(6):
            e = abs(y.r[i, a]) / (scale if a < 3 else scale * link.half)
            if not e <= worst:
                worst, where = e, i
    for j in range(s.lam.shape[0]):
        for a in range(5):
            e = abs(y.C[j, a]) / GAP
            if not e <= worst:
                worst, where = e, j
    return worst, where


@allocating
def newton(link, ends, env, contacts, method, h, tolerance, s, w, counters, moves):
    """One implicit step of ``h`` to the wheels in ``w.rows``, of a chain that ``moves``: friction may then be sharp.

    Returns -1, or the link that did not converge.
    """
    n = s.q.shape[0]
    by = slopes(method, h)
    w.q0[:] = s.q
    w.v0[:] = s.v
    w.a0[:] = s.a
    w.vdot0[:] = s.vdot
    w.lam0[:] = s.lam
    for i in range(n):
        for k in range(6):
            a0 = s.a[i, k]
            a1 = auxiliary(method, a0, s.vdot[i, k], s.vdot[i, k])
            w.x[i, k] = h * (s.v[i, k] + h * ((0.5 - method.beta) * a0 + method.beta * a1))
            s.v[i, k] += h * ((1.0 - method.gamma) * a0 + method.gamma * a1)
            s.a[i, k] = a1
        body.advance(w.q0[i], w.x[i], s.q[i])
    fresh, renewed, before = True, False, np.inf
    where, y, sharp = 0, w.system, w.contact.sharp
    sharp[0] = 0
    for _ in range(ITERATIONS):
        residual(link, ends, env, contacts, s, w, by, fresh)
        counters[1] += 1
        error, where = _misfit(link, tolerance, s, w)
        if error <= 1.0:
            _settle_rates(link, s, w, by)
            return -1
        if not error < 1e15:
            return max(where, 0)
        if not fresh and error > REUSE * before:
            if moves and renewed and error > SLOW * before:
                sharpen(w.contact)
            fresh = True
            residual(link, ends, env, contacts, s, w, by, fresh)
            counters[1] += 1
        if fresh:
            failed = augmented.factor(link.half, ends, y, 1.0)
            if failed >= 0:
                return failed
        augmented.solve(link.half, ends, y)
        counters[2] += 1
        fresh, renewed, before = sharp[0] == 1, fresh, error
        _update(s, w, by)
    return where


@kernel
def _update(s, w, by):
    """Apply the increments of a Newton iteration to everything that hangs on the positions."""
    y, d = w.system, w.lever
    for i in range(s.q.shape[0]):
        body.turn_rate(w.x[i, 3:], y.dx[i, 3:], d)
        for k in range(6):
            x = y.dx[i, k] if k < 3 else d[k - 3]
            w.x[i, k] += x
            s.v[i, k] += by.v * x
            s.a[i, k] += by.a * x
            s.vdot[i, k] += by.vdot * x
        body.advance(w.q0[i], w.x[i], s.q[i])
    for j in range(s.lam.shape[0]):
        for k in range(5):
            s.lam[j, k] += y.dl[j, k]


@kernel
def _settle_rates(link, s, w, by):
    """Give what is left of the residual to the accelerations: momentum is then balanced to rounding."""
    for i in range(s.q.shape[0]):
        for k in range(6):
            d = -w.system.r[i, k] / (link.mass if k < 3 else link.inertia[k - 3])
            s.vdot[i, k] += d
            s.a[i, k] += d * by.a / by.vdot
            s.v[i, k] += d * by.v / by.vdot


@allocating
def _restore(s, w):
    s.q[:] = w.q0
    s.v[:] = w.v0
    s.a[:] = w.a0
    s.vdot[:] = w.vdot0
    s.lam[:] = w.lam0


@allocating
def accelerations(link, ends, env, contacts, s, w):
    """Accelerations and multipliers that belong to poses and velocities; wrenches and auxiliaries with them."""
    n, y = s.q.shape[0], w.system
    s.vdot[:] = 0.0
    s.lam[:] = 0.0
    w.x[:] = 0.0
    residual(link, ends, env, contacts, s, w, slopes(BACKWARD, 1.0), False)
    y.K[:] = 0.0
    for i in range(n):
        for k in range(3):
            y.K[i, k, k] = link.mass
            y.K[i, 3 + k, 3 + k] = link.inertia[k]
    for j in range(s.lam.shape[0]):
        y.C[j] = 0.0
        if ends.closed or 0 < j < n:
            b = j - 1 if j > 0 else n - 1
            pin.velocity_terms(link.half, y.A[b], s.v[b, 3:], y.A[j], s.v[j, 3:], y.C[j])
        elif j == 0 and ends.first:
            pin.velocity_terms(link.half, w.still, 0.0 * s.v[0, 3:], y.A[0], s.v[0, 3:], y.C[0])
        elif j == n and ends.last:
            pin.velocity_terms(link.half, y.A[n - 1], s.v[n - 1, 3:], w.still, 0.0 * s.v[0, 3:], y.C[n])
    failed = augmented.factor(link.half, ends, y, augmented.REGULAR)
    if failed >= 0:
        return failed
    augmented.solve(link.half, ends, y)
    s.vdot[:] = y.dx
    s.a[:] = y.dx
    s.lam[:] = y.dl
    s.W[:] = s.F
    return -1


@allocating
def settle(link, ends, env, contacts, rows, s, w, counters):
    """Static equilibrium on standing wheels ``rows``: implicit steps from rest, ever longer. Returns as ``newton``.

    Long steps are Newton's method on the static equations; the inertia over the step squared keeps what has
    no stiffness (an unloaded link's roll, a loop that could slide) in place. Friction is viscous at rest
    and fades.
    """
    w.rows[:] = rows
    w.rows[:, 3:9] = 0.0
    h = 1e-3
    s.vdot[:] = 0.0
    for _ in range(400):
        s.v[:] = 0.0
        s.a[:] = 0.0
        s.vdot[:] = 0.0
        failed = newton(link, ends, env, contacts, BACKWARD, h, 0.01 * FORCE, s, w, counters, False)
        if failed >= 0:
            _restore(s, w)
            counters[3] += 1
            h *= 0.25
            if h < 1e-7:
                return failed
            continue
        counters[0] += 1
        moved = 0.0
        for i in range(s.q.shape[0]):
            for k in range(6):
                moved = max(moved, abs(w.x[i, k]))
        if h >= LONG and moved < STILL:
            break
        h = min(2.0 * h, LONG)
    s.v[:] = 0.0
    s.a[:] = 0.0
    s.vdot[:] = 0.0
    residual(link, ends, env, contacts, s, w, slopes(BACKWARD, h), False)
    _settle_rates(link, s, w, slopes(BACKWARD, h))
    s.v[:] = 0.0
    s.a[:] = s.vdot
    s.W[:] = s.F
    return -1


@allocating
def advance(link, ends, env, contacts, method, rows, h, step, s, w, counters):
    """Integrate over ``h`` with the wheels ``rows`` (at its beginning); the mean wrenches are impulse / h.

    Steps of ``step`` at most; one that Newton cannot do is halved. Returns as ``newton``.
    """
    w.impulse[:] = 0.0
    move(rows, 0.0, w.rows)
    speed = chain_speed_of(link, ends, env, s, w)
    dt = h / max(np.ceil(h / step - 1e-9), 1.0)
    done = 0.0
    while done < h * (1.0 - 1e-12):
        dt = min(dt, h - done)
        w.F0[:] = s.F
        w.tally0[:] = s.tally
        move(rows, done + dt, w.rows)
        failed = newton(link, ends, env, contacts, method, dt, FORCE, s, w, counters, True)
        if failed >= 0:
            _restore(s, w)
            s.F[:] = w.F0
            s.tally[:] = w.tally0
            counters[3] += 1
            dt *= 0.5
            if dt < 1e-4 * step:
                return failed
            continue
        counters[0] += 1
        done += dt
        for k in range(s.F.shape[0]):
            for c in range(6):
                W0 = s.W[k, c]
                W1 = auxiliary(method, W0, w.F0[k, c], s.F[k, c])
                w.impulse[k, c] += dt * ((1.0 - method.gamma) * W0 + method.gamma * W1)
                s.W[k, c] = W1
        s.tally[DISSIPATED] += 0.5 * dt * (w.tally0[POWER] + s.tally[POWER])
        s.tally[WORK] += 0.5 * dt * (w.tally0[LOAD_POWER] + s.tally[LOAD_POWER])
        s.tally[COVERED] += 0.5 * dt * (w.tally0[COVERING] + s.tally[COVERING])
        before, speed = speed, chain_speed_of(link, ends, env, s, w)
        s.tally[TRAVEL] += 0.5 * dt * (before + speed)
    return -1


@kernel
def stretching(ends, env, s, i, k):
    """Along the axis ``k`` the forces that stretch link ``i``, N: of its first pin, reversed, and of its last one.

    A pin passes on what teeth and damping do to it: half to either link, all of it at an end.
    """
    n, j = s.q.shape[0], (i + 1) % s.lam.shape[0]
    first, last = i == 0 and not ends.closed, i == n - 1 and not ends.closed
    before = -env.pull[0, k] if first and not ends.first else s.lam[i, k]
    after = env.pull[1, k] if last and not ends.last else s.lam[j, k]
    return before - (1.0 if first else 0.5) * s.load[i, k], after + (1.0 if last else 0.5) * s.load[j, k]


@kernel
def pin_forces(ends, env, s, force):
    """Force of each pin on the link that begins there into ``force`` (nodes, 3); of a last pin, on what holds it."""
    n = s.q.shape[0]
    for i in range(n):
        for k in range(3):
            before, after = stretching(ends, env, s, i, k)
            force[i, k] = -before
            if i == n - 1 and not ends.closed:
                force[n, k] = -after


@kernel
def measure(link, ends, env, s, w, tension, report):
    """Tensions of the links (n), and the report of fmus.track but for the ground force."""
    n, A = s.q.shape[0], w.system.A
    report[0] = s.tally[TRAVEL]
    report[1] = chain_speed_of(link, ends, env, s, w)
    low, high, mean, kinetic, height = np.inf, -np.inf, 0.0, 0.0, 0.0
    for i in range(n):
        pull = 0.0
        for k in range(3):
            before, after = stretching(ends, env, s, i, k)
            pull += 0.5 * (before + after) * A[i, k, 0]
        tension[i] = pull
        low, high, mean = min(low, pull), max(high, pull), mean + pull / n
        kinetic += body.kinetic(link.mass, link.inertia, s.v[i])
        height += s.q[i, 2]
    report[2], report[3], report[4], report[5] = low, mean, high, 0.0
    report[6], report[7], report[8] = kinetic, 0.0, link.mass * env.gravity * height
    report[9], report[10], report[11] = s.tally[CONTACT], s.tally[DISSIPATED], s.tally[WORK]
    report[12] = s.tally[DEPTH]
    heading = carrier(w.rows, env.mount)[3]
    slipping = heading[0] * s.tally[SLIP] + heading[1] * s.tally[SIDESLIP]
    report[16] = slipping / s.tally[LOAD] if s.tally[LOAD] > 0.0 else 0.0
    report[17] = s.tally[COVERED]


@kernel
def pin_motion(link, s, w):
    """Positions and velocities of the pins, seen from the links that begin there, into ``w.pins`` (2, nodes, 3)."""
    n, nodes = s.q.shape[0], w.pins.shape[1]
    for j in range(nodes):
        i = min(j, n - 1)
        A = w.system.A[i]
        body.rotation(s.q[i], A)
        end = -link.half if j < n else link.half
        o1, o2 = s.v[i, 4], s.v[i, 5]
        for k in range(3):
            w.pins[0, j, k] = s.q[i, k] + end * A[k, 0]
            w.pins[1, j, k] = s.v[i, k] + end * (A[k, 1] * o2 - A[k, 2] * o1)


@kernel
def chain_speed_of(link, ends, env, s, w):
    """Speed of the chain along itself, m/s, over what carries the wheels ``w.rows``."""
    pin_motion(link, s, w)
    return chain_speed(w.pins[0], w.pins[1], ends.closed, carrier(w.rows, env.mount))
