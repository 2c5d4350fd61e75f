"""The flexible track: a chain of steel cable elements behind the ports of a track."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.model import Floats, InvalidParameter, StepFailed
from fmus.physics.block_cyclic import factor, solve
from fmus.ports import WRENCH, Port
from fmus.track import DISSIPATED, GROUND, WORK, TrackModel
from fmus.track_flexible.chain import (
    CHORD,
    Links,
    advance,
    axial,
    correct,
    evaluate,
    measure,
    relax,
    work,
)
from fmus.track_flexible.element import ELASTICITIES
from fmus.track_flexible.explicit import LIMIT, factor_mass, highest_frequency, march, scratch
from fmus.track_flexible.nodes import NODE, gather
from fmus.track_flexible.sums import POWER

REST = 1e-3  # residual of static equilibrium, N
SPINNING = 30  # iterations towards the relative equilibrium of a loop
HOLD = 100.0  # its inertia over that of the spin; the iteration converges while the strain is below 1/HOLD
ROUNDING = 1e-10  # its last correction of a pin, relative to the pitch


class Model(TrackModel):
    """Cable elements with pins eliminated, integrated implicitly or explicitly."""

    integrators = ("generalized_alpha", "runge_kutta")

    def own_ports_of(self, vehicle: Mapping[str, Any]) -> tuple[Port, ...]:
        """Material and integration of the links."""
        m = vehicle["material"]
        return (
            Port(
                "elasticity",
                "parameter",
                "1",
                "strains of the links: small_deformation, average strain and r_xx; general, Green strain and"
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
            Port(
                "spectral_radius", "parameter", "1", "of generalised-alpha at infinite frequency, 0 to 1", 0.4
            ),
            Port("tolerance", "parameter", "m", "largest Newton correction of a converged step", 1e-9),
        )

    def chain_size(self) -> int:
        """Coordinates, rates, both accelerations; wrenches, their auxiliaries; power; residuals of the links."""
        wheels = len(self.wheel_list) + 1
        return 4 * self.nodes * NODE + 2 * wheels * WRENCH + 1 + 12 * self.links_count

    def prepare(self, p: Mapping[str, Any]) -> None:
        """Links from material and section; views of the state."""
        elasticity = str(p["elasticity"])
        if elasticity not in ELASTICITIES:
            raise InvalidParameter(f"elasticity = '{elasticity}': must be one of {', '.join(ELASTICITIES)}")
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
        s, v = self.vehicle["section"], self.vehicle
        area, second = s["area"], s["bending"]
        cable = ELASTICITIES[elasticity](
            self.pitch,
            v["material"]["density"] * area,
            young * area,
            young * second,
            tau * young * area,
            tau * young * second,
        )
        self.link = Links(
            self.links_count, int(self.closed), cable, v["track"]["face"], s["outer_fibre"], area, second
        )
        n, m = self.nodes * NODE, len(self.wheel_list) + 1
        parts = np.split(self.chain, np.cumsum([n, n, n, n, m * WRENCH, m * WRENCH, 1]))
        self.q, self.v, self.a, self.vdot = (part.reshape(self.nodes, NODE) for part in parts[:4])
        self.force, self.aux = parts[4].reshape(m, WRENCH), parts[5].reshape(m, WRENCH)
        self.power, self.residual = parts[6], parts[7].reshape(self.links_count, 4, 3)
        self.mean = np.zeros((m, WRENCH))
        self.work = work(self.links_count, self.nodes, m - 1)
        self.stable, self.space, self.factored = LIMIT / highest_frequency(cable), scratch(self.nodes), False

    def settle(self, pins: Floats, rest: bool, spin: float = 0.0) -> None:
        """Straight links between the pins, then static equilibrium if wanted."""
        self.settle_pins(pins)
        if spin:
            if rest:
                self._stretch(spin)
            for x, z in ((0, 2), (3, 4), (5, 6)):
                self.v[:, x], self.v[:, z] = spin * self.q[:, z], -spin * self.q[:, x]
        elif rest:
            partners = self.contacts
            if partners is not None:
                from fmus.contacts import smooth

                partners = smooth(partners)
            # no residual is smaller than what rounding of the places makes of the axial stiffness
            rest = max(REST, np.finfo(float).eps * self.link.cable.EA * self.links_count)
            count, residual = relax(
                self.link, partners, self.environment, self.start_rows, self.q, rest, self.work
            )
            if count < 0:
                raise StepFailed(
                    f"static equilibrium of the track was not found: residual {residual:.3g} N after {-count} steps"
                )
        self._observe()

    def tighten(self) -> None:
        """Stretch the links of a chain that is let go, so that no axial wave is born with it."""
        from fmus.track_flexible.taut import tighten

        def accelerations() -> Floats:
            self.vdot[:] = 0.0
            self._let_go()
            return self.vdot

        if not tighten(self.q, self.pitch, accelerations):
            raise StepFailed("start = 'displaced': the tension at which the chain is let go was not found")
        self.vdot[:] = 0.0
        self._observe()

    def settle_pins(self, pins: Floats) -> None:
        """Straight links between the pins (nodes, 2), at rest."""
        self.state[:] = 0.0
        q, n = self.q, self.links_count
        q[:, 0], q[:, 2] = pins[:, 0], pins[:, 1]
        chord = (np.roll(pins, -1, axis=0) - pins)[:n] / self.pitch
        q[:n, 5:7] = chord
        q[(np.arange(n) + 1) % self.nodes, 3:5] = chord

    def _stretch(self, spin: float) -> None:
        """Relative equilibrium of a free loop that turns at ``spin`` rad/s: Q = spin^2 M q.

        Inertia of the right sign keeps the matrix regular where nothing resists: the loop as one body. It is large
        enough to leave the loop where it is, and small next to the stiffness, so that Newton's iteration stays fast.
        """
        w, acceleration, still = self.work, self.vdot, self.space[0]
        for _ in range(SPINNING):
            acceleration[:] = -(spin**2) * self.q
            evaluate(
                self.link, None, self.environment, self.q, still, acceleration, 0.0, HOLD * spin**2, w, True
            )
            if factor(w.A, w.U, w.L, w.factors, self.closed) >= 0:
                break
            solve(w.A, w.U, w.factors, self.closed, w.b)
            if (
                correct(self.link, w, self.q, self.v, self.a, 0.0, 0.0, 0.5 * self.pitch)
                < ROUNDING * self.pitch
            ):
                acceleration[:] = 0.0
                return
        raise StepFailed(
            f"the loop that spins at {spin:g} rad/s has no relative equilibrium: its links are too soft"
        )

    def _observe(self) -> None:
        """Wrenches, pin forces and report of the state as it stands."""
        self._let_go()
        self.work.moved[:] = self.start_rows
        evaluate(
            self.link, self.contacts, self.environment, self.q, self.v, self.vdot, 0.0, 0.0, self.work, False
        )
        self.force[:] = self.aux[:] = self.mean[:] = self.work.wrench
        self.residual[:] = self.work.R
        self.power[:] = self.work.sums[POWER]
        measure(self.link, self.environment, self.q, self.v, self.work, self.report)
        self.report[[DISSIPATED, WORK]] = 0.0
        self.publish()

    def _let_go(self) -> None:
        """Accelerations of the start: the integrator's order rests on them."""
        still, space, _ = self.space
        if not factor_mass(self.link, self.contacts, self.environment, self.q, still, self.work):
            raise StepFailed("the chain's mass matrix is singular at the start")
        self.factored, w = True, self.work
        w.moved[:] = self.start_rows
        evaluate(self.link, self.contacts, self.environment, self.q, self.v, still, 0.0, 0.0, w, False)
        solve(w.A, w.U, w.factors, self.closed, w.b)
        correct(self.link, w, self.vdot, space[1], space[1], 0.0, 0.0, np.inf)
        self.a[:] = self.vdot

    def publish(self) -> None:
        """Show the mean wrenches."""
        self.wrench[:] = self.mean[:-1].reshape(-1, 3)
        self.report[GROUND : GROUND + 3] = -self.mean[-1, :3]

    def pins(self) -> Floats:
        """Positions of the pins (nodes, 3)."""
        return self.q[:, :3].copy()

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
        if not self.factored and not factor_mass(
            self.link, self.contacts, self.environment, self.q, still, self.work
        ):
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
                "Newton's iteration of the chain did not converge"
                if failure == 1
                else "the chain's matrix is singular"
            )
            raise self.failed(t + done, what, link, residual)

    def _watch(self, t: float) -> None:
        """Cable links cannot leave their plane: say so once when a wheel's axis does."""
        off = np.degrees(np.arccos(np.clip(abs(self.rows[:, 10]), 0.0, 1.0)))
        if off.size and off.max() > 0.2 and not self.warned:
            self.warned = True
            self._warnings.append(
                f"a wheel's axis is {off.max():.2f} degrees off the pin axis at t = {t:.4g} s: cable chains "
                "drive in their own plane only, take rigid links for turns and side slopes"
            )

    warned = False

    def links(self, tension: Floats, stress: Floats, position: Floats, force: Floats) -> None:
        """Per-link arrays from the state; the pin force is the link's own residual at its first pin."""
        for i in range(self.links_count):
            gather(self.q, i, (i + 1) % self.nodes, self.work.e)
            tension[i], stress[i] = axial(self.link, self.work)
        position[:] = self.q[:, :3]
        force[: self.links_count] = self.residual[:, 0]
        if not self.closed:
            force[-1] = -self.residual[-1, 2]
