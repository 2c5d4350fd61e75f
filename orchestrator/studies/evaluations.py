"""One evaluation of a chain of any kind of link: the one module of the studies that knows the kernels of the tracks.

What goes in and comes out does not depend on how chains are computed: coordinates by what they are (``chain_states``),
residual and iteration matrix in the order of these, outputs by the names of the ports. Whoever changes the kernels
changes this module and nothing else, and ``baseline`` says whether the numbers are the same.

Steel's axial forces hide all others. So there are two more variants of a chain: ``bare`` links have neither stiffness
nor weight, and what is left are contacts and loads on pins; ``soft`` links touch nothing and are of rubber, so that
stretching, bending, damping, inertia and weight are of one size.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from fmus.physics.arrays import Floats
from fmus.physics.chain.environment import HELD, PINNED
from fmus.physics.chain.flexible.state import Motion
from fmus.physics.chain.kinds import newton_joints, observe
from fmus.physics.chain.rigid.links import residual as evaluate_rigid
from fmus.physics.chain.state import begin
from fmus.physics.chain.sums import END_POWER, LOSSES, PATCH_POWER
from fmus.physics.integrate.generalized_alpha import coefficients, slopes
from fmus.physics.point import sharpen
from fmus.physics.rigid import augmented
from fmus.physics.wheels import read_states
from fmus.ports import STATE, WRENCH
from fmus.track_flexible import model as track_flexible
from fmus.track_rigid import model as track_rigid
from orchestrator.studies.chain_states import Completed, Elastic, Rigid

# Kinds of links: the parameters of the flexible track, None for the rigid one.
KINDS: dict[str, dict[str, str] | None] = {
    "cable": {"element": "cable", "elasticity": "small_deformation"},
    "general": {"element": "cable", "elasticity": "general"},
    "engineering": {"element": "cable", "elasticity": "engineering"},
    "planar": {"element": "planar", "elasticity": "small_deformation"},
    "beam": {"element": "beam", "elasticity": "small_deformation"},
    "rigid": None,
}
STEEL, BARE, SOFT = "steel", "bare", "soft"  # variants
MATERIAL = {  # of the flexible links of a variant
    STEEL: {},
    BARE: {"material.youngs_modulus": 1e-3},
    SOFT: {"material.youngs_modulus": 2e6, "material.relaxation_time": 1e-3},
}
POISSON = 0.3  # of links of another Young's modulus than the vehicle's
RADIUS = 0.4  # spectral radius of the method that the iteration matrix belongs to
XZ = (0, 2)
# Of a wheel's position, quaternion, velocity and angular velocity what belongs to a motion in the plane x, z.
IN_PLANE = np.array([1, 0, 1, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0], dtype=float)

# Where a flexible chain's coordinates stand in those of its pins: field of ``Elastic``, columns, components. A link's
# own stand in its first pin (``begin``) or in its second one (``end``).
LAYOUTS: dict[str, tuple[tuple[str, tuple[int, ...], tuple[int, ...]], ...]] = {
    "cable": (("position", (0, 1, 2), (0, 1, 2)), ("begin", (5, 6), XZ), ("end", (3, 4), XZ), ("sideways", (7,), ())),
    "planar": (("position", (0, 1), XZ), ("begin", (4, 5), XZ), ("end", (2, 3), XZ)),
    "beam": (
        ("position", (0, 1, 2), (0, 1, 2)), ("begin", (12, 13, 14), (0, 1, 2)), ("end", (6, 7, 8), (0, 1, 2)),
        ("axis", (3, 4, 5), (0, 1, 2)), ("begin_normal", (15, 16, 17), (0, 1, 2)),
        ("end_normal", (9, 10, 11), (0, 1, 2)),
    ),
}  # fmt: skip


class Found(NamedTuple):
    """What an evaluation says, flat arrays."""

    residual: Floats  # N and N m, along the coordinates
    matrix: Floats  # iteration matrix times a given vector
    pins: Floats  # rigid links alone: misfit of the pins, m and rad, ...
    jacobian: Floats  # ... and its derivative times that vector
    wrenches: Floats  # force and torque on each wheel, world axes, and the ground's force: N and N m
    powers: Floats  # dissipated, lost as covered parts move, of loads on the ends, W
    report: Floats  # outputs of the chain, in the order of ``Chain.outputs``
    links: tuple[Floats, ...]  # tension N, stress Pa, position m and force N of the joints; of steel alone


class Chain:
    """The model of a track, laid out nowhere, that takes any state: ``evaluate`` says what belongs to it."""

    def __init__(
        self, kind: str, config: Mapping[str, Any], parameters: Mapping[str, Any], variant: str = STEEL
    ) -> None:
        own = KINDS[kind]
        track = dict(config["track"])
        if variant == BARE:
            track["gravity"] = 0.0
        elif variant == SOFT:
            track |= {"wheels": [], "ground": False}
        model: Any = _RigidTrack if own is None else _FlexibleTrack
        self._model = model({"vehicle": _completed(config["vehicle"]), "track": track, "link_outputs": True})
        known = {port.name: port.start for port in self._model.ports if port.causality == "parameter"}
        given = {name: value for name, value in parameters.items() if name in known}
        self._model.initialise(known | given | ({} if own is None else own | MATERIAL[variant]))
        contacts = self._model.contacts
        laws = [] if contacts is None else [contacts.sprocket, contacts.wheel, contacts.soil]
        self.kind, self.variant, self.touches = kind, variant, contacts is not None
        self.frame: Floats = np.array(self._model.frame)  # of the track: origin, m, cosine and sine of its heading (5)
        self.pitch = float(self._model.pitch)  # of the links, m
        self.axial = 0.0 if own is None else float(self._model.stiffness)  # of a link, N; 0 of a rigid one
        self.modulus = self.axial / float(self._model.vehicle["section"]["area"])  # Young's, Pa; 0 of rigid links
        self.contact = max((law.k for law in laws), default=0.0)  # the largest contact stiffness, N/m
        self.friction_velocity = min((law.v_reg for law in laws), default=np.inf)  # the least of the contacts, m/s
        outputs = [p for p in self._model.ports if p.causality == "output" and isinstance(p.start, float)]
        chain = outputs[WRENCH * len(self._model.wheel_list) : len(outputs) - self._model.link_ports]
        self.outputs, self.units = tuple(p.name for p in chain), tuple(p.unit for p in chain)
        if own is not None:
            n, nodes = self._model.links_count, self._model.nodes
            rows = {"b": np.arange(n), "e": (np.arange(n) + 1) % nodes}
            self._layout = [
                (field, np.ix_(rows.get(field[0], np.arange(nodes)), np.array(columns)), axes)
                for field, columns, axes in LAYOUTS[self._model.element]
            ]

    def evaluate(self, state: Completed, step: float, vector: Floats, sharp: bool = False) -> Found:
        """Residual, iteration matrix of a step of ``step`` s times the ``vector``, and what is shown, of a state.

        ``sharp``: in the sharp branch of friction, after an iteration that had other velocities. ``vector``: numbers
        between -1 and 1, at least as many as there are coordinates.
        """
        m = self._model
        s, w, by = m.s, m.work, slopes(coefficients(RADIUS), step)
        self._place(state.wheels)
        w.moved[:] = m.rows
        evaluate: Callable[[], Any]
        if self.kind == "rigid":
            self._take_rigid(state.rigid)
            evaluate, axes = partial(evaluate_rigid, *m.system(), s, w, by, True), [0, 1, 2]  # type: ignore[call-arg]
        else:
            for q, given in ((s.q, state.coordinates), (s.v, state.rates), (s.vdot, state.accelerations)):
                self._take(q, given)
            evaluate, axes = partial(m.evaluate, Motion(s.q, s.v, s.vdot, s.axes), by, True), list(m.kit.AXES)
        w.contact.sharp[0] = 0
        if sharp:
            sharpen(w.contact)
            velocity = s.v.copy()
            s.v[:, : len(axes)] += state.jump[: len(velocity), axes]
            evaluate()
            s.v[:] = velocity
        evaluate()
        x = vector[: s.v.size].reshape(s.v.shape)
        return Found(*(_of_rigid(m, x) if self.kind == "rigid" else self._of_flexible(m, x)), *self._shown(m))

    def _place(self, wheels: Floats) -> None:
        """The wheels (m, 13) of the track's frame as inputs in the world's, and read by the model."""
        m = self._model
        if not m.wheel_list:
            return
        c, s = m.frame[3], m.frame[4]
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        if self.kind == "planar":  # such a chain knows no others than wheels that keep its plane
            wheels = wheels * IN_PLANE
        u = np.zeros((len(wheels), STATE))
        u[:, :3] = wheels[:, :3] @ turn.T + m.frame[:3]
        half = 0.5 * np.arctan2(s, c)
        w, z = np.cos(half), np.sin(half)
        a, b, d, e = wheels[:, 3:7].T
        u[:, 3:7] = np.stack([w * a - z * e, w * b - z * d, w * d + z * b, w * e + z * a], axis=1)
        u[:, 7:10], u[:, 10:13] = wheels[:, 7:10] @ turn.T, wheels[:, 10:13] @ turn.T
        read_states(u.ravel(), m.frame, m.rows)

    def _shown(self, m: Any) -> tuple[Floats, Floats, Floats, tuple[Floats, ...]]:
        """Wrenches, powers, report, and what is shown of links, of the state that was evaluated."""
        self._pull(m)
        begin(m.s, m.work)
        observe(m.link, m.environment, m.s, m.work, m.report)
        count = WRENCH * len(m.wheel_list)
        y = np.zeros(count + len(self.outputs))
        m.outputs(y)
        parts: tuple[Floats, ...] = ()
        if self.variant == STEEL:
            links, n, pins = np.zeros(m.link_ports), m.links_count, 3 * m.nodes
            m.link_outputs(links)
            parts = links[:n], links[n : 2 * n], links[2 * n : 2 * n + pins], links[2 * n + pins : 2 * n + 2 * pins]
        ground = [count + k for k, name in enumerate(self.outputs) if name.startswith("ground.force")]
        sums = m.work.sums
        powers = np.array([sums[LOSSES:].sum(), sums[PATCH_POWER], sums[END_POWER]])
        return np.concatenate([y[:count], y[ground]]), powers, y[count:], parts

    def _pull(self, m: Any) -> None:
        """Forces of the pins as residuals say: an arbitrary state is no end of an iteration, which makes them small."""
        if self.kind == "rigid":
            newton_joints(m.link, m.environment, m.s, m.work)
        else:
            R, joint, n = m.work.R, m.work.on_links, m.links_count
            axes = XZ if R.shape[2] == 2 else (0, 1, 2)
            joint[:n, axes], joint[n:, axes] = R[:, 0], -R[-1:, R.shape[1] // 2]

    # ------------------------------------------------------------ flexible links

    def _of_flexible(self, m: Any, x: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Residual and matrix times ``x`` in the order of the fields; there are no equations of pins."""
        residual, product = _uncondensed(m, x)
        return self._flat(residual), self._flat(product), np.zeros(0), np.zeros(0)

    def _take(self, q: Floats, given: Elastic) -> None:
        """Coordinates, rates or accelerations into those of the pins (nodes, width)."""
        q[:] = 0.0
        for field, place, axes in self._layout:
            values = getattr(given, field)
            q[place] = values[:, axes] if axes else values[:, None]

    def _flat(self, g: Floats) -> Floats:
        """What belongs to the coordinates of the pins (nodes, width), in the order of the fields."""
        return np.concatenate([g[place].ravel() for _, place, _ in self._layout])

    # ------------------------------------------------------------ rigid links

    def _take_rigid(self, given: Rigid) -> None:
        """Motion of the links and multipliers of their pins into the state, and where the ground holds the ends."""
        m = self._model
        s, w = m.s, m.work
        s.q[:, :3], s.q[:, 3:] = given.centre, given.turn
        s.v[:], s.vdot[:], s.lam[:], w.x[:] = given.velocity, given.acceleration, given.pull, given.increment
        if not m.closed:
            ends = m.config["ends"]
            for k, side in ((0, -1.0), (1, 1.0)):
                place = ends["first" if k == 0 else "last"] if m.ends_kind == PINNED or k == 0 else [0.0, 0.0]
                w.ground[k, [0, 2]] = place if m.ends_kind in (PINNED, HELD) else [0.0, 0.0]
                w.ground[k, 0] += side * m.link.half


def _of_rigid(m: Any, x: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Residual, matrix times ``x``, misfit of the pins and its derivative times ``x``."""
    y = m.work.system
    residual, misfit = y.r.copy(), y.C.copy()
    product = np.einsum("nab,nb->na", y.K, x)
    augmented.rates(m.link.half, m.link.ends, y, x)
    return residual.ravel(), product.ravel(), misfit.ravel(), y.C.ravel().copy()


class _FlexibleTrack(track_flexible.Model):
    """A track that is laid out nowhere."""

    def _start(self, layout: str, spin: float) -> None:
        pass


class _RigidTrack(track_rigid.Model):
    """A track that is laid out nowhere."""

    def _start(self, layout: str, spin: float) -> None:
        pass


def _completed(vehicle: Mapping[str, Any]) -> dict[str, Any]:
    """The table of a vehicle; where no Poisson's ratio belongs to its moduli, which beams refuse, with POISSON.

    A table that knows no normal laws, as older ones do, has the linear one.
    """
    material = dict(vehicle["material"])
    if not 2.0 <= material["youngs_modulus"] / material["shear_modulus"] < 3.0:
        material["shear_modulus"] = material["youngs_modulus"] / (2.0 * (1.0 + POISSON))
    contact = {pair: {"law": "linear", **law} for pair, law in vehicle["contact"].items()}
    return {**vehicle, "material": material, "contact": contact}


def _uncondensed(m: Any, x: Floats) -> tuple[Floats, Floats]:
    """Residual and matrix times ``x`` over all coordinates of the pins (nodes, width), from the condensed ones."""
    w, at, nodes = m.work, m.kit.LAYOUT, m.nodes
    i, j = np.arange(m.links_count), (np.arange(m.links_count) + 1) % nodes
    shared, own = len(at.shared), len(at.own)
    R = w.R.reshape(m.links_count, -1)
    place = np.where(2 * np.arange(own) < own, i[:, None], j[:, None]), np.broadcast_to(at.slope, (len(i), own))
    pins = x[:, at.pin]
    z = x[place] + np.einsum("nab,nb->na", w.right, np.concatenate([pins[i], pins[j]], axis=1))
    before, after = np.roll(pins, 1, axis=0), np.roll(pins, -1, axis=0)
    condensed = sum(np.einsum("nab,nb->na", M, y) for M, y in ((w.A, pins), (w.L, before), (w.U, after)))
    back = np.linalg.solve(w.inner, z[..., None])[..., 0]  # ``inner`` is an inverse
    found = []
    for of_pins, of_links, eliminated in ((w.b, R[:, at.inner], w.own), (condensed, back, z)):
        taken = np.einsum("nab,nb->na", w.left, eliminated)
        whole = of_pins.copy()
        np.add.at(whole, i, taken[:, :shared])
        np.add.at(whole, j, taken[:, shared:])
        for end, held in ((0, m.ends_kind in (PINNED, HELD)), (-1, m.ends_kind == PINNED)):
            if held:  # the ground's
                whole[end, : m.kit.LAYOUT.fixed] = of_pins[end, : m.kit.LAYOUT.fixed]
        g = np.zeros(m.s.q.shape)
        g[:, at.pin] = whole
        np.add.at(g, place, of_links)
        found.append(g)
    return found[0], found[1]
