"""The flexible track: a chain of steel cables or beams behind the ports of a track."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.model import Floats, InvalidParameter, StepFailed
from fmus.physics.block_cyclic import solve
from fmus.physics.chain.cable_nodes import NODE
from fmus.physics.chain.planar_nodes import NODE as PLANAR_NODE
from fmus.physics.chain.sums import COVERING, POWER
from fmus.ports import WRENCH, Port
from fmus.track import COVERED, DISSIPATED, GROUND, PINNED, TILTED, WORK, TrackModel
from fmus.track_flexible.assembly import kernels
from fmus.track_flexible.chain import CHORD, advance, relax
from fmus.track_flexible.element import ELASTICITIES
from fmus.track_flexible.explicit import LIMIT, accelerations, factor_mass, march, scratch

REST = 1e-3  # residual of static equilibrium, N
LONG = 10.0  # last pseudo step towards it of a chain between pins, s: its slowest swings are to rest too
ALONG = np.cos(np.radians(0.2))  # of a wheel's axis along the pins, from which on cables leave their plane
SHEAR = 5.0 / 6.0  # correction of a beam's shear stiffness, rectangular section
# coordinates of a pin, vectors of a link, components of a vector
ELEMENTS = {"cable": (NODE, 4, 3), "planar": (PLANAR_NODE, 4, 2), "beam": (18, 8, 3)}


class Model(TrackModel):
    """Cables or beams with pins eliminated, integrated implicitly or explicitly."""

    kernel = advance
    integrators = ("generalized_alpha", "runge_kutta")
    element = "cable"

    def own_ports_of(self, vehicle: Mapping[str, Any]) -> tuple[Port, ...]:
        """Material and integration of the links."""
        m = vehicle["material"]
        return (
            Port(
                "element",
                "parameter",
                "1",
                "what a link is: cable, one axis and pins that keep their direction; planar, the cable without its"
                " lateral dofs; beam, all strains of a solid and pins that turn with the vehicle",
                "cable",
                tuple(ELEMENTS),
            ),
            Port(
                "elasticity",
                "parameter",
                "1",
                "strains of cables: small_deformation, average strain and r_xx; general, Green strain and"
                " curvature; engineering, |r_x| - 1 and the angle turned per length",
                "small_deformation",
                tuple(ELASTICITIES),
            ),
            Port(
                "material.youngs_modulus",
                "parameter",
                "Pa",
                "Young's modulus of the links",
                m["youngs_modulus"],
            ),
            Port(
                "material.relaxation_time",
                "parameter",
                "s",
                "damping constants over Young's modulus",
                m["relaxation_time"],
            ),
            Port("spectral_radius", "parameter", "1", "of generalised-alpha at infinite frequency, 0 to 1", 0.4),
            Port("tolerance", "parameter", "m", "largest Newton correction of a converged step", 1e-9),
        )

    def chain_size(self) -> int:
        """Coordinates, rates, both accelerations; wrenches, their auxiliaries; powers; residuals of the links."""
        wheels, (width, vectors, axes) = len(self.wheel_list) + 1, ELEMENTS[self.element]
        return 4 * self.nodes * width + 2 * wheels * WRENCH + 2 + axes * vectors * self.links_count

    def prepare(self, p: Mapping[str, Any]) -> None:
        """Links from material and section; views of the state."""
        element, elasticity = str(p["element"]), str(p["elasticity"])
        if element not in ELEMENTS:
            raise InvalidParameter(f"element = '{element}': must be one of {', '.join(ELEMENTS)}")
        if elasticity not in ELASTICITIES:
            raise InvalidParameter(f"elasticity = '{elasticity}': must be one of {', '.join(ELASTICITIES)}")
        if element != "cable" and elasticity != "small_deformation":
            raise InvalidParameter(
                f"elasticity = '{elasticity}' needs element = 'cable': a {element} chain has but one"
            )
        young, tau = float(p["material.youngs_modulus"]), float(p["material.relaxation_time"])
        if not young > 0.0:
            raise InvalidParameter(f"material.youngs_modulus = {young}: must be greater than 0")
        if not tau >= 0.0:
            raise InvalidParameter(f"material.relaxation_time = {tau}: must not be negative")
        self.radius, self.tolerance = float(p["spectral_radius"]), float(p["tolerance"])
        if not 0.0 <= self.radius <= 1.0:
            raise InvalidParameter(f"spectral_radius = {self.radius}: must lie between 0 and 1")
        if not 0.0 < self.tolerance <= CHORD:
            raise InvalidParameter(f"tolerance = {self.tolerance}: must be greater than 0 and {CHORD} at most")
        self.link = self._beams(young, tau) if element == "beam" else self._cables(element, elasticity, young, tau)
        self.stiffness = young * self.vehicle["section"]["area"]  # axial, N
        self.kit = kernels(type(self.link))
        if element != self.element:
            self.element = element
            self.allocate()
        self.environment = self.environment._replace(pull=np.ascontiguousarray(self.environment.pull[:, self.kit.AXES]))
        width, vectors, axes = ELEMENTS[element]
        n, m = self.nodes * width, len(self.wheel_list) + 1
        parts = np.split(self.chain, np.cumsum([n, n, n, n, m * WRENCH, m * WRENCH, 2]))
        self.q, self.v, self.a, self.vdot = (part.reshape(self.nodes, width) for part in parts[:4])
        self.force, self.aux = parts[4].reshape(m, WRENCH), parts[5].reshape(m, WRENCH)
        self.power, self.residual = parts[6], parts[7].reshape(self.links_count, vectors, axes)
        self.mean = np.zeros((m, WRENCH))
        self.work = self.kit.work(self.links_count, self.nodes, m - 1)
        self.stable = LIMIT / self.kit.highest_frequency(self.link)
        self.space, self.factored = scratch(self.nodes, width), False

    def _cables(self, element: str, elasticity: str, young: float, tau: float) -> Any:
        if element == "planar":
            from fmus.track_flexible.planar import Planar

            kind: Any = Planar
        else:
            from fmus.track_flexible.cables import Links

            kind = Links
        s, v = self.vehicle["section"], self.vehicle
        area, second = s["area"], s["bending"]
        cable = ELASTICITIES[elasticity](
            self.pitch,
            v["track"]["mass"] / self.pitch,
            young * area,
            young * second,
            tau * young * area,
            tau * young * second,
        )
        face, outer = v["track"]["face"], s["outer_fibre"]
        return kind(self.links_count, int(self.closed), cable, face, outer, area, second)

    def _beams(self, young: float, tau: float) -> Any:
        """The rectangle with the section's radii of gyration, a link's mass, moduli scaled to the section's area."""
        from fmus.track_flexible.beams import Beam, Beams

        s, m, track = self.vehicle["section"], self.vehicle["material"], self.vehicle["track"]
        poisson = 0.5 * m["youngs_modulus"] / m["shear_modulus"] - 1.0
        if not 0.0 <= poisson < 0.5:
            raise InvalidParameter(
                f"material.shear_modulus = {m['shear_modulus']}: with the vehicle's Young's modulus it makes"
                f" Poisson's ratio {poisson:.3g}, of a beam 0 or more and below 0.5"
            )
        width, height = (np.sqrt(12.0 * s[key] / s["area"]) for key in ("lateral_bending", "bending"))
        scale = s["area"] / (width * height)
        rho, twist = track["mass"] / (self.pitch * width * height), s["torsion"] / (s["bending"] + s["lateral_bending"])
        beam = Beam(self.pitch, width, height, rho, scale * young, poisson, SHEAR, twist, True, tau)
        return Beams(
            self.links_count,
            int(self.closed),
            beam,
            track["face"],
            0.25 * track["width"],
            s["outer_fibre"],
            s["area"],
            young,
        )

    def settle(self, pins: Floats, rest: bool, spin: float = 0.0) -> None:
        """Straight links between the pins, then static equilibrium if wanted."""
        self.settle_pins(pins)
        if spin:
            if rest:
                self._stretch(spin)
            x, z = self.kit.PLANE.T
            self.v[:, x], self.v[:, z] = spin * self.q[:, z], -spin * self.q[:, x]
        elif rest:
            partners = self.contacts
            if partners is not None:
                from fmus.contacts import smooth

                partners = smooth(partners)
            least, longest = max(REST, self._rounding()), LONG if self.ends_kind == PINNED else 0.0
            count, residual = relax(
                self.link, partners, self.environment, self.start_rows, self.q, least, longest, self.work
            )
            if count < 0:
                raise StepFailed(
                    f"static equilibrium of the track was not found: residual {residual:.3g} N after {-count} steps"
                )
        self._observe()

    def move(self, turning: Floats, velocity: Floats) -> None:
        """Rates of the pins and of the slopes of the links that end and begin there."""
        place, *slopes = self.kit.PLANE
        own = len(slopes) // 2  # of each of the two links; what they share lies along y
        self.v[:, place] += velocity
        for vectors, rate in ((slopes[-2 * own : -own], np.roll(turning, 1)), (slopes[-own:], turning)):
            for x, z in vectors:
                self.v[:, x] += rate * self.q[:, z]
                self.v[:, z] -= rate * self.q[:, x]
        self._observe()

    def tighten(self) -> None:
        """Deform the links of a chain that is let go, so that no wave is born with it."""
        from fmus.track_flexible.taut import Chain, tighten

        self.work.moved[:] = self.start_rows
        chain = Chain(self.kit, self.q, self.work.M, self.pitch, self.ends_kind == PINNED)
        if not tighten(chain, self._residuals, max(REST, self._rounding())):
            raise StepFailed("the tension at which the chain is let go was not found: its links are too soft")
        self._observe()

    def _residuals(self, accelerations: Floats) -> Floats:
        """Of the links (links, rows, axes), N, at rest with the accelerations (nodes, width)."""
        args = self.link, self.contacts, self.environment, self.q, self.space[0], accelerations
        self.kit.evaluate(*args, 0.0, 0.0, self.work, False)
        return self.work.R

    def _rounding(self) -> float:
        """What rounding of the pins' places makes of the axial stiffness, N: no residual is reliably smaller."""
        return 4.0 * float(np.finfo(float).eps) * self.stiffness * self.links_count

    def settle_pins(self, pins: Floats) -> None:
        """Straight links between the pins (nodes, 2), at rest."""
        self.state[:] = 0.0
        self.kit.straight(self.link, pins, self.q)

    def _stretch(self, spin: float) -> None:
        """Relative equilibrium of a free loop that turns at ``spin`` rad/s."""
        from fmus.track_flexible.ring import stretch

        if not stretch(self.kit, self.q, len(self.work.M), spin, self._residuals, self._rounding()):
            raise StepFailed(
                f"the loop that spins at {spin:g} rad/s has no relative equilibrium: its links are too soft"
            )

    def _observe(self) -> None:
        """Wrenches, pin forces and report of the state as it stands."""
        self._let_go()
        self.work.moved[:] = self.start_rows
        self.kit.evaluate(
            self.link, self.contacts, self.environment, self.q, self.v, self.vdot, 0.0, 0.0, self.work, False
        )
        self.force[:] = self.aux[:] = self.mean[:] = self.work.wrench
        self.residual[:] = self.work.R
        self.power[:] = self.work.sums[[POWER, COVERING]]
        self.kit.measure(self.link, self.environment, self.q, self.v, self.work, self.report)
        self.report[[DISSIPATED, WORK, COVERED]] = 0.0
        self.publish()

    def _let_go(self) -> None:
        """Accelerations of the start: the integrator's order rests on them."""
        still, space, _ = self.space
        if not factor_mass(self.link, self.contacts, self.environment, self.q, still, self.work):
            raise StepFailed("the chain's mass matrix is singular at the start")
        self.factored, w = True, self.work
        w.moved[:] = self.start_rows
        self.kit.evaluate(self.link, self.contacts, self.environment, self.q, self.v, still, 0.0, 0.0, w, False)
        solve(w.A, w.U, w.factors, self.closed, w.b)
        self.vdot[:] = 0.0
        self.kit.correct(self.link, w, self.vdot, space[1], space[1], 0.0, 0.0, np.inf)
        self.a[:] = self.vdot

    def publish(self) -> None:
        """Show the mean wrenches."""
        self.wrench[:] = self.mean[:-1].reshape(-1, 3)
        self.report[GROUND : GROUND + 3] = -self.mean[-1, :3]

    def pins(self) -> Floats:
        """Positions of the pins (nodes, 3)."""
        places = np.zeros((self.nodes, 3))
        places[:, self.kit.AXES] = self.q[:, : len(self.kit.AXES)]
        return places

    def advance(self, t: float, h: float) -> None:
        """Integrate over the communication step."""
        if self.integrator == "runge_kutta":
            self._march(t, h)
        else:
            self._advance(t, h)
        self.residual[:] = self.work.R
        self.publish()

    def _march(self, t: float, h: float) -> None:
        still, space, k = self.space
        if not self.factored and not factor_mass(self.link, self.contacts, self.environment, self.q, still, self.work):
            raise StepFailed(f"the chain's mass matrix is singular at t = {t:.6g} s")
        self.factored = True
        failure, done = march(
            self.link,
            self.contacts,
            self.environment,
            self.rows,
            h,
            min(self.max_step, self.stable),
            self.chain[: 2 * self.q.size],
            still,
            space,
            k,
            self.work,
            self.mean,
            self.report,
            self.counters,
        )
        if failure:
            raise StepFailed(
                f"the explicit integration of the chain blew up at t = {t + done:.6g} s: take a smaller step than "
                f"{min(self.max_step, self.stable):.3g} s"
            )
        self.settle_forces()

    def settle_forces(self) -> None:
        """Residuals of the links, and so the pin forces, with the accelerations of the state as it stands."""
        still, space, _ = self.space
        args = (self.link, self.contacts, self.environment, self.q, self.v)
        accelerations(*args, still, space, self.work)
        self.kit.evaluate(*args, space[0], 0.0, 0.0, self.work, False)
        self.residual[:] = self.work.R

    def _advance(self, t: float, h: float) -> None:
        failure, done, link, residual = advance(
            self.link,
            self.contacts,
            self.environment,
            self.rows,
            h,
            self.max_step,
            self.radius,
            self.tolerance,
            self.q,
            self.v,
            self.a,
            self.vdot,
            self.force,
            self.aux,
            self.power,
            self.work,
            self.mean,
            self.report,
            self.counters,
        )
        if failure:
            what = (
                "Newton's iteration of the chain did not converge" if failure == 1 else "the chain's matrix is singular"
            )
            raise self.failed(t + done, what, link, residual)

    def _watch(self, t: float) -> None:
        """Cable links cannot leave their plane: say so once when a wheel's axis does."""
        if self.element == "beam" or self.told[TILTED] or not self.rows.size:
            return
        along = abs(self.rows[:, 10]).min()
        if along < ALONG:
            self.told[TILTED] = True
            self._warnings.append(
                f"a wheel's axis is {np.degrees(np.arccos(along)):.2f} degrees off the pin axis at"
                f" t = {t:.4g} s: cable chains drive in their own plane only, take beams or rigid links for turns and"
                " side slopes"
            )

    def links(self, tension: Floats, stress: Floats, position: Floats, force: Floats) -> None:
        """Per-link arrays from the state; the pin force is the link's own residual at its first pin."""
        self.kit.axials(self.link, self.q, self.work, tension, stress)
        position[:] = self.pins()
        force[:] = 0.0
        force[: self.links_count, self.kit.AXES] = self.residual[:, 0]
        if not self.closed:
            force[-1, self.kit.AXES] = -self.residual[-1, ELEMENTS[self.element][1] // 2]
