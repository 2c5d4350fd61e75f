"""Meshes of the study of the mechanics: lines, chains, corners, frames, rails."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.linalg import splu
from scipy.spatial.transform import Rotation
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from fmus.physics.ancf import beam, cable, cable_engineering, cable_general
from fmus.physics.ancf.cable import Cable
from fmus.physics.arrays import Floats
from tests.validation.ancf import corner, joints, loads, sliding, statics, torsion
from tests.validation.ancf.mesh import Member, Mesh, Support, Tie, in_a_row, nodes

ELASTICITIES: dict[str, Any] = {"small_deformation": cable, "general": cable_general, "engineering": cable_engineering}
Y = [0.0, 1.0, 0.0]

# One beam -----------------------------------------------------------------------------------------------------------


def section(kind: Any, n: int, slender: float, nu: float = 0.0, split: bool = False, stiffer: float = 1.0) -> Any:
    """Square section of height 1/slender of a line with L = 1, EI = ``stiffer`` and mass 1 per length."""
    h = 1.0 / slender
    if kind is beam:
        twist = torsion.factor(h, h)
        return beam.Beam(1.0 / n, h, h, 1.0 / h**2, stiffer * 12.0 / h**4, nu, 1.0, twist, split, 0.0)
    return Cable(1.0 / n, 1.0, 12.0 / h**2, stiffer, 0.0, 0.0)


def line(kind: Any, c: Any, n: int, supports: Any) -> Mesh:
    """Straight line of ``n`` elements from the origin along x; ``supports``: ends and support functions."""
    rows = kind.ROWS // 2
    held = [Support(end, own(rows)) for end, own in supports]
    return Mesh([Member(kind, c, nodes(kind, [0, 0, 0], np.eye(3), c.l, n))], in_a_row(rows, n), held)


def cantilever(kind: Any, n: int, slender: float, **kind_of: Any) -> Mesh:
    """Cantilever of ``n`` elements, clamped at the origin."""
    return line(kind, section(kind, n, slender, **kind_of), n, [((0, 0), joints.clamped)])


def elastica(alpha: float) -> float:
    """w/L of the inextensible cantilever under a dead tip load P, alpha = P L^2/EI, by elliptic integrals."""
    from scipy.optimize import brentq

    def load(p: float) -> float:
        return float((ellipk(p * p) - ellipkinc(np.arcsin(1 / (p * np.sqrt(2))), p * p)) ** 2)

    p = brentq(lambda p: load(p) - alpha, np.sqrt(0.5) + 1e-12, 1 - 1e-12, xtol=1e-15)
    phi = np.arcsin(1 / (p * np.sqrt(2)))
    return float(1 - 2 * (ellipe(p * p) - ellipeinc(phi, p * p)) / np.sqrt(alpha))


def deflection(kind: Any, n: int, alpha: float, slender: float, **kind_of: Any) -> float:
    """w/L of the cantilever under a dead tip load."""
    mesh = cantilever(kind, n, slender, **kind_of)
    mesh = mesh.loaded(loads.point_force(mesh, (n - 1, 1), [0, 0, alpha]))
    return float(mesh.end(statics.equilibrium(mesh, mesh.start(), steps=4), (n - 1, 1))[0, 2])


def opening(kind: Any, n: int, slender: float, **kind_of: Any) -> float:
    """Distance of tip and clamp under the end moment of a full circle (in beams on the director r_z)."""
    mesh = cantilever(kind, n, slender, **kind_of)
    mesh = mesh.loaded(loads.couple(mesh, (n - 1, 1), [0, -2 * np.pi, 0], 3 if kind is beam else 1))
    return float(np.linalg.norm(mesh.end(statics.equilibrium(mesh, mesh.start(), steps=8), (n - 1, 1))[0]))


def round_cable(l: float, area: float, modulus: float, density: float) -> Cable:
    """Cable of circular section, ``l`` m long."""
    return Cable(l, density * area, modulus * area, modulus * area**2 / (4 * np.pi), 0.0, 0.0)


RUBBER = round_cable(0.25, 2.5e-5, 1.6e6, 320.0)


def rotating(
    kind: Any, c: Cable = RUBBER, n: int = 4, spin: float = 4.0, gravity: float = 9.81
) -> tuple[Mesh, Floats, Floats]:
    """Mesh, q and v of a cable pinned at the origin that starts to rotate about y; gravity along -y."""
    mesh = line(kind, c, n, [((0, 0), joints.held)])
    mesh = mesh.loaded(loads.gravity(mesh, [0, -gravity, 0]))
    e = mesh.e0.reshape(n, 2, 2, 3)
    rates = np.zeros_like(e)
    rates[:, :, 0] = np.cross([0, spin, 0], e[:, :, 0])
    return mesh, mesh.start(), velocity(mesh, rates)


def velocity(mesh: Mesh, rates: Floats) -> Floats:
    """Generalised velocities v nearest to given rates of the element coordinates (least squares)."""
    return np.asarray(splu((mesh.B.T @ mesh.B).tocsc()).solve(mesh.B.T @ rates.ravel()))


def angular_momentum(mesh: Mesh, q: Floats, v: Floats) -> Floats:
    """Angular momentum (3,) about the origin."""
    e, p = mesh.coordinates(q).reshape(-1, 3), (mesh.M_e @ (mesh.B @ v)).reshape(-1, 3)
    return np.asarray(np.cross(e, p).sum(axis=0))


def points(mesh: Mesh, q: Floats) -> Floats:
    """Positions (m, 3) of the first node and of every element's second one."""
    e = mesh.coordinates(q)
    return np.array([e[place.start : place.start + 3] for place in (mesh.ends[0], *mesh.ends[1::2])])


# Chains ------------------------------------------------------------------------------------------------------------

PITCH, AREA, SECOND, MODULUS = 0.1524, 0.01516, 2.03e-6, 2e11
STEEL = Cable(PITCH, 7800 * AREA, MODULUS * AREA, MODULUS * SECOND, 0.0, 0.0)
TRACK = STEEL._replace(rhoA=18.0 / PITCH)
SHOE = beam.Beam(PITCH, 0.378, 0.0401, 7800.0, MODULUS, 0.3, 5 / 6, torsion.factor(0.378, 0.0401), True, 0.0)


def rotation(axis: ArrayLike, angle: float) -> Floats:
    """Rotation matrix (3, 3) about an axis by an angle, rad."""
    a = np.asarray(axis, float)
    return np.asarray(Rotation.from_rotvec(angle / np.linalg.norm(a) * a).as_matrix())


def turned(e: Floats, R: Floats) -> Floats:
    """Rotate all vectors of element coordinates ``e`` by ``R``."""
    return np.asarray((e.reshape(-1, 3) @ R.T).reshape(e.shape))


def chain(kind: Any, c: Any, angles: Floats, closed: bool = False, held: bool = False) -> Mesh:
    """Chain of links with pins along y, each at its angle, rad, over x in the plane x, z."""
    n, rows = len(angles), kind.ROWS // 2
    frames = [rotation(Y, -angle) for angle in angles]
    e = np.concatenate([nodes(kind, [0, 0, 0], frame, c.l, 1) for frame in frames])
    for k in range(1, n):
        e[k, [0, rows]] += e[k - 1, rows]
    if not held:
        e[:, [0, rows]] -= e[:, [0, rows]].mean(axis=(0, 1))
    ties = []
    for k in range(n if closed else n - 1):
        j = (k + 1) % n
        pin = joints.pin_beam(Y, frames[k], frames[j]) if kind is beam else joints.pin_cable(Y)
        ties.append(Tie((k, 1), (j, 0), pin))
    return Mesh([Member(kind, c, e)], ties, [Support((0, 0), joints.held(rows))] if held else [])


def folded(mesh: Mesh, about: ArrayLike, angle: float) -> Floats:
    """Coordinates (2, rows, 3) of a pair of elements, the second one turned about their joint by an angle, rad."""
    e = mesh.e0.reshape(2, -1, 3).copy()
    half = e.shape[1] // 2
    middle = e[1, 0].copy()
    e[1, [0, half]] -= middle
    e[1] = turned(e[1], rotation(about, angle))
    e[1, [0, half]] += middle
    return e


def polygon(n: int) -> Floats:
    """Link angles (n,), rad, of a regular closed chain."""
    return np.asarray(2 * np.pi * np.arange(n) / n)


def spinning(n: int, omega: float) -> tuple[Mesh, Floats]:
    """Relative equilibrium of a free steel loop spinning about y: elastic force = omega^2 M q."""
    mesh = chain(cable, TRACK, polygon(n), closed=True)
    e = mesh.e0.reshape(n, 2, -1, 3)
    q = mesh.fit(e)
    turn = mesh.fit(np.cross(Y, e)) - mesh.fit(np.zeros_like(e))
    hold = mesh.M @ turn / np.sqrt(turn @ mesh.M @ turn)  # rotation is a rigid mode: keep the azimuth
    S = omega**2 * mesh.M.toarray()
    for _ in range(12):
        K = mesh.tangent(q).toarray()
        dq = np.linalg.solve(K - S + abs(K).max() * np.outer(hold, hold), S @ q - mesh.force(q))
        q = q + dq
        if abs(dq).max() < 1e-13:
            break
    return mesh, q


# Corners -----------------------------------------------------------------------------------------------------------

# angles of members in degrees about -y, or about another axis
SECTIONS: dict[str, tuple[Any, ...]] = {
    "T": (90.0, -90.0), "L": (90.0,), "V": (40.0,), "Y in space": (120.0, (75.0, [1.0, 0.0, 1.0])),
}  # fmt: skip


def cornered(kind: Any, sections: Sequence[Any], angles: Iterable[Any], n: int, clamped: bool = False) -> Mesh:
    """Rigidly joined members: one along x from the origin, others at its end at ``angles``, see ``SECTIONS``.

    Each has ``n`` elements of its own section; the first may be clamped.
    """
    first, rows = sections[0], kind.ROWS // 2
    parts, ties = [Member(kind, first, nodes(kind, [0, 0, 0], np.eye(3), first.l, n))], in_a_row(rows, n)
    for k, (c, angle) in enumerate(zip(sections[1:], angles, strict=True), start=1):
        degrees, axis = angle if isinstance(angle, tuple) else (angle, [0, -1, 0])
        frame = rotation(axis, np.radians(degrees))
        parts.append(Member(kind, c, nodes(kind, [n * first.l, 0, 0], frame, c.l, n)))
        joint = joints.rigid_beam(np.eye(3), frame) if kind is beam else joints.rigid_cable(frame)
        ties += [Tie((n - 1, 1), (k * n, 0), joint), *in_a_row(rows, n, k * n)]
    return Mesh(parts, ties, [Support((0, 0), joints.clamped(rows))] if clamped else [])


def frame_load(h: float) -> float:
    """Force on the tip of ``frame`` along x and along z, N, for a deflection of 5 mm."""
    return 160.0 * h**4


def frame(kind: Any, n: int, h: float = 0.05, rigid: float = 100.0) -> tuple[Mesh, Floats]:
    """Clamped L-frame, 1 m along x and 0.8 m up, ``n`` elements each, small force (1, 0, 1) at its tip.

    Returns the mesh and Timoshenko's displacements (x, z) of the tip, m. ``rigid``: stiffness of the corner block of
    beams over that of the beams.
    """
    L1, L2, E, shear, P = 1.0, 0.8, 1e7, 5 / 6, frame_load(h)
    A, inertia, kGA = h * h, h**4 / 12, shear * 0.5 * E * h * h
    sections: list[Any]
    if kind is beam:
        twist = torsion.factor(h, h)
        sections = [beam.Beam(L / n, h, h, 1000.0, E, 0.0, shear, twist, False, 0.0) for L in (L1, L2)]
    else:
        kGA = np.inf
        sections = [Cable(L / n, 1.0, E * A, E * inertia, 0.0, 0.0) for L in (L1, L2)]
    mesh = cornered(kind, sections, [90.0], n, clamped=True)
    mesh = mesh.loaded(loads.point_force(mesh, (2 * n - 1, 1), [P, 0, P]))
    if kind is beam and rigid:
        mesh = mesh.sprung(corner.block(mesh, (n - 1, 1), h**3, rigid * E))
    EI, EA = E * inertia, E * A
    # the force P along x bends the column and turns the corner; along z it bends the first member
    corner_turn = P * L2 * L1 / EI - P * L1**2 / (2 * EI)  # of the moment P L2 and of the lift P, about +y
    x = P * L2**3 / (3 * EI) + P * L2 / kGA + corner_turn * L2 + P * L1 / EA
    z = P * L1**3 / (3 * EI) + P * L1 / kGA - P * L2 * L1**2 / (2 * EI) + P * L2 / EA
    return mesh, np.array([x, z])


def frame_tip(kind: Any, n: int, rigid: float = 100.0) -> tuple[Floats, Floats]:
    """Tip displacements (x, z) of ``frame``, m, computed and by Timoshenko."""
    mesh, exact = frame(kind, n, rigid=rigid)
    q, tip = mesh.start(), (2 * n - 1, 1)
    bent = statics.equilibrium(mesh, q, steps=1, tolerance=1e-11)
    return (mesh.end(bent, tip) - mesh.end(q, tip))[0, [0, 2]], exact


# A slider on a rope ------------------------------------------------------------------------------------------------


RAIL = Cable(2.0 / 6, 0.5, 4e3, 2.0, 0.0, 0.0)


def rope(
    slider: str,
    smooth: bool = True,
    c: Cable = RAIL,
    place: float = 0.6,
    mass: float = 1.0,
    gravity: float = 9.81,
    ends: int = 2,
    drag: float = 0.0,
) -> tuple[Any, Any, Any]:
    """Straight rail of six cables ``c`` along x, ``ends`` of it pinned, with a slider at ``place``, m.

    ``slider``: "point", of ``mass`` kg, or "cable", 0.2 m long with that mass. ``smooth``: C2, else C1 at nodes.
    """
    n, is_cable = 6, slider == "cable"
    T = sliding.chain_map(n, c.l, smooth)
    size = T.shape[2]
    X = np.zeros((size + (4 if is_cable else 1), 3))
    if smooth:
        X[:size, 0] = c.l * np.clip(np.arange(size)[:, None] + np.arange(-2, 1), 0, n).mean(axis=1)
    else:
        X[0:size:2, 0], X[1:size:2, 0] = c.l * np.arange(n + 1), 1.0
    X[size, 0] = place
    if is_cable:
        X[size + 1 :, 0] = 1.0, place + 0.2, 1.0
    tail = (c._replace(l=0.2, rhoA=mass / 0.2), sliding.chain_map(1, 0.2))
    unit = np.eye(len(X))
    held = unit[[0, size - (1 if smooth else 2)][:ends]]
    b, maps = sliding.bodies([(c, T), tail] if is_cable else [(c, T)], [] if is_cable else [mass], gravity, held)
    r = sliding.rail(c, maps[0], unit[size], unit[size + 1] if is_cable else None, drag)
    return b, r, sliding.at_rest(r, X, place)
