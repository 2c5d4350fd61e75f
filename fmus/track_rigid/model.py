"""Rigid track: a chain of rigid links on pins behind the ports of a track."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.interface.model import Floats, InvalidParameter, StepFailed
from fmus.interface.ports import Port
from fmus.physics.chain import state
from fmus.physics.chain.bushing import without_losses
from fmus.physics.chain.implicit import ImplicitMethod
from fmus.physics.chain.integration import HELD, PINNED
from fmus.physics.chain.layout import encloses
from fmus.physics.chain.report import DEPTH
from fmus.physics.chain.rigid import initial_state
from fmus.physics.chain.rigid.dynamics import LIMIT, longest
from fmus.physics.chain.rigid.initial_state import open_closing_pin, start_released, write_outputs
from fmus.physics.chain.rigid.jointed import count, to_joint_coordinates
from fmus.physics.chain.rigid.links import RigidLinks, place
from fmus.physics.chain.rigid.newton import TOLERANCE
from fmus.physics.chain.rigid.state import State, shapes, work
from fmus.physics.integrate.generalized_alpha import BACKWARD
from fmus.physics.rigid.augmented import PIN, ClosingSpring, Ends
from fmus.track.choices import AUGMENTED, EXPLICIT, FORMULATIONS, RECURSIVE, conflict_of_bodies
from fmus.track.model import TrackModel
from fmus.track.ports import SPRING, closure_ports, integrator_coefficients, integrator_ports
from fmus.track.start import not_at_rest

REST = ImplicitMethod(BACKWARD, 1e-11, False)  # integrator towards static equilibrium
SLOWLY = REST._replace(tolerance=1e-9)  # where Newton's corrections shrink too slowly for that
TURNED_OVER = 0.7  # cosine of half the angle, 90 degrees, by which links may turn on that way
SLOW, LESS = 1e4, 0.9  # rotary inertia, over their own, of links that shall not snap past a body; depth that is less


class Model(TrackModel):
    """Chain of rigid links joined by exact pins, in one of two formulations, with any integrator."""

    State = State
    formulation = AUGMENTED

    def link_parameters(self, vehicle: Mapping[str, Any]) -> tuple[Port, ...]:
        """Parameters of integration, formulation and closure."""
        text = "augmented: poses of all links, pins with multipliers; recursive: joint coordinates, explicitly alone"
        formulation = Port("formulation", "parameter", "1", text, AUGMENTED, FORMULATIONS)
        return (*integrator_ports(), formulation, *(closure_ports() if self.closed else ()))

    @property
    def joints(self) -> int:
        """Number of joint coordinates, 0 in the augmented formulation."""
        pinned = self.ends_kind in (PINNED, HELD)
        return count(self.links_count, pinned) if self.formulation == RECURSIVE else 0

    def shapes(self) -> state.Shapes:
        """Shapes of the views into the chain's state, by name."""
        return shapes(
            self.links_count,
            self.closed,
            len(self.wheel_list),
            self.on_links_shape,
            self.joints,
            self.ground_memory,
            self.bushed > 0,
        )

    def prepare(self, p: Mapping[str, Any]) -> None:
        """Make the links from the vehicle table, allocate state and work; raises InvalidParameter."""
        if conflict := conflict_of_bodies(p):
            raise InvalidParameter(conflict)
        if p["formulation"] != self.formulation:
            self.formulation = p["formulation"]
            self.allocate()
        self.method = ImplicitMethod(integrator_coefficients(p), TOLERANCE, True)
        v = self.vehicle["track"]
        ends = Ends(self.closed, self.ends_kind in (PINNED, HELD), self.ends_kind == PINNED)
        inertia = np.array(v["inertia"], dtype=float)
        spring = PIN
        if p.get("closure") == SPRING:
            spring = ClosingSpring(p["closure.stiffness"], p["closure.damping"])
        half = 0.5 * self.pitch
        self.rigid = RigidLinks(half, v["face"], 0.25 * v["width"], v["mass"], inertia, ends, spring, self.bushing)
        self.link: Any = self.rigid
        if self.formulation == RECURSIVE:
            from fmus.physics.chain.rigid.jointed import JointedLinks

            self.link = JointedLinks(self.rigid)
        self.work = work(
            self.links_count,
            self.closed,
            len(self.wheel_list),
            self.on_links_shape,
            self.joints,
            self.most_points,
            self.ground_memory,
            self.s.rut,
            self.bushed > 0,
        )

    @property
    def stable_step(self) -> float:
        """See ``TrackModel``."""
        return min(LIMIT, self._spring_step)

    @property
    def longest_step(self) -> float:
        """See ``TrackModel``; links that neither touch nor have damped pins take the steps that they are given."""
        if self.integrator == EXPLICIT and self.contacts is None and not self.environment.transverse:
            return min(self.max_step, self._spring_step)
        return super().longest_step

    @property
    def _spring_step(self) -> float:
        links = self.rigid
        return longest(links.spring, links.half, links.mass, links.inertia[1])

    def settle(self, pins: Floats, rest: bool, spin: float = 0.0) -> None:
        """See ``TrackModel``; a spinning regular polygon of rigid links is in relative equilibrium as it is."""
        self.state[:] = 0.0
        s, w = self.s, self.work
        place(self.rigid, pins, s, w)
        if rest and not spin:
            self.find_equilibrium(self.start_rows)
            if self.wheel_list and self._depth() > self.rigid.face:
                self._settle_slowly(pins)
        else:
            w.wheels[:] = self.start_rows
            s.v[:, 0], s.v[:, 2], s.v[:, 4] = spin * s.q[:, 2], -spin * s.q[:, 0], spin
            self.evaluate_start()

    def _settle_slowly(self, pins: Floats) -> None:
        """Search again for a chain that rests deep in a body, as a pin through a tooth; what is less deep stays."""
        found, depth, factor = self.state.copy(), self._depth(), self.rotary_factor
        self.state[:] = 0.0
        place(self.rigid, pins, self.s, self.work)
        try:
            self.rotary_factor = SLOW * factor
            self.find_equilibrium(self.start_rows)
            self.rotary_factor = factor
            self.find_equilibrium(self.start_rows)
            better = self._depth() < LESS * depth
        except StepFailed:
            better = False
        self.rotary_factor = factor
        if not better:
            self.state[:] = found

    def _depth(self) -> float:
        """Depth in a body, m; infinite for a loop that has snapped past a whole wheel, which lies outside of it."""
        inside = not self.closed or encloses(self.pins()[:, [0, 2]], self.start_rows[:, [0, 2]])
        return float(self.report[DEPTH]) if inside else np.inf

    def find_equilibrium(self, rows: Floats) -> None:
        """See ``TrackModel``."""
        self.start_rows[:] = rows
        links, env, s, w = self.rigid, self.rest_environment(rows), self.s, self.work
        links = links._replace(inertia=self.rotary_factor * links.inertia, bushing=without_losses(self.bushing))
        partners = self.contacts
        if partners is not None:
            from fmus.track.contacts import SETTLING_FRICTION, at_rest, settling

            leans = len(rows) and rows[0, 11]  # friction of wheels would hold links askew: Newton's steps become short
            partners = at_rest(settling(partners, 0.0 if leans else SETTLING_FRICTION), env.gravity)
            if leans:  # nothing holds the chain across: where it was must not matter
                s.q[:, 1] -= s.q[:, 1].mean()
        laid, orientation = s.flat.copy(), s.q[:, 3:].copy()
        for method in (REST, SLOWLY):
            s.flat[:] = laid
            failure, _, link, residual = initial_state.settle(links, partners, env, method, rows, s, w, self.counters)
            if not failure:
                break
        else:
            raise not_at_rest(link, residual)
        turned = np.abs(np.sum(s.q[:, 3:] * orientation, axis=1))
        if turned.min() < TURNED_OVER:  # a free plate on soil also rests upside down
            raise StepFailed(f"static equilibrium of the track was not found: link {turned.argmin() + 1} turned over")
        self.counters[:] = 0
        if env is not self.environment:
            self.evaluate_start()
            return
        write_outputs(links, self.contacts, env, s, w, self.report)
        self._set_joint_coordinates()

    def add_rates(self, turning: Floats, velocity: Floats) -> None:
        """See ``TrackModel``; sets the velocities of the links and evaluates their accelerations."""
        v = self.s.v
        v[:, [0, 2]] += 0.5 * (velocity + np.roll(velocity, -1, axis=0))
        v[:, 4] += turning
        self.evaluate_start()

    def evaluate_start(self) -> None:
        """Evaluate accelerations and outputs of the start; raises StepFailed."""
        chain = self.contacts, self.environment, self.s, self.work
        link = -1
        if self.rigid.spring != PIN:
            link = open_closing_pin(self.rigid._replace(spring=PIN), self.rigid, *chain)
        if link < 0:
            link = start_released(self.rigid, *chain, self.report)
        if link >= 0:
            raise StepFailed(f"the accelerations of the start were not found: link {link + 1}")
        self._set_joint_coordinates()

    def _set_joint_coordinates(self) -> None:
        """Set the joint coordinates to the poses of the start."""
        if self.formulation == RECURSIVE:
            to_joint_coordinates(self.rigid, self.s)
