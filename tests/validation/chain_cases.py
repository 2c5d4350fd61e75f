"""Chains of rods and of meshes without contact, compared with exact and published figures."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import eigh

from fmus.physics.ancf import beam, cable
from fmus.physics.arrays import Floats
from fmus.physics.chain.layout import regular_polygon
from orchestrator.studies import Case, Row
from tests.validation.ancf import dynamics, loads, statics
from tests.validation.compared import checked, of_order, order_of, rate_of
from tests.validation.meshes import AREA, PITCH, SECOND, SHOE, STEEL, TRACK, angular_momentum, chain, spinning, velocity
from tests.validation.rods import EXPLICIT, IMPLICIT, MASS, Cables, G, Rods, of_angles

# 5. Released horizontal chain --------------------------------------------------------------------------------------

Kind = type[Rods] | type[Cables]
LINKS = 64
STEP = "step, s"  # abscissa of a series of errors


def released(kind: Kind, h: float, integrator: str = IMPLICIT, pitch: float = PITCH, **changes: Any) -> float:
    """Place x, m, of the tip of a chain 0.5 s after its release from the horizontal."""
    own: dict[str, Any] = {"pitch": pitch} if kind is Rods else {"cable": STEEL._replace(l=pitch)}
    pins = pitch / PITCH * of_angles(np.zeros(LINKS))
    return float(kind(pins, held=True, **own, **changes).release().run(0.5, h, integrator).pins()[-1, 0])


def released_rods() -> list[Row]:
    """Released chain of thin rigid rods, by Runge-Kutta."""
    hs = (1e-2, 5e-3, 2.5e-3)
    case = "released chain of 64 rods, tip x at 0.5 s, m"
    return _over_steps(case, hs, [released(Rods, h, EXPLICIT) for h in hs], 9.413161, 4)


def released_steel(hs: tuple[float, ...]) -> list[Row]:
    """Released chain of steel cables, by generalised alpha with steps ``hs``, s."""
    mesh = chain(cable, STEEL, np.zeros(LINKS), held=True)
    mesh = mesh.loaded(loads.gravity(mesh, [0, 0, -G]))
    tips = []
    for h in hs:
        q, still = mesh.start(), np.zeros(mesh.n)
        for _, now, _ in dynamics.generalized_alpha(mesh, q, still, h, round(0.5 / h)):
            q = now
        tips.append(float(mesh.end(q, (LINKS - 1, 1))[0, 0]))
    return _over_steps("released chain of 64 steel links, tip x at 0.5 s, m", hs, tips, 9.413174, 2)


def _over_steps(case: str, hs: tuple[float, ...], values: list[float], reference: float, order: int) -> list[Row]:
    """Row of a value over steps ``hs``, s; the reference has six decimals, so errors are to the own limit."""
    limit = values[-1] + (values[-1] - values[-2]) / (2**order - 1)
    series = tuple((h, abs(value - limit)) for h, value in zip(hs, values, strict=True))
    off = abs(values[-1] - reference)
    row = checked("", case, values[-1], reference, 2e-5, off, order=order_of(hs, values), over=STEP, series=series)
    row = of_order(row, order - 0.4, order + 0.4)
    return [replace(row, note=f"{row.note}; the figure's errors are to the values' own limit")]


# 6. Small swings of the hanging chain ------------------------------------------------------------------------------

SWINGS = (1.20242178, 2.76073253, 4.33154065, 5.91226122)  # omega sqrt(L/g) of 64 thin rods


def swings_of_rods(links: int = LINKS) -> list[Row]:
    """Swing frequencies of rods, from the accelerations of links released off the vertical, one at a time."""
    d = 1e-5

    def released(k: int, turn: float) -> Floats:
        angles = np.full(links, -np.pi / 2)
        angles[k] += turn
        return Rods(of_angles(angles), held=True).release().s.vdot[:, 4]  # angles count from x to z, about -y

    stiff = np.stack([(released(k, d) - released(k, -d)) / (2 * d) for k in range(links)], axis=1)
    return _swings("rods", np.sort(np.linalg.eigvals(stiff).real)[:4], links)


def swings_of_steel() -> list[Row]:
    """Swing frequencies of steel cables in the plane, linearised about the loaded equilibrium."""
    mesh = chain(cable, TRACK, np.full(LINKS, -np.pi / 2), held=True)
    mesh = mesh.loaded(loads.gravity(mesh, [0, 0, -G]))
    # without tension the matrix is singular: Newton starts at the stretch by the weight below each link
    stretch = 1.0 + (LINKS - np.arange(LINKS) - 0.5) * TRACK.rhoA * PITCH * G / TRACK.EA
    e = mesh.coordinates(mesh.start()).reshape(LINKS, 4, 3)
    e[:, 2, 2] = -PITCH * np.cumsum(stretch)
    e[1:, 0, 2], e[:, [1, 3], 2] = e[:-1, 2, 2], -stretch[:, None]
    q = statics.equilibrium(mesh, mesh.fit(e), steps=1, tolerance=1e-13)
    plane = np.flatnonzero(abs(mesh.B[1::3]).sum(axis=0) == 0.0)
    K = mesh.tangent(q).toarray()[np.ix_(plane, plane)]
    M = mesh.M.toarray()[np.ix_(plane, plane)]
    return _swings("steel links", 1.0 / eigh(M, 0.5 * (K + K.T), eigvals_only=True)[::-1][:4])


def _swings(what: str, squares: Floats, links: int = LINKS) -> list[Row]:
    frequencies = np.sqrt(squares * links * PITCH / G)
    return [
        checked("", f"hanging chain of {links} {what}, mode {k + 1}, omega sqrt(L/g)", value, SWINGS[k], 5e-6)
        for k, value in enumerate(frequencies)
    ]


# 7. Spinning free loop ---------------------------------------------------------------------------------------------


def spinning_loop() -> list[Row]:
    """Joint force of rods and steel, hoop strain of steel."""
    omega, expected, slope = 5.0, 7112.513, np.pi / LINKS
    loop = Rods(regular_polygon(PITCH, LINKS), closed=True, gravity=0.0)
    loop.turn(np.array([0.0, omega, 0.0]))
    loop.release()
    rods = np.linalg.norm(loop.s.lam[:, :3], axis=1)
    mesh, q = spinning(LINKS, omega)
    e = mesh.coordinates(q)
    residual = (mesh.internal(q) - omega**2 * (mesh.M_e @ e)).reshape(LINKS, 4, 3)
    steel = np.linalg.norm(residual[:, 0], axis=1)
    e = e.reshape(LINKS, 4, 3)
    hoop = np.linalg.norm(e[:, 2] - e[:, 0], axis=1) / PITCH - 1
    inside = expected * np.cos(slope) + TRACK.rhoA * omega**2 * PITCH**2 / 12  # mean along a straight link
    rows = []
    for what, values, exact, tolerance in (
        ("joint force, rods, N", rods, expected, 1e-5),
        ("joint force, steel, N", steel, expected, 1e-5),
        ("hoop strain, steel, = T/EA", hoop, expected / TRACK.EA, 5e-4),
        ("hoop strain, steel, = mean tension of a link/EA", hoop, inside / TRACK.EA, 1e-5),
    ):
        k = int(np.abs(values - exact).argmax())
        rows.append(checked("", f"spinning loop of 64 links, {what}", values[k], exact, tolerance))
    return rows


# 8. Folded falling chain -------------------------------------------------------------------------------------------


class Fall(NamedTuple):
    """Fall of a chain that is pinned at one end, folded once and released, until after its largest drop."""

    t: Floats  # over sqrt(2 L/g)
    drop: Floats  # of the tip, over L
    drift: float  # of the energy, J

    def landmarks(self) -> tuple[float, float]:
        """Time of the largest drop over sqrt(2 L/g), and time to drop L/2 over sqrt(L/g)."""
        k = int(self.drop.argmax())
        parabola = np.polynomial.Polynomial.fit(self.t[k - 1 : k + 2], self.drop[k - 1 : k + 2], 2)
        half = float(np.interp(0.5, self.drop[:k], self.t[:k]))
        return float(parabola.deriv().roots()[0]), half * math.sqrt(2.0)

    def ahead(self) -> float:
        """Least drop over that of a body in free fall."""
        k = int(self.drop.argmax())
        return float((self.drop[1:k] / self.t[1:k] ** 2).min())


def fall(kind: Kind, links: int, turn: float = 0.05, gravity: float = G, integrator: str = EXPLICIT) -> Fall:
    """Fall of a chain whose links turn at most ``turn`` rad a step."""
    n, quarter = links // 2, np.pi / 2
    angles = np.concatenate([np.full(n, -quarter), [0.0], np.full(n, quarter)])
    chain = kind(of_angles(angles), held=True, gravity=gravity).release()
    length = links * PITCH
    scale, start = math.sqrt(2 * length / G), chain.energy()
    t, drop, drift = [0.0], [0.0], 0.0
    while t[-1] < 0.9 * scale and drop[-1] >= 0.98 * max(drop):
        h = min(2e-3 * scale, turn / max(chain.rate(), 1e-9))
        chain.run(h, h, integrator)
        t.append(t[-1] + h)
        drop.append(-float(chain.pins()[-1, 2]))
        drift = max(drift, abs(chain.energy() - start))
    return Fall(np.array(t) / scale, np.array(drop) / length, drift)


def folded_chain(kind: Kind, links: int, *fallen: Any) -> list[Row]:
    """Rows of the fall of a folded chain; ``fallen``: arguments of ``fall``."""
    found = fall(kind, links, *fallen)
    (top, half), ahead = found.landmarks(), found.ahead()
    name = f"folded chain of {links} {'rods' if kind is Rods else 'steel links'}"
    return [
        checked("", f"{name}, time of the largest drop / sqrt(2 L/g)", top, 0.8472, 0.01),
        checked("", f"{name}, time to drop L/2 / sqrt(L/g)", half, 0.948, 0.005),
        checked(
            "", f"{name}, least drop / that of free fall", ahead, 1.0, 0.0, max(0.0, 1.002 - ahead),
            note="above 1.002: ahead at every instant",
        ),
        checked("", f"{name}, energy drift / m g L", found.drift / (links * MASS * G * links * PITCH), 0.0, 1e-3),
    ]  # fmt: skip


# 13. Drift of an undamped free chain -------------------------------------------------------------------------------

ZIGZAG = 0.3 * np.cos(2.2 * np.arange(8))
SPIN = np.array([0.2, 2.0, 0.3])  # rad/s, rigid
ORDERS = {EXPLICIT: 4, IMPLICIT: 2}
WEAK = 2e5  # Pa: links whose own modes an explicit method can follow


def drift(what: str, integrator: str, hs: tuple[float, ...], time: float) -> list[Row]:
    """Relative drift of energy and angular momentum during runs in steps of each h, s.

    Runge-Kutta of order 4 loses energy at order 5 if the motion is slow.
    """
    make = zigzag if what == "rods" else partial(Moving, what)
    # of the rods all components of the angular momentum, of cables that about the pins' axis, of beams all
    axes = slice(1, 2) if "cables" in what else slice(0, 3)
    runs = [drifts(make(), h, integrator, time) for h in hs]
    largest, order = np.array([(energy, momentum[axes].max()) for energy, momentum in runs]), ORDERS[integrator]
    rows = []
    for kept, errors, tolerance in zip(("energy", "angular momentum"), largest.T.tolist(), (1e-4, 1e-5), strict=True):
        row = checked(
            "", f"free chain, {what}, {integrator}, {kept} drift over {time:g} s", errors[-1], 0.0, tolerance,
            order=rate_of(hs, errors), over=STEP, series=tuple(zip(hs, errors, strict=True)),
        )  # fmt: skip
        rows.append(of_order(row, order - 0.4, order + (0.4 if order == 2 else 1.5)))
    return rows


def zigzag(cable: Any = None, lateral: float = 0.0) -> Rods | Cables:
    """Free chain of eight rods, or of cables with a ``lateral`` motion, that starts to turn."""
    pins = of_angles(ZIGZAG)
    pins -= pins.mean(axis=0)
    chain = Rods(pins, gravity=0.0) if cable is None else Cables(pins, gravity=0.0, cable=cable)
    chain.turn(SPIN)
    if cable is not None:
        chain.s.v[:, 1] = lateral * chain.s.q[:, 0]
    return chain.release()


def drifts(chain: Any, h: float, integrator: str, time: float) -> tuple[float, Floats]:
    """Largest relative change of energy, and of angular momentum (3), in a hundred samples."""
    start, angular = chain.energy(), chain.angular_momentum()
    lost, turned = 0.0, np.zeros(3)
    for _ in range(100):
        chain.run(time / 100, h, integrator)
        lost = max(lost, abs(chain.energy() / start - 1.0))
        turned = np.maximum(turned, np.abs(chain.angular_momentum() - angular) / np.linalg.norm(angular))
    return lost, turned


class Moving:
    """Mesh of free links that starts to turn, with the methods of ``Rods``."""

    def __init__(self, what: str) -> None:
        link = STEEL if what == "steel cables" else STEEL._replace(EA=WEAK * AREA, EI=WEAK * SECOND)
        if what == "soft beams":
            self.mesh, spin = chain(beam, SHOE._replace(E=WEAK), ZIGZAG[:3]), SPIN
        else:
            self.mesh, spin = chain(cable, link, ZIGZAG), SPIN * [0.0, 1.0, 0.0]
        self.q = self.mesh.start()
        self.v = velocity(self.mesh, np.cross(spin, self.mesh.e0.reshape(-1, 3)))
        self.steps: Any = None

    def run(self, time: float, h: float, integrator: str) -> None:
        """Go on for ``time``, s, in steps of ``h``, s."""
        if self.steps is None:
            method = dynamics.runge_kutta if integrator == EXPLICIT else dynamics.generalized_alpha
            options: dict[str, Any] = {} if integrator == EXPLICIT else {"tolerance": 1e-12, "radius": 0.8}
            self.steps = method(self.mesh, self.q, self.v, h, 10**9, **options)
        for _ in range(round(time / h)):
            _, self.q, self.v = next(self.steps)

    def energy(self) -> float:
        """Strain and kinetic energy, J."""
        return float(self.mesh.energy(self.q) + self.mesh.kinetic(self.v))

    def angular_momentum(self) -> Floats:
        """Angular momentum (3,) about the origin, kg m2/s."""
        return angular_momentum(self.mesh, self.q, self.v)


# All of it ---------------------------------------------------------------------------------------------------------


def cases(quick: bool) -> list[Case]:
    """Cases of chains; ``quick`` leaves out the two long chains and the long windows."""
    window = 2.0 if quick else 10.0
    coarse = (2.5e-3, 1.25e-3, 6.25e-4)
    free: tuple[tuple[str, str, tuple[float, ...]], ...] = (
        ("rods", IMPLICIT, (5e-3, 2.5e-3, 1.25e-3)),
        ("rods", EXPLICIT, (2e-2, 1e-2, 5e-3)),
        ("steel cables", IMPLICIT, coarse),
        ("soft cables", IMPLICIT, coarse),
        ("soft cables", EXPLICIT, (4e-3, 2e-3, 1e-3)),
        ("soft beams", IMPLICIT, coarse),
        ("soft beams", EXPLICIT, (1e-3, 5e-4, 2.5e-4)),
    )
    folded = (17, 33) if quick else (17, 33, 65, 129)
    long = {IMPLICIT: 10 * window, EXPLICIT: window}
    return [
        Case("5", "released rods", released_rods, (), 2),
        Case("5", "released steel", released_steel, ((1e-3, 5e-4, 2.5e-4),), 60),
        Case("6", "swings of rods", swings_of_rods, (), 2),
        Case("6", "swings of steel", swings_of_steel, (), 2),
        Case("7", "spinning loop", spinning_loop, (), 5),
        *(Case("8", f"folded chain of {links}", folded_chain, (Rods, links), links / 4) for links in folded),
        Case("8", "folded chain of steel", folded_chain, (Cables, 17, 0.02, G, IMPLICIT), 20),
        *(
            Case("13", f"drift of {what}, {integrator}", drift, (what, integrator, hs, window), long[integrator])
            for what, integrator, hs in free
        ),
    ]
