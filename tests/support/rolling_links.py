"""Rocking of the links of a ground run under rolling wheels: plane statics, independent code.

A run of rigid links hangs from the sprocket's tangent, lies under five loaded wheels and is pulled by the strand to the
idler. Pads press on a ground that is a spring at two Gauss points of each link, wheels on a spring spread along it;
neither pulls. The equilibria while the run advances by one pitch give a motion per length of chain, at any speed.
Inertia, damping and the ripple of the sprocket are left out. x forward from the first wheel, z up from the ground.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

PITCH, FACE, LINK_WEIGHT, STIFFNESS = 0.1524, 0.029, 18.02 * 9.81, 2e6  # m, m, N, N/m per link
WHEEL, WHEELS = 0.305, np.array([0.0, -0.667, -1.334, -2.001, -2.667])  # m: radius; places
# (x, z, radius of the pins on it) of sprocket and idler, 30 mm below the drawing, as the vehicle settles
SPROCKET, IDLER = (0.655, 0.548, 0.2426), (-3.345, 0.428, 0.291)
LINKS, PHASES = 27, 32  # links from the sprocket's tangent to that of the idler; positions per pitch
SUNK = WHEEL + 2.0 * FACE - 0.016  # m, height of a wheel's centre above the ground: start of the iteration


class Rocking(NamedTuple):
    """Pads on the ground over a motion by one pitch."""

    x: np.ndarray  # (m,) forward of the first wheel, m
    share: np.ndarray  # (m,) share of the load
    ahead: np.ndarray  # (m,) backward speed relative to the middle of its link, over the speed of the chain

    @property
    def mean(self) -> float:
        return float(self.share @ self.ahead)

    @property
    def spread(self) -> float:
        """Root mean square about the mean, weighted by the load."""
        return float(np.sqrt(self.share @ (self.ahead - self.mean) ** 2))


def rocking(loads, pull: float, thrust: float, face: float = FACE) -> Rocking:
    """Motion of the pads under ``loads`` (5,) of the wheels, N, and the rear strand's ``pull``, N.

    ``thrust``: force of the ground over its load; ``face``: depth of the pads below the pins, m. Raises ArithmeticError
    if no equilibrium is found.
    """
    table = _points(face)
    slope, start = _tangent(SPROCKET)
    rear, _ = _tangent(IDLER)
    end = pull * np.array([-np.cos(rear), np.sin(rear)])
    y = np.concatenate([np.full(LINKS, np.pi), np.full(5, SUNK)])
    y[:4] += slope
    y[23:LINKS] -= rear
    for part in (0.0, 0.5):  # the thrust is applied in steps
        y, _, _ = _equilibrium(y, start, table, np.asarray(loads), end, part * thrust)
    places, loads_of_pads = [], []
    for phase in range(PHASES):
        first = start - PITCH * phase / PHASES * np.array([np.cos(slope), np.sin(slope)])
        y, x, load = _equilibrium(y, first, table, np.asarray(loads), end, thrust)
        places.append(x[:-1].reshape(LINKS, -1, 2)[:, [0, 1, -1], 0])
        loads_of_pads.append(load[:-1].reshape(LINKS, -1)[:, :2])
    # the link one place further back is the same link one pitch later
    x, load = (np.swapaxes(np.array(rows), 0, 1).reshape(LINKS * PHASES, -1) for rows in (places, loads_of_pads))
    back = -np.gradient(x, PITCH / PHASES, axis=0)
    x, load, back = (values[PHASES:-PHASES] for values in (x, load, back))
    share = load / load.sum()
    return Rocking(x[:, :2].ravel(), share.ravel(), (back[:, :2] - back[:, 2:]).ravel())


class _Points(NamedTuple):
    """Points of links: two pads, contact points of wheels, the middle; and the end of the run."""

    along: np.ndarray  # (points, links) lever along each link, m
    out: np.ndarray  # (points, links) lever along its outer normal, m
    share: np.ndarray  # share of a link's stiffness
    pad: np.ndarray
    rim: np.ndarray
    middle: np.ndarray


def _points(face):
    g, w = np.polynomial.legendre.leggauss(16)
    pads = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
    along = PITCH * np.concatenate([pads, 0.5 * (1.0 + g), [0.5]])
    out = np.concatenate([[face] * 2, [-FACE] * 16, [0.0]])
    share = np.concatenate([[0.5] * 2, 0.5 * w, [0.0]])
    kind = np.array([0] * 2 + [1] * 16 + [2])
    link = np.append(np.repeat(np.arange(LINKS), len(along)), LINKS - 1)[:, None]
    along, out, share, kind = (
        np.append(np.tile(values, LINKS), last)
        for values, last in ((along, PITCH), (out, 0.0), (share, 0.0), (kind, 3))
    )
    before, this_link = np.arange(LINKS) < link, np.arange(LINKS) == link
    return _Points(
        PITCH * before + along[:, None] * this_link, out[:, None] * this_link, share, kind == 0, kind == 1, kind == 2
    )


def _tangent(wheel):
    """Slope of the strand from an end wheel to a sprocket or an idler, and its point of tangency."""
    x, z, radius = wheel
    dx, dz = abs(x if x > 0.0 else x - WHEELS[-1]), z - SUNK
    slope = np.arctan2(dz, dx) + np.arcsin((WHEEL + FACE - 0.01 - radius) / np.hypot(dx, dz))
    return slope, np.array([x, z]) + radius * np.array([np.sin(slope), -np.cos(slope)])


def _equilibrium(y, first, table, loads, end, thrust):
    """Angles of the links and heights of the wheels by Newton's method; places of the points and loads."""
    state = _residual(y, first, table, loads, end, thrust)
    for _ in range(100):
        r, slope, x, load = state
        size = np.linalg.norm(r)
        if size < 1e-4:
            return y, x, load
        move = -np.linalg.solve(slope, r)
        part = min(1.0, 0.1 / np.abs(move).max())
        for _ in range(10):
            state = _residual(y + part * move, first, table, loads, end, thrust)
            if np.linalg.norm(state[0]) < size:
                break
            part *= 0.5
        y = y + part * move
    raise ArithmeticError(f"no equilibrium of the run: {size:.3g} is left")


def _residual(y, first, table, loads, end, thrust):
    """Generalised forces on angles and wheels (N m, N), their derivative, places of points, loads of pads."""
    angle, height = y[:LINKS], y[LINKS:]
    e, n = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    x = first + (table.along @ e.T + table.out @ n.T)
    lever = np.stack([table.along * n[k] - table.out * e[k] for k in range(2)], axis=1)  # derivative of x by the angles
    f, k = np.zeros_like(x), np.zeros((len(x), 2, 2))
    r, slope = np.zeros(len(y)), np.zeros((len(y), len(y)))
    load = np.where(table.pad, table.share * STIFFNESS * np.maximum(-x[:, 1], 0.0), 0.0)
    f[:, 0], f[:, 1] = thrust * load, load
    k[load > 0.0, :, 1] = -0.5 * STIFFNESS * np.array([thrust, 1.0])
    for w in range(5):
        d = x - [WHEELS[w], height[w]]
        rho = np.hypot(*d.T)
        on = table.rim & (rho < WHEEL)
        u, stiff = d[on] / rho[on, None], STIFFNESS * table.share[on]
        push = stiff * (WHEEL - rho[on])
        both = u[:, :, None] * u[:, None]
        turned = -stiff[:, None, None] * both + (push / rho[on])[:, None, None] * (np.eye(2) - both)
        f[on] += push[:, None] * u
        k[on] += turned
        r[LINKS + w] = -push @ u[:, 1] - loads[w]
        slope[LINKS + w, :LINKS] = slope[:LINKS, LINKS + w] = -np.einsum("pin,pi->n", lever[on], turned[:, :, 1])
        slope[LINKS + w, LINKS + w] = turned[:, 1, 1].sum()
    f[table.middle, 1] -= LINK_WEIGHT
    f[-1] += end
    r[:LINKS] = np.einsum("pin,pi->n", lever, f)
    on = np.flatnonzero(k.any(axis=(1, 2)))
    slope[:LINKS, :LINKS] = np.einsum("pin,pij,pjm->nm", lever[on], k[on], lever[on], optimize=True)
    slope[np.arange(LINKS), np.arange(LINKS)] -= (table.along * (f @ e) + table.out * (f @ n)).sum(axis=0)
    return r, slope, x, load
