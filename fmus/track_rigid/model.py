"""The rigid track: a chain of rigid links on pins behind the ports of a track."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.model import Floats, InvalidParameter, StepFailed
from fmus.physics.integrate.generalized_alpha import coefficients
from fmus.physics.rigid.augmented import Ends
from fmus.ports import Port
from fmus.track import GROUND, HELD, PINNED, TrackModel
from fmus.track_rigid import chain, explicit
from fmus.track_rigid.chain import Link


class Model(TrackModel):
    """Rigid links joined by exact pins, integrated implicitly or, for reference, explicitly."""

    kernel = chain.advance
    integrators = ("generalized_alpha", "runge_kutta")

    def own_ports_of(self, vehicle: Mapping[str, Any]) -> tuple[Port, ...]:
        """Integration of the links."""
        return (Port("spectral_radius", "parameter", "1", "of generalised-alpha at infinite frequency, 0 to 1", 0.4),)

    def chain_size(self) -> int:
        """Poses, velocities, both accelerations; multipliers; wheel wrenches and their auxiliaries; tally."""
        table = chain.shapes(self.links_count, self.closed, len(self.wheel_list))
        return sum(int(np.prod(shape)) for shape in table)

    def prepare(self, p: Mapping[str, Any]) -> None:
        """Links from the vehicle table; views of the state."""
        radius = float(p["spectral_radius"])
        if not 0.0 <= radius <= 1.0:
            raise InvalidParameter(f"spectral_radius = {radius}: must lie between 0 and 1")
        self.method = coefficients(radius)
        v, n, wheels = self.vehicle["track"], self.links_count, len(self.wheel_list)
        self.link = Link(0.5 * self.pitch, v["face"], 0.25 * v["width"], v["mass"], np.array(v["inertia"], dtype=float))
        self.ends = Ends(self.closed, self.ends_kind in (PINNED, HELD), self.ends_kind == PINNED)
        self.views = chain.views(self.chain, n, self.closed, wheels)
        self.work = chain.work(n, self.closed, wheels)
        self.tensions = np.zeros(n)
        self.slopes = explicit.slopes(n)

    def _system(self) -> tuple:
        return self.link, self.ends, self.environment, self.contacts

    def settle(self, pins: Floats, rest: bool, spin: float = 0.0) -> None:
        """Links between the pins, then static equilibrium, or the accelerations of the release.

        A regular polygon of rigid links that spins is in relative equilibrium as it is.
        """
        self.state[:] = 0.0
        s = self.views
        chain.place(self.link, pins, s, self.work)
        start = self.start_rows
        if rest and not spin:
            failed = chain.settle(*self._system(), start, s, self.work, self.counters)
        else:
            self.work.rows[:] = start
            s.v[:, 0], s.v[:, 2], s.v[:, 4] = spin * s.q[:, 2], -spin * s.q[:, 0], spin
            failed = chain.accelerations(*self._system(), s, self.work)
        if failed >= 0:
            raise StepFailed(f"static equilibrium of the track was not found: link {failed + 1}")
        self.counters[:] = 0
        self.work.impulse[:] = s.F
        self.publish(1.0)

    def move(self, turning: Floats, velocity: Floats) -> None:
        """Velocities of the links, and the accelerations that belong to them."""
        v = self.views.v
        v[:, [0, 2]] += 0.5 * (velocity + np.roll(velocity, -1, axis=0))
        v[:, 4] += turning
        chain.accelerations(*self._system(), self.views, self.work)
        self.publish(1.0)

    def publish(self, h: float) -> None:
        """Show what the impulses of a step of ``h`` and the state say."""
        self.wrench[:] = (self.work.impulse[:-1] / h).reshape(-1, 3)
        chain.measure(self.link, self.ends, self.environment, self.views, self.work, self.tensions, self.report)
        self.report[GROUND : GROUND + 3] = -self.work.impulse[-1, :3] / h

    def pins(self) -> Floats:
        """Positions of the pins (nodes, 3)."""
        chain.pin_motion(self.link, self.views, self.work)
        return self.work.pins[0].copy()

    def advance(self, t: float, h: float) -> None:
        """Integrate over the communication step."""
        if self.integrator == "runge_kutta":
            failed = explicit.march(
                *self._system(),
                self.rows,
                h,
                min(self.max_step, explicit.LIMIT),
                self.views,
                self.work,
                self.chain[: 13 * self.links_count],
                self.slopes,
                self.counters,
            )
        else:
            failed = chain.advance(
                *self._system(),
                self.method,
                self.rows,
                h,
                self.max_step,
                self.views,
                self.work,
                self.counters,
            )
        if failed >= 0:
            what = "Newton's iteration of the chain did not converge"
            if self.integrator == "runge_kutta":
                what = "the explicit integration of the chain blew up"
            raise self.failed(t, what, failed, abs(self.work.system.r).max())
        self.publish(h)

    def links(self, tension: Floats, stress: Floats, position: Floats, force: Floats) -> None:
        """Per-link arrays from the state."""
        chain.measure(self.link, self.ends, self.environment, self.views, self.work, tension, self.report.copy())
        stress[:] = 0.0
        position[:] = self.pins()
        chain.pin_forces(self.ends, self.environment, self.views, force)
