"""The chain mechanics of the paper, each piece held against something exact or published.

Items are those of the list in the study's table; ``cases(quick)`` leaves the two long chains and the long windows out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from fmus.physics.ancf import (
    beam,
    bspline,
    cable_engineering,
    cable_general,
    cable_small,
    dynamics,
    joints,
    loads,
    sliding,
    statics,
)
from fmus.physics.ancf.mesh import Mesh, Part, Tie, nodes
from fmus.physics.chain_layout import regular_polygon
from orchestrator.pieces.meshes import (
    MODULUS,
    PITCH,
    SECTIONS,
    SHOE,
    STEEL,
    TRACK,
    Y,
    angular_momentum,
    chain,
    corner_section,
    deflection,
    elastica,
    frame_tip,
    line,
    opening,
    polygon,
    rope,
    rotating,
    rotation,
    section,
    spinning,
    turned,
    velocity,
)
from orchestrator.studies import Case
from orchestrator.studies.rods import MASS, G, Rods, of_angles
from orchestrator.studies.tables import Row, checked, failed, missed, of_order, to_markdown, write

__all__ = ["TITLE", "Row", "cases", "failed", "measure", "missed", "to_markdown", "write"]

TITLE = "The chain mechanics of the paper: value, reference, error, order"

Floats = NDArray[np.float64]
CABLES: dict[str, Any] = {
    "small deformation (11)-(15)": cable_small,
    "general (8)-(10)": cable_general,
    "engineering": cable_engineering,
}
CURES: dict[str, dict[str, Any]] = {
    "nu = 0": {"nu": 0.0, "split": False},
    "split nu = 0.3": {"nu": 0.3, "split": True},
}
ALPHAS = (1, 5, 10)
ELEMENTS, STEP = "elements", "step, s"


def measure(case: Case) -> list[Row]:
    """The rows of a case."""
    return [row if row.item else row._replace(item=case.item) for row in case.function(*case.arguments)]


def order_of(sizes: Iterable[float], values: Iterable[float]) -> float:
    """Observed order from three values with steps (or elements) in equal ratio: needs no reference."""
    (a, b), (u, v, w) = list(sizes)[-3:-1], list(values)[-3:]
    if v == w or u == v:
        return math.nan
    return abs(math.log(abs((u - v) / (v - w))) / math.log(a / b))


def rate_of(sizes: Iterable[float], errors: Iterable[float]) -> float:
    """Observed order of errors between the two finest."""
    (a, b), (u, v) = list(sizes)[-2:], list(errors)[-2:]
    return abs(math.log(u / v) / math.log(a / b)) if u > 0.0 and v > 0.0 else math.nan


# 2. The elastica ---------------------------------------------------------------------------------------------------


def _over_elements(
    case: str, ns: tuple[int, ...], values: list[float], reference: float, tolerance: float
) -> Row:
    """The value with the last number of elements, the errors of all, the order of the values among themselves."""
    scale = abs(reference) or 1.0
    series = tuple((float(n), abs(value - reference) / scale) for n, value in zip(ns, values, strict=True))
    order = order_of(ns, values)
    return checked("", case, values[-1], reference, tolerance, order=order, over=ELEMENTS, series=series)


def elastica_of_cables(name: str) -> list[Row]:
    """Tip loads and the circle, L/h = 1000."""
    kind, ns, rows = CABLES[name], (8, 16, 32), []
    for a in ALPHAS:
        case = f"elastica, cable {name}, alpha = {a}, w/L"
        values = [deflection(kind, n, a, 1000) for n in ns]
        rows.append(_over_elements(case, ns, values, elastica(a), 1e-4))
    gaps = [opening(kind, n, 1000) for n in ns]
    return [*rows, _over_elements(f"closed circle, cable {name}, gap/L", ns, gaps, 0.0, 1e-4)]


def elastica_of_beams(cure: str) -> list[Row]:
    """Tip loads and the circle, L/h = 100; short elements are of order 2, long ones converge faster."""
    kind_of, ns, finer, rows = CURES[cure], (8, 16, 32), (16, 32, 64), []
    for a in ALPHAS:
        case = f"elastica, beam {cure}, alpha = {a}, w/L"
        values = [deflection(beam, n, a, 100, **kind_of) for n in ns]
        rows.append(_over_elements(case, ns, values, elastica(a), 2e-3))
    gaps = [opening(beam, n, 100, **kind_of) for n in finer]
    return [*rows, _over_elements(f"closed circle, beam {cure}, gap/L", finer, gaps, 0.0, 2e-3)]


def elastica_order(name: str) -> list[Row]:
    """Values of three meshes among themselves, stockier, so that bending and not the stretch decides."""
    if name in CABLES:
        what, ns, expected, off = f"cable {name}", (4, 8, 16), 4, 0.5
        values = [deflection(CABLES[name], n, 5, 50) for n in ns]
    else:
        what, ns, expected, off = f"beam {name}", (32, 64, 128), 2, 0.2
        values = [deflection(beam, n, 5, 20, **CURES[name]) for n in ns]
    order = order_of(ns, values)
    case = f"elastica, {what}, alpha = 5, L/h = {50 if name in CABLES else 20}, order of {ns} elements"
    return [checked("", case, order, expected, off, abs(order - expected), order=order)]


def elastica_without_cure() -> list[Row]:
    """With nu = 0.3 in every point: converges to EI times (1 - nu)/((1 + nu)(1 - 2 nu))."""
    stiffer, rows = 0.7 / (1.3 * 0.4), []
    for a in ALPHAS:
        found = deflection(beam, 64, a, 100, nu=0.3, split=False)
        case = f"elastica, beam nu = 0.3 without a cure, alpha = {a}, w/L"
        rows += [
            checked("", case, found, elastica(a), math.nan, note="the wrong limit, for information"),
            checked("", f"{case}, with 1.346 EI", found, elastica(a / stiffer), 2e-3),
        ]
    return rows


# 3. Frequencies ----------------------------------------------------------------------------------------------------

ENDS: dict[str, tuple[list[Any], list[float]]] = {
    "cantilever": ([((0, 0), joints.clamped)], [1.87510407, 4.69409113, 7.85475744]),
    "free-free": ([], [4.73004074, 7.85320462, 10.99560784]),
    "pinned": ([((0, 0), joints.held), ((-1, 1), joints.held)], [np.pi, 2 * np.pi, 3 * np.pi]),
}


def _beta(kind: Any, n: int, slender: float, ends: str, **kind_of: Any) -> Floats:
    """The beta L of the first three bending modes; each comes twice, once a plane."""
    supports = [((node % n, end), own) for (node, end), own in ENDS[ends][0]]
    mesh = line(kind, section(kind, n, slender, **kind_of), n, supports)
    K, M = mesh.tangent(mesh.start()).toarray(), mesh.M.toarray()
    squares = 1.0 / eigh(M, K + M, eigvals_only=True)[::-1] - 1.0  # the lowest with the most digits
    return np.asarray(squares[squares > 1.0][:6][::2] ** 0.25)


def frequencies(name: str, ends: str) -> list[Row]:
    """The worst of the first three, against Euler-Bernoulli."""
    slim = name in CABLES
    kind, ns, tolerance = (CABLES[name], (4, 8, 16), 1e-4) if slim else (beam, (8, 16, 32), 2e-3)
    kind_of: dict[str, Any] = {} if slim else CURES[name]
    slender = 1000 if slim else 300
    exact = np.array(ENDS[ends][1])
    found = [_beta(kind, n, slender, ends, **kind_of) for n in ns]
    errors = [np.abs(f / exact - 1.0) for f in found]
    k = int(errors[-1].argmax())
    worst = [float(e[k]) for e in errors]
    what = f"frequencies, {'cable' if slim else 'beam'} {name}, {ends}, beta L of mode {k + 1}"
    series = tuple(zip(map(float, ns), worst, strict=True))
    order = rate_of(ns, worst)
    row = checked(
        "", what, found[-1][k], exact[k], tolerance, worst[-1], order=order, over=ELEMENTS, series=series
    )
    return [of_order(row, 3.7, 4.3) if slim else of_order(row, 1.9, 2.2)]


# 4. The rotating very flexible cable -------------------------------------------------------------------------------

TIMES = (0.2, 0.5, 1.0)
TIPS: dict[str, tuple[list[tuple[float, float, float]], float]] = {
    "engineering": (
        [(0.65482, -0.19797, -0.70458), (-0.69153, -0.71131, -0.09043), (0.65581, 0.04280, 0.66516)],
        2e-5,
    ),
    "general (8)-(10)": (
        [(0.654762, -0.197966, -0.704555), (-0.691538, -0.711404, -0.090278), (0.655978, 0.042512, 0.665746)],
        1e-4,
    ),
    "small deformation (11)-(15)": (
        [(0.663443, -0.198522, -0.691218), (-0.675681, -0.713420, -0.094477), (0.629955, 0.044924, 0.684144)],
        1e-4,
    ),
}


def rotating_cable(name: str) -> list[Row]:
    """Its tip at three times; each row shows the component that is farthest off."""
    mesh, q, v = rotating(CABLES[name])
    steps = 2500
    rows: list[Row] = []
    expected, tolerance = TIPS[name]
    for t, p, _ in dynamics.runge_kutta(mesh, q, v, 1.0 / steps, steps):
        if round(t * steps) in [round(moment * steps) for moment in TIMES]:
            tip, exact = mesh.end(p, (3, 1))[0], np.array(expected[len(rows)])
            k = int(np.abs(tip - exact).argmax())
            what = f"rotating cable, {name}, tip {'xyz'[k]} at {t:g} s, m"
            rows.append(checked("", what, tip[k], exact[k], tolerance, abs(tip[k] - exact[k])))
    return rows


# 5. Released horizontal chain --------------------------------------------------------------------------------------

LINKS = 64


def released_rods() -> list[Row]:
    """Thin rigid rods by Runge-Kutta."""
    hs = (1e-2, 5e-3, 2.5e-3)
    line_of = of_angles(np.zeros(LINKS))
    tips = [float(Rods(line_of, held=True).run(0.5, h).tip()[0]) for h in hs]
    return _over_steps("released chain of 64 rods, tip x at 0.5 s, m", hs, tips, 9.413161, 4)


def released_steel(hs: tuple[float, ...]) -> list[Row]:
    """Steel cables by generalised alpha."""
    mesh = chain(cable_small, STEEL, np.zeros(LINKS), held=True)
    mesh = mesh.loaded(loads.gravity(mesh, [0, 0, -G]))
    tips = []
    for h in hs:
        q, still = mesh.start(), np.zeros(mesh.n)
        for _, now, _ in dynamics.generalized_alpha(mesh, q, still, h, round(0.5 / h)):
            q = now
        tips.append(float(mesh.end(q, (LINKS - 1, 1))[0, 0]))
    return _over_steps("released chain of 64 steel links, tip x at 0.5 s, m", hs, tips, 9.413174, 2)


def _over_steps(
    case: str, hs: tuple[float, ...], values: list[float], reference: float, order: int
) -> list[Row]:
    """The reference has six decimals; the series is that of the values towards their own limit."""
    limit = values[-1] + (values[-1] - values[-2]) / (2**order - 1)
    series = tuple((h, abs(value - limit)) for h, value in zip(hs, values, strict=True))
    off = abs(values[-1] - reference)
    row = checked("", case, values[-1], reference, 2e-5, off, over=STEP, series=series)
    row = of_order(row._replace(order=order_of(hs, values)), order - 0.4, order + 0.4)
    return [row._replace(note=f"{row.note}; the figure's errors are to the values' own limit")]


# 6. Small swings of the hanging chain ------------------------------------------------------------------------------

SWINGS = (1.20242178, 2.76073253, 4.33154065, 5.91226122)  # omega sqrt(L/g) of 64 thin rods


def swings_of_rods() -> list[Row]:
    """From the angular accelerations of links let go a little off the vertical, one at a time."""
    stiff, d = np.empty((LINKS, LINKS)), 1e-5
    for k in range(LINKS):
        ends = []
        for turn in (d, -d):
            angles = np.full(LINKS, -np.pi / 2)
            angles[k] += turn
            ends.append(Rods(of_angles(angles), held=True).release()[:, 4].copy())
        stiff[:, k] = (ends[0] - ends[1]) / (2 * d)  # angles count from x to z, that is about -y
    squares = np.sort(np.linalg.eigvals(stiff).real)[:4]
    return _swings("rods", squares)


def swings_of_steel() -> list[Row]:
    """Linearised about the loaded equilibrium, in the plane."""
    cable = TRACK
    mesh = chain(cable_small, cable, np.full(LINKS, -np.pi / 2), held=True)
    mesh = mesh.loaded(loads.gravity(mesh, [0, 0, -G]))
    q = statics.equilibrium(mesh, mesh.start(), steps=1, tolerance=1e-13).q
    plane = np.flatnonzero(abs(mesh.B[1::3]).sum(axis=0) == 0.0)
    K = mesh.tangent(q).toarray()[np.ix_(plane, plane)]
    M = mesh.M.toarray()[np.ix_(plane, plane)]
    squares = 1.0 / eigh(M, 0.5 * (K + K.T), eigvals_only=True)[::-1][:4]
    return _swings("steel links", squares)


def _swings(what: str, squares: Floats) -> list[Row]:
    found = np.sqrt(squares * LINKS * PITCH / G)
    return [
        checked("", f"hanging chain of 64 {what}, mode {k + 1}, omega sqrt(L/g)", value, SWINGS[k], 1e-4)
        for k, value in enumerate(found)
    ]


# 7. Spinning free loop ---------------------------------------------------------------------------------------------


def spinning_loop() -> list[Row]:
    """Joint force of rods and steel, hoop strain of steel."""
    omega, expected, slope = 5.0, 7112.513, np.pi / LINKS
    loop = Rods(regular_polygon(PITCH, LINKS), closed=True, gravity=0.0)
    loop.turn(np.array([0.0, omega, 0.0]))
    loop.release()
    rods = np.linalg.norm(loop.system.dl[:, :3], axis=1)
    mesh, q = spinning(LINKS, omega)
    e = mesh.coordinates(q)
    residual = (mesh.internal(q) - omega**2 * (mesh.M_e @ e)).reshape(LINKS, 4, 3)
    steel = np.linalg.norm(residual[:, 0], axis=1)
    e = e.reshape(LINKS, 4, 3)
    hoop = np.linalg.norm(e[:, 2] - e[:, 0], axis=1) / PITCH - 1
    inside = expected * np.cos(slope) + TRACK.rhoA * omega**2 * PITCH**2 / 12  # mean along a straight link
    rows = []
    for what, found, exact, tolerance in (
        ("joint force, rods, N", rods, expected, 1e-5),
        ("joint force, steel, N", steel, expected, 1e-5),
        ("hoop strain, steel, = T/EA", hoop, expected / TRACK.EA, 5e-4),
        ("hoop strain, steel, = mean tension of a link/EA", hoop, inside / TRACK.EA, 1e-5),
    ):
        k = int(np.abs(found - exact).argmax())
        rows.append(checked("", f"spinning loop of 64 links, {what}", found[k], exact, tolerance))
    return rows


# 8. Folded falling chain -------------------------------------------------------------------------------------------


def folded_chain(links: int) -> list[Row]:
    """Pinned at one end, folded once, let go at the other; no link turns more than 0.05 rad in a step."""
    n, quarter = links // 2, np.pi / 2
    rods = Rods(of_angles(np.concatenate([np.full(n, -quarter), [0.0], np.full(n, quarter)])), held=True)
    length = links * PITCH
    scale, start = math.sqrt(2 * length / G), rods.energy()
    t, drop, drift = [0.0], [0.0], 0.0
    while t[-1] < 0.9 * scale and drop[-1] >= 0.98 * max(drop):
        h = min(2e-3 * scale, 0.05 / max(float(np.abs(rods.v[:, 4]).max()), 1e-9))
        rods.step(h)
        t.append(t[-1] + h)
        drop.append(-float(rods.tip()[2]))
        drift = max(drift, abs(rods.energy() - start))
    times, drops = np.array(t) / scale, np.array(drop) / length
    k = int(drops.argmax())
    top = float(
        np.polynomial.Polynomial.fit(times[k - 1 : k + 2], drops[k - 1 : k + 2], 2).deriv().roots()[0]
    )
    half = float(np.interp(0.5, drops[:k], times[:k])) * math.sqrt(2.0)
    ahead = float((drops[1:k] / times[1:k] ** 2).min())
    name = f"folded chain of {links} rods"
    return [
        checked("", f"{name}, time of the largest drop / sqrt(2 L/g)", top, 0.8472, 0.01),
        checked("", f"{name}, time to drop L/2 / sqrt(L/g)", half, 0.948, 0.005),
        checked(
            "", f"{name}, least drop / that of free fall", ahead, 1.0, 0.0, max(0.0, 1.0 - ahead),
            note="above 1: ahead at every instant",
        ),
        checked("", f"{name}, energy drift / m g L", drift / (links * MASS * G * length), 0.0, 1e-3),
    ]  # fmt: skip


# 9. The sliding joint ----------------------------------------------------------------------------------------------


def sliding_joint(slider: str) -> list[Row]:
    """Five seconds without friction over the nodes of a flexible rail."""
    b, r, s = rope(slider)
    lost = sliding.removed(b, r, s.X, s.w)
    start, worst, closed, kinetic = sum(sliding.energy(b, s)), 0.0, 0.0, 0.0
    for _ in range(2500):
        s = sliding.step(b, r, s, 2e-3)
        parts = sliding.energy(b, s)
        worst, kinetic = max(worst, abs(sum(parts) - start)), max(kinetic, parts[0])
        closed = max(closed, float(np.abs(sliding.constraint(r, s.X, s.w)).max()))
    name = f"{slider} on a flexible rail, 5 s"
    return [
        checked("", f"{name}, energy change / largest kinetic energy", worst / kinetic, 0.0, 1e-6),
        checked("", f"{name}, constraint, m", closed, 0.0, 1e-10),
        checked("", f"{name}, degrees of freedom removed", lost, 4 if slider == "cable" else 2, 0.0),
    ]


# 10. Pins ----------------------------------------------------------------------------------------------------------


def pin_counts() -> list[Row]:
    """Ranks of what a pin eliminates, and degrees of freedom of whole tracks."""
    rows = []
    kinds: tuple[tuple[str, Any, Any, Any, int], ...] = (
        ("cable", cable_small, TRACK, joints.pin_cable(Y), 4),
        ("beam", beam, SHOE, joints.pin_beam(Y), 6),
    )
    for name, kind, c, pin, rank in kinds:
        ties = [Tie((0, 1), (1, 0), pin)]
        mesh = Mesh([Part(kind, c, nodes(kind, [0, 0, 0], np.eye(3), c.l, 2))], ties)
        found = int(np.linalg.matrix_rank(mesh.constraints(ties)))
        rows.append(checked("", f"pin of the {name}, rank of its equations", found, rank, 0.0))
        own = 24 if kind is beam else 12
        for closed, pins in ((True, LINKS), (False, LINKS - 1)):
            track = chain(kind, c, polygon(LINKS) if closed else np.zeros(LINKS), closed)
            what = f"{'closed' if closed else 'open'} track of 64 {name}s, degrees of freedom"
            rows.append(checked("", what, track.n, LINKS * own - pins * rank, 0.0))
    return rows


def pin_turns(name: str) -> list[Row]:
    """Two links, the second turned about the pin through 360 degrees: largest strain energy over EA l."""
    kind, c = (beam, SHOE) if name == "beam" else (cable_small, TRACK)
    mesh = chain(kind, c, np.zeros(2))
    e, half = mesh.e0.reshape(2, kind.ROWS, 3), kind.ROWS // 2
    middle = e[1, 0].copy()
    size, worst, misfit = MODULUS * 0.01516 * PITCH, 0.0, 0.0
    for angle in np.radians(np.arange(0, 361, 15)):
        x = e.copy()
        x[1, [0, half]] -= middle
        x[1] = turned(x[1], rotation(Y, angle))
        x[1, [0, half]] += middle
        x = turned(x, rotation([3, -1, 2] if kind is beam else Y, 1.0))
        q = mesh.fit(x)
        misfit = max(misfit, float(abs(mesh.coordinates(q) - x.ravel()).max()))
        worst = max(worst, mesh.energy(q) / size)
    return [
        checked("", f"pin of the {name} through 360 degrees, strain energy / EA l", worst, 0.0, 1e-24),
        checked("", f"pin of the {name} through 360 degrees, misfit of the joint, m", misfit, 0.0, 1e-14),
    ]


# 11. Corners -------------------------------------------------------------------------------------------------------


def sections() -> list[Row]:
    """T, L and V turned as one body: strain energy over EA, and how far the joints are off."""
    rows = []
    kinds: tuple[tuple[str, Any, Any, tuple[Any, ...]], ...] = (
        ("beams", beam, SHOE, ([0, 1, 0], [1, 2, 3], [1, 0, 0])),
        ("cables in their plane", cable_small, TRACK, (Y,)),
    )
    for name, kind, c, axes in kinds:
        for shape in SECTIONS:
            mesh, energy, misfit = corner_section(kind, c, shape), 0.0, 0.0
            for k, axis in enumerate(axes):
                x = turned(mesh.e0, rotation(axis, k + 1.0))
                q = mesh.fit(x)
                misfit = max(misfit, float(abs(mesh.coordinates(q) - x).max()))
                energy = max(energy, mesh.energy(q) / (MODULUS * 0.01516))
            what = f"{shape} section of {name} turned as one body"
            rows += [
                checked("", f"{what}, strain energy / EA", energy, 0.0, 1e-24),
                checked("", f"{what}, misfit, m", misfit, 0.0, 1e-14),
            ]
    return rows


def l_frame(name: str) -> list[Row]:
    """Tip deflection of an L-frame at L/h = 20, nu = 0, against Timoshenko."""
    kind, ns = (beam, (6, 12, 24)) if name == "beam" else (CABLES[name], (1, 2, 4))
    found = [frame_tip(kind, n) for n in ns]
    rows = []
    for k, axis in enumerate("xz"):
        values = [float(u[k]) for u, _ in found]
        exact = float(found[-1][1][k])
        errors: tuple[tuple[float, float], ...] = ()
        order = math.nan
        if kind is beam:  # a cable of one element is exact but for its being bent a little
            errors = tuple((float(n), abs(v / exact - 1)) for n, v in zip(ns, values, strict=True))
            order = order_of(ns, values)
        kind_of = "beams with a rigid corner" if kind is beam else f"cables {name}"
        what = f"L-frame of {kind_of}, tip {axis}, m"
        rows.append(checked("", what, values[-1], exact, 5e-3, order=order, over=ELEMENTS, series=errors))
    if kind is beam:
        u, exact_u = frame_tip(beam, 24, rigid=0.0)
        what = "L-frame of beams, gradient transformation alone, tip x, m"
        rows.append(
            checked("", what, u[0], exact_u[0], math.nan, note="yields in the corner, for information")
        )
    return rows


# 12. Splines -------------------------------------------------------------------------------------------------------

DEMANDS = {  # element, joint: equations, the knot that makes it, missing with the nearest weaker knot
    ("cable", "spherical"): (3, 3, 0),
    ("cable", "pin"): (4, None, 1),
    ("cable", "sliding"): (4, None, 4),
    ("cable", "rigid"): (6, None, 3),
    ("cable", "smooth"): (6, 2, 0),
    ("cable", "curvature"): (9, 1, 0),
    ("beam", "spherical"): (3, None, 3),
    ("beam", "pin"): (6, None, 6),
    ("beam", "sliding"): (4, None, 4),
    ("beam", "rigid"): (12, None, 12),
    ("beam", "smooth"): (18, 2, 0),
    ("beam", "curvature"): (27, 1, 0),
}


def splines() -> list[Row]:
    """To cable coordinates and back, and again; both ways relative to the largest coordinate."""
    from scipy.interpolate import BSpline

    rng, there, back = np.random.default_rng(11), 0.0, 0.0
    for inner in ([], [1], [2, 1, 1], [3, 1, 2], [4, 2, 3, 1], [1] * 6):
        spots = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 1.5, len(inner) + 1))])
        knots = np.repeat(spots, [4, *inner, 4])
        spline = BSpline(knots, rng.standard_normal((len(knots) - 4, 3)), 3)
        e, l = bspline.to_cable(spline)
        again = bspline.from_cable(e, l, np.array(inner, dtype=np.int64))
        back = max(back, float(np.abs(again.c - spline.c).max() / max(1.0, np.abs(spline.c).max())))
        there = max(there, float(np.abs(bspline.to_cable(again)[0] - e).max() / np.abs(e).max()))
    rows = [
        checked("", "control points of B-splines, to cables and back", back, 0.0, 1e-14),
        checked("", "cable coordinates, to B-splines and back", there, 0.0, 1e-14),
        checked("", "control points of one bicubic patch", bspline.patch_points(8, 8), 16, 0.0),
    ]
    for m in range(5):
        found = int(np.linalg.matrix_rank(bspline.knot_rows(m))) if m < 4 else len(bspline.knot_rows(m))
        rows.append(
            checked("", f"equations that a knot of multiplicity {m} imposes", found, 3 * (4 - m), 0.0)
        )
    for d in bspline.table():
        equations, knot, missing = DEMANDS[d.element, d.joint]
        made = f"knot {d.knot}" if d.knot else f"no knot; {d.missing} missing with {d.weaker}"
        same = (d.knot, d.missing) == (knot, missing)
        row = checked(
            "", f"equations of the joint '{d.joint}' of {d.element}s", d.equations, equations, 0.0, note=made
        )
        rows.append(row._replace(ok=bool(row.ok) and same))
    return rows


# 13. Drift of an undamped free chain -------------------------------------------------------------------------------

ZIGZAG = 0.3 * np.cos(2.2 * np.arange(8))
SPIN = np.array([0.2, 2.0, 0.3])  # rad/s, rigid
EXPLICIT, IMPLICIT = "Runge-Kutta", "generalised alpha"
ORDERS = {EXPLICIT: 4, IMPLICIT: 2}
WEAK = 2e5  # Pa: links whose own modes an explicit method can follow


def _drift_rows(
    name: str, hs: tuple[float, ...], lost: list[float], turned: list[float], order: int, time: float
) -> list[Row]:
    """Runge-Kutta of order 4 loses energy at order 5 where the motion is slow."""
    rows = []
    for what, errors, tolerance in (("energy", lost, 1e-4), ("angular momentum", turned, 1e-5)):
        series = tuple(zip(hs, errors, strict=True))
        row = checked(
            "", f"free chain, {name}, {what} drift over {time:g} s", errors[-1], 0.0, tolerance,
            order=rate_of(hs, errors), over=STEP, series=series,
        )  # fmt: skip
        rows.append(of_order(row, order - 0.4, order + (0.4 if order == 2 else 1.5)))
    return rows


def drift_of_rods(integrator: str, hs: tuple[float, ...], time: float) -> list[Row]:
    """All three components."""
    lost, turned_ = [], []
    pins = of_angles(ZIGZAG)
    for h in hs:
        rods = Rods(pins - pins.mean(axis=0), gravity=0.0)
        rods.turn(SPIN)
        energy, L = rods.energy(), rods.angular_momentum()
        a = b = 0.0
        for _ in rods.steps(time, h, integrator):
            a = max(a, abs(rods.energy() / energy - 1.0))
            b = max(b, float(np.abs(rods.angular_momentum() - L).max() / np.linalg.norm(L)))
        lost.append(a)
        turned_.append(b)
    return _drift_rows(f"rods, {integrator}", hs, lost, turned_, ORDERS[integrator], time)


def drift_of_mesh(what: str, integrator: str, hs: tuple[float, ...], time: float) -> list[Row]:
    """Cables about the pin axis alone; beams about all axes."""
    cable = STEEL if what == "steel cables" else STEEL._replace(EA=WEAK * 0.01516, EI=WEAK * 2.03e-6)
    if what == "soft beams":
        mesh = chain(beam, SHOE._replace(E=WEAK), ZIGZAG[:3])
        spin, axes = SPIN, slice(0, 3)
    else:
        mesh = chain(cable_small, cable, ZIGZAG)
        spin, axes = np.array([0.0, 2.0, 0.0]), slice(1, 2)
    method = dynamics.runge_kutta if integrator == EXPLICIT else dynamics.generalized_alpha
    options: dict[str, Any] = {} if integrator == EXPLICIT else {"tolerance": 1e-12, "radius": 0.8}
    q0 = mesh.start()
    v0 = velocity(mesh, np.cross(spin, mesh.e0.reshape(-1, 3)))
    energy, L = mesh.energy(q0) + mesh.kinetic(v0), angular_momentum(mesh, q0, v0)
    lost, turned_ = [], []
    for h in hs:
        a = b = 0.0
        for k, (_, q, v) in enumerate(method(mesh, q0, v0, h, round(time / h), **options)):
            if k % 10 == 9:
                a = max(a, abs((mesh.energy(q) + mesh.kinetic(v)) / energy - 1.0))
                off = np.abs(angular_momentum(mesh, q, v) - L)[axes].max()
                b = max(b, float(off / np.linalg.norm(L)))
        lost.append(a)
        turned_.append(b)
    return _drift_rows(f"{what}, {integrator}", hs, lost, turned_, ORDERS[integrator], time)


# All of it ---------------------------------------------------------------------------------------------------------


def cases(quick: bool) -> list[Case]:
    """What is measured; ``quick`` stays below five minutes on two cores."""
    window = 2.0 if quick else 10.0
    coarse = (2.5e-3, 1.25e-3, 6.25e-4)
    found = [Case("2", f"elastica, cable {name}", elastica_of_cables, (name,), 3) for name in CABLES]
    found += [Case("2", f"elastica, beam {cure}", elastica_of_beams, (cure,), 5) for cure in CURES]
    found += [
        Case("2", f"order of the elastica, {name}", elastica_order, (name,), 3) for name in (*CABLES, *CURES)
    ]
    found.append(Case("2", "elastica without a cure", elastica_without_cure, (), 5))
    found += [
        Case("3", f"frequencies, {name}, {ends}", frequencies, (name, ends), 2)
        for name in (*CABLES, *CURES)
        for ends in ENDS
    ]
    found += [Case("4", f"rotating cable, {name}", rotating_cable, (name,), 8) for name in CABLES]
    found.append(Case("5", "released rods", released_rods, (), 2))
    found.append(Case("5", "released steel", released_steel, ((1e-3, 5e-4, 2.5e-4),), 60))
    found.append(Case("6", "swings of rods", swings_of_rods, (), 2))
    found.append(Case("6", "swings of steel", swings_of_steel, (), 2))
    found.append(Case("7", "spinning loop", spinning_loop, (), 5))
    for links in (17, 33) if quick else (17, 33, 65, 129):
        found.append(Case("8", f"folded chain of {links}", folded_chain, (links,), links / 4))
    found += [Case("9", f"sliding {slider}", sliding_joint, (slider,), 5) for slider in ("point", "cable")]
    found.append(Case("10", "pins counted", pin_counts, (), 2))
    found += [Case("10", f"pin of the {name} turned", pin_turns, (name,)) for name in ("cable", "beam")]
    found.append(Case("11", "sections", sections))
    found += [
        Case("11", f"L-frame, {name}", l_frame, (name,), 2)
        for name in ("beam", "small deformation (11)-(15)", "general (8)-(10)")
    ]
    found.append(Case("12", "splines", splines))
    for what, integrator, hs in (
        ("rods", IMPLICIT, (5e-3, 2.5e-3, 1.25e-3)),
        ("rods", EXPLICIT, (2e-2, 1e-2, 5e-3)),
        ("steel cables", IMPLICIT, coarse),
        ("soft cables", IMPLICIT, coarse),
        ("soft cables", EXPLICIT, (4e-3, 2e-3, 1e-3)),
        ("soft beams", IMPLICIT, coarse),
        ("soft beams", EXPLICIT, (1e-3, 5e-4, 2.5e-4)),
    ):
        name, long = f"drift of {what}, {integrator}", 10 * window if integrator == IMPLICIT else window
        if what == "rods":
            found.append(Case("13", name, drift_of_rods, (integrator, hs, window), long))
        else:
            found.append(Case("13", name, drift_of_mesh, (what, integrator, hs, window), long))
    return found
