"""Elements, joints, corners and splines, compared with exact and published figures."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import eigh

from fmus.physics.ancf import beam, cable, cable_engineering, cable_general
from fmus.physics.arrays import Floats
from orchestrator.studies import Case, Row
from tests.validation import meshes
from tests.validation.ancf import bspline, dynamics, joints, sliding
from tests.validation.ancf.mesh import Member, Mesh, Tie, nodes
from tests.validation.compared import checked, of_order, order_of, rate_of

CABLES: dict[str, Any] = {
    "small deformation (11)-(15)": cable,
    "general (8)-(10)": cable_general,
    "engineering": cable_engineering,
}
CURES: dict[str, dict[str, Any]] = {"nu = 0": {"nu": 0.0, "split": False}, "split nu = 0.3": {"nu": 0.3, "split": True}}
ALPHAS = (1, 5, 10)
LINKS = 64
ELEMENTS = "elements"  # abscissa of a series of errors

# 2. The elastica ---------------------------------------------------------------------------------------------------


def _over_elements(case: str, ns: tuple[int, ...], values: list[float], reference: float, tolerance: float) -> Row:
    """Row of the value with most elements, with all errors and the order observed among the values."""
    scale = abs(reference) or 1.0
    series = tuple((float(n), abs(value - reference) / scale) for n, value in zip(ns, values, strict=True))
    return checked("", case, values[-1], reference, tolerance, order=order_of(ns, values), over=ELEMENTS, series=series)


def _element(name: str) -> tuple[str, Any, dict[str, Any]]:
    """Return description, kind and options of a cable or a beam."""
    return (f"cable {name}", CABLES[name], {}) if name in CABLES else (f"beam {name}", beam, CURES[name])


def elastica_of(name: str) -> list[Row]:
    """Elastica under tip loads and as a circle; beams have order 2 with short elements, else more."""
    what, kind, kind_of = _element(name)
    slender, finer, tolerance = (1000, (8, 16, 32), 1e-4) if name in CABLES else (100, (16, 32, 64), 2e-3)
    ns, rows = (8, 16, 32), []
    for a in ALPHAS:
        values = [meshes.deflection(kind, n, a, slender, **kind_of) for n in ns]
        rows.append(_over_elements(f"elastica, {what}, alpha = {a}, w/L", ns, values, meshes.elastica(a), tolerance))
    gaps = [meshes.opening(kind, n, slender, **kind_of) for n in finer]
    return [*rows, _over_elements(f"closed circle, {what}, gap/L", finer, gaps, 0.0, tolerance)]


def elastica_order(name: str) -> list[Row]:
    """Order observed on three meshes of a stockier cantilever, whose error comes from bending."""
    what, kind, kind_of = _element(name)
    slender, ns, expected, off = (50, (4, 8, 16), 4, 0.5) if name in CABLES else (20, (32, 64, 128), 2, 0.2)
    order = order_of(ns, [meshes.deflection(kind, n, 5, slender, **kind_of) for n in ns])
    case = f"elastica, {what}, alpha = 5, L/h = {slender}, order of {ns} elements"
    row = checked("", case, order, expected, off, abs(order - expected), order=order)
    return [of_order(row, expected - 0.2, expected + off)]


def elastica_without_cure() -> list[Row]:
    """Beam with nu = 0.3 at all points: converges to EI times (1 - nu)/((1 + nu)(1 - 2 nu))."""
    stiffer, rows = 0.7 / (1.3 * 0.4), []
    for a in ALPHAS:
        tip_deflection = meshes.deflection(beam, 64, a, 100, nu=0.3, split=False)
        case = f"elastica, beam nu = 0.3 without a cure, alpha = {a}, w/L"
        rows += [
            checked("", case, tip_deflection, meshes.elastica(a), math.nan, note="the wrong limit, for information"),
            checked("", f"{case}, with 1.346 EI", tip_deflection, meshes.elastica(a / stiffer), 2e-3),
        ]
    return rows


# 3. Frequencies ----------------------------------------------------------------------------------------------------

ENDS: dict[str, tuple[list[Any], list[float]]] = {
    "cantilever": ([((0, 0), joints.clamped)], [1.87510407, 4.69409113, 7.85475744]),
    "free-free": ([], [4.73004074, 7.85320462, 10.99560784]),
    "pinned": ([((0, 0), joints.held), ((-1, 1), joints.held)], [np.pi, 2 * np.pi, 3 * np.pi]),
}


def beta(kind: Any, n: int, slender: float, ends: str, **kind_of: Any) -> Floats:
    """The beta L of the first three bending modes; each occurs twice, once per plane."""
    supports = [((node % n, end), own) for (node, end), own in ENDS[ends][0]]
    mesh = meshes.line(kind, meshes.section(kind, n, slender, **kind_of), n, supports)
    K, M = mesh.tangent(mesh.start()).toarray(), mesh.M.toarray()
    squares = 1.0 / eigh(M, K + M, eigvals_only=True)[::-1] - 1.0  # lowest modes with the most digits
    bending = squares[squares > 1.0][:6]
    np.testing.assert_allclose(bending[::2], bending[1::2], rtol=1e-3)
    return np.asarray(bending[::2] ** 0.25)


def frequencies(name: str, ends: str) -> list[Row]:
    """Row of the largest error of the first three frequencies, relative to Euler-Bernoulli."""
    element, kind, kind_of = _element(name)
    slim = name in CABLES
    slender, ns, tolerance = (1000, (4, 8, 16), 1e-4) if slim else (300, (12, 24, 48), 1e-3)
    exact = np.array(ENDS[ends][1])
    betas = [beta(kind, n, slender, ends, **kind_of) for n in ns]
    errors = [np.abs(f / exact - 1.0) for f in betas]
    k = int(errors[-1].argmax())
    worst = [float(e[k]) for e in errors]
    row = checked(
        "", f"frequencies, {element}, {ends}, beta L of mode {k + 1}", betas[-1][k], exact[k], tolerance, worst[-1],
        order=rate_of(ns, worst), over=ELEMENTS, series=tuple(zip(map(float, ns), worst, strict=True)),
    )  # fmt: skip
    return [of_order(row, 3.7, 4.3) if slim else of_order(row, 1.9, 2.2)]


# 4. The rotating very flexible cable -------------------------------------------------------------------------------

TIMES = (0.2, 0.5, 1.0)
TIPS: dict[str, tuple[list[tuple[float, float, float]], float]] = {
    "engineering": ([(0.65482, -0.19797, -0.70458), (-0.69153, -0.71131, -0.09043), (0.65581, 0.04280, 0.66516)], 2e-5),
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
    """Rows of the rotating cable's tip at three times; each shows the component with the largest error."""
    mesh, q, v = meshes.rotating(CABLES[name])
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


# 9. The sliding joint ----------------------------------------------------------------------------------------------


def sliding_joint(slider: str, smooth: bool) -> list[Row]:
    """Rows of five frictionless seconds of a slider that passes the nodes of a flexible rail."""
    b, r, s = meshes.rope(slider, smooth)
    lost = sliding.removed(b, r, s.X, s.w)
    start, worst, closed, kinetic, rate, places = sum(sliding.energy(b, s)), 0.0, 0.0, 0.0, 0.0, set()
    for _ in range(2500):
        s = sliding.step(b, r, s, 2e-3)
        parts = sliding.energy(b, s)
        worst, kinetic = max(worst, abs(sum(parts) - start)), max(kinetic, parts[0])
        closed = max(closed, float(np.abs(sliding.constraint(r, s.X, s.w)).max()))
        rate = max(rate, float(np.abs(sliding.rates(b, r, s)[1]).max()))
        places.add(sliding.element(r, s.w[0]))
    name = f"{slider} on a flexible rail{'' if smooth else ' that is C1'}, 5 s"
    return [
        checked("", f"{name}, energy change / largest kinetic energy", worst / kinetic, 0.0, 1e-9),
        checked("", f"{name}, constraint, m", closed, 0.0, 1e-12),
        checked("", f"{name}, rate of the constraint, m/s", rate, 0.0, 5e-3, note="order 2, at speeds of 1 m/s"),
        checked("", f"{name}, elements passed", len(places), 3, 0.0, max(0, 3 - len(places)), note="3 at least"),
        checked("", f"{name}, degrees of freedom removed", lost, 4 if slider == "cable" else 2, 0.0),
    ]


# 10. Pins ----------------------------------------------------------------------------------------------------------


def pin_counts() -> list[Row]:
    """Rows of the ranks of a pin's equations, and of the degrees of freedom of whole tracks."""
    rows = []
    kinds: tuple[tuple[str, Any, Any, Any, int], ...] = (
        ("cable", cable, meshes.TRACK, joints.pin_cable(meshes.Y), 4),
        ("beam", beam, meshes.SHOE, joints.pin_beam(meshes.Y), 6),
    )
    for name, kind, c, pin, rank in kinds:
        ties = [Tie((0, 1), (1, 0), pin)]
        mesh = Mesh([Member(kind, c, nodes(kind, [0, 0, 0], np.eye(3), c.l, 2))], ties)
        computed_rank = int(np.linalg.matrix_rank(mesh.constraints(ties)))
        rows.append(checked("", f"pin of the {name}, rank of its equations", computed_rank, rank, 0.0))
        own = 24 if kind is beam else 12
        for closed, pins in ((True, LINKS), (False, LINKS - 1)):
            track = meshes.chain(kind, c, meshes.polygon(LINKS) if closed else np.zeros(LINKS), closed)
            what = f"{'closed' if closed else 'open'} track of 64 {name}s, degrees of freedom"
            rows.append(checked("", what, track.n, LINKS * own - pins * rank, 0.0))
    return rows


def _unstrained(what: str, mesh: Mesh, places: Iterable[Floats], over: str, scale: float, off: str) -> list[Row]:
    """Rows of the largest energy over ``scale``, J, and joint misfit, m, in strain-free configurations."""
    energy = misfit = 0.0
    for x in places:
        q = mesh.fit(x)
        misfit = max(misfit, float(abs(mesh.coordinates(q) - x.ravel()).max()))
        energy = max(energy, mesh.energy(q))
    return [
        checked("", f"{what}, strain energy / {over}", energy / scale, 0.0, 1e-24),
        checked("", f"{what}, {off}, m", misfit, 0.0, 1e-14),
    ]


def pin_turns(name: str) -> list[Row]:
    """Two links, the second rotated about the pin through 360 degrees: largest strain energy over EA l."""
    kind, c = (beam, meshes.SHOE) if name == "beam" else (cable, meshes.TRACK)
    mesh, whole = meshes.chain(kind, c, np.zeros(2)), meshes.rotation([3, -1, 2] if kind is beam else meshes.Y, 1.0)
    places = (meshes.turned(meshes.folded(mesh, meshes.Y, angle), whole) for angle in np.radians(np.arange(0, 361, 15)))
    what = f"pin of the {name} through 360 degrees"
    return _unstrained(what, mesh, places, "EA l", meshes.MODULUS * meshes.AREA * meshes.PITCH, "misfit of the joint")


# 11. Corners -------------------------------------------------------------------------------------------------------


def sections() -> list[Row]:
    """Rigid rotation of T, L and V corners: strain energy over EA, and misfit of the joints, m."""
    rows: list[Row] = []
    kinds: tuple[tuple[str, Any, Any, tuple[Any, ...]], ...] = (
        ("beams", beam, meshes.SHOE, ([0, 1, 0], [1, 2, 3], [1, 0, 0])),
        ("cables in their plane", cable, meshes.TRACK, (meshes.Y,)),
    )
    for name, kind, c, axes in kinds:
        flat = {shape: angles for shape, angles in meshes.SECTIONS.items() if kind is beam or shape in "TLV"}
        for shape, angles in flat.items():
            mesh = meshes.cornered(kind, [c] * (1 + len(angles)), angles, 2)
            places = (meshes.turned(mesh.e0, meshes.rotation(axis, angle)) for angle, axis in enumerate(axes, 1))
            what = f"{shape} section of {name} turned as one body"
            rows += _unstrained(what, mesh, places, "EA", meshes.MODULUS * meshes.AREA, "misfit")
    return rows


def l_frame(name: str) -> list[Row]:
    """Tip deflection of an L-frame at L/h = 20, nu = 0, against Timoshenko."""
    kind, ns = (beam, (6, 12, 24)) if name == "beam" else (CABLES[name], (1, 2, 4))
    tips = [meshes.frame_tip(kind, n) for n in ns]
    rows = []
    for k, axis in enumerate("xz"):
        values = [float(u[k]) for u, _ in tips]
        exact = float(tips[-1][1][k])
        if kind is beam:
            case = f"L-frame of beams with a rigid corner, tip {axis}, m"
            row = _over_elements(case, ns, values, exact, 5e-3)
            rows.append(of_order(row, 1.9, 2.2) if axis == "z" else row)
        else:  # one element is exact but for its small bending: there is no order
            rows.append(checked("", f"L-frame of cables {name}, tip {axis}, m", values[-1], exact, 5e-3))
    if kind is beam:
        u, exact_u = meshes.frame_tip(beam, 24, rigid=0.0)
        what = "L-frame of beams, gradient transformation alone, tip x, m"
        rows.append(checked("", what, u[0], exact_u[0], math.nan, note="yields in the corner, for information"))
    return rows


# 12. Splines -------------------------------------------------------------------------------------------------------

INNER: tuple[list[int], ...] = ([], [1], [2, 1, 1], [3, 1, 2], [4, 2, 3, 1], [1] * 6)  # multiplicities of inner knots


def splines() -> list[Row]:
    """Splines to cable coordinates and back, twice; errors relative to the largest coordinate."""
    rng, there, back = np.random.default_rng(11), 0.0, 0.0
    for inner in INNER:
        spline = bspline.drawn(inner, rng)
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
        count = int(np.linalg.matrix_rank(bspline.knot_rows(m))) if m < 4 else len(bspline.knot_rows(m))
        rows.append(checked("", f"equations that a knot of multiplicity {m} imposes", count, 3 * (4 - m), 0.0))
    for d in bspline.table():
        equations, *others = bspline.EXPECTED[d.element, d.joint]
        made = f"knot {d.knot}" if d.knot else f"no knot; {d.missing} missing with {d.weaker}"
        same = [d.knot, d.weaker, d.missing] == others
        row = checked("", f"equations of the joint '{d.joint}' of {d.element}s", d.equations, equations, 0.0, note=made)
        rows.append(replace(row, ok=bool(row.ok) and same))
    return rows


# All of it ---------------------------------------------------------------------------------------------------------


def cases() -> list[Case]:
    """Cases of all elements, joints and corners; each takes seconds."""
    both, framed = (*CABLES, *CURES), ("beam", "small deformation (11)-(15)", "general (8)-(10)")
    return [
        *(Case("2", f"elastica, {_element(name)[0]}", elastica_of, (name,), 4) for name in both),
        *(Case("2", f"order of the elastica, {name}", elastica_order, (name,), 3) for name in both),
        Case("2", "elastica without a cure", elastica_without_cure, (), 5),
        *(Case("3", f"frequencies, {name}, {ends}", frequencies, (name, ends), 2) for name in both for ends in ENDS),
        *(Case("4", f"rotating cable, {name}", rotating_cable, (name,), 8) for name in CABLES),
        *(
            Case("9", f"sliding {slider}{'' if smooth else ', C1'}", sliding_joint, (slider, smooth), 5)
            for slider, smooth in (("point", True), ("point", False), ("cable", True))
        ),
        Case("10", "pins counted", pin_counts, (), 2),
        *(Case("10", f"pin of the {name} turned", pin_turns, (name,)) for name in ("cable", "beam")),
        Case("11", "sections", sections),
        *(Case("11", f"L-frame, {name}", l_frame, (name,), 2) for name in framed),
        Case("12", "splines", splines),
    ]
