"""Flexible track: a chain of steel cables or beams behind the ports of a track."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.interface.model import FreeParameters, InvalidParameter, StepFailed
from fmus.interface.ports import POSITIVE, Port, Range
from fmus.kernels.jit import implementation
from fmus.physics.arrays import Floats, Integers
from fmus.physics.chain import state
from fmus.physics.chain.flexible.closing import ClosingSpring
from fmus.physics.chain.flexible.dynamics import NOTHING, stable
from fmus.physics.chain.flexible.initial_state import (
    EVALUATE,
    RELEASED,
    REST,
    Evaluation,
    Rest,
    release,
    start_released,
)
from fmus.physics.chain.flexible.link_layout import coordinate_indices, straight
from fmus.physics.chain.flexible.state import Motion, State, Work, shapes, work
from fmus.physics.chain.implicit import CHORD, ImplicitMethod
from fmus.physics.chain.integration import DONE, PINNED, SINGULAR, STALLED, IntegrationOutcome
from fmus.physics.elementary import atan2
from fmus.physics.integrate.generalized_alpha import Slopes
from fmus.track.choices import CHOLESKY, CONSTRAINED, ELEMENTS, EXPLICITLY, NODAL, conflict_of_links, links_turn
from fmus.track.model import TrackModel, bushing
from fmus.track.ports import SPRING, closure_ports, integrator_coefficients, integrator_ports
from fmus.track.start import not_at_rest
from fmus.track_flexible.links import (
    ChainKind,
    Material,
    chain_kind,
    chain_links,
    coordinate_ports,
    link_kind_ports,
    material_ports,
    mesh_size,
)

REST_RESIDUAL = 1e-3  # residual of static equilibrium, N, or if that is less:
REST_ACCELERATION = 1e-4  # that residual over the mass of a link, m/s2
LAST_PSEUDO_STEP = 10.0  # last pseudo step of a chain between pins, s: its slowest modes come to rest too
TILTS = 2  # corrections of the roll of free axes at rest
SOLID_PART = 0.1  # part of the tolerance that holds for beams, whose sections strain by more than their pins move
PIN_ERROR = 0.02  # of the weight of the chain: error of a pin's force at which the tolerance of stiff links ends
TOLERANCE_RANGE = Range(POSITIVE.least, 1e-5, "greater than 0 and 1e-05 at most")


def _singular_mass(link: int) -> StepFailed:
    """Failure of a ``link``, an index, that has no inertia in some direction."""
    return StepFailed(f"the chain's mass matrix is singular at the start, link {link + 1}")


class Model(TrackModel):
    """Chain of cables or beams between ideal pins, integrated implicitly or explicitly."""

    State = State
    kind = ChainKind()

    @classmethod
    def reads(cls, config: Mapping[str, Any]) -> list[str]:
        """See ``ComponentModel``."""
        return [*super().reads(config), "section", "material", "track.bushing.in_series"]

    def link_parameters(self, vehicle: Mapping[str, Any]) -> tuple[Port, ...]:
        """Parameters of element, material, joints, coordinates, integration and closure."""
        return (
            *link_kind_ports(),
            *material_ports(vehicle["material"]),
            *coordinate_ports(),
            *integrator_ports(),
            Port(
                "tolerance",
                "parameter",
                "m",
                "largest Newton correction of a converged step; of beams a tenth of it, of very stiff links less",
                1e-7,
                allowed=TOLERANCE_RANGE,
            ),
            *(closure_ports() if self.closed else ()),
        )

    def shapes(self) -> state.Shapes:
        """Shapes of the views into the chain's state, by name."""
        axes, width = 0, ELEMENTS[self.kind.element].dofs - ELEMENTS[self.kind.element].shared
        if self.kind.axes == "free":
            from fmus.physics.chain.flexible.axes_state import SIZE

            axes = SIZE
        if self.kind.joints == CONSTRAINED:
            from fmus.physics.chain.flexible.constrained import NODE

            width = NODE
        return shapes(
            width,
            self.mesh,
            len(self.wheel_list),
            axes,
            self.on_links_shape,
            self.kind.coordinates == CHOLESKY,
            self.ground_memory,
            self.bushed,
        )

    @property
    def mesh(self) -> int:
        """Number of pins of the mesh."""
        return mesh_size(self.kind, self.links_count, self.closed)

    def prepare(self, p: Mapping[str, Any]) -> None:
        """Make the chain from material and section, as it starts; raises InvalidParameter."""
        if conflict := conflict_of_links(p):
            raise InvalidParameter(conflict)
        self._run_kind = kind = chain_kind(p)
        if kind.axes == "free" and not self.wheel_list:
            raise InvalidParameter("axes = 'free' needs wheels: they turn with what carries them")
        self.closing = None
        if kind.closure == SPRING:
            self.closing = ClosingSpring(p["closure.stiffness"], p["closure.damping"])
        self.material = Material(p["material.youngs_modulus"], p["material.relaxation_time"])
        bent = self.pitch / (self.material.young * self.vehicle["section"]["bending"])
        self.bushing = bushing(self.vehicle["track"], bent)
        self.stiffness = self._axial_stiffness(p)
        asked = p["tolerance"] * (SOLID_PART if ELEMENTS[kind.element].solid else 1.0)
        tolerance = min(asked, self._stiff_tolerance(self.stiffness))
        self.method = ImplicitMethod(integrator_coefficients(p), tolerance, True)
        self._build(kind.at_start())
        self.environment = self.environment._replace(pull=np.ascontiguousarray(self.environment.pull[:, self.kit.AXES]))
        self.work = self._work()
        self.plane = int(not links_turn(p))

    def _build(self, kind: ChainKind) -> None:
        """Make the links and allocate the state of a chain of a kind; raises InvalidParameter."""
        if kind != self.kind:
            self.kind = kind
            self.allocate()
        self.link = chain_links(
            kind, self.vehicle, self.links_count, self.closed, self.material, self.closing, self.bushing
        )
        self.kit = implementation("elements")(type(self.own_links))

    @property
    def stable_step(self) -> float:
        """See ``TrackModel``; joints and coordinates of a run change nothing in it."""
        return stable(self.own_links)

    def begin_run(self) -> None:
        """Carry the start over to the joints and coordinates of the run, and begin as ``TrackModel.begin_run``.

        Raises StepFailed for a singular mass.
        """
        if self.kind != self._run_kind:
            start, nodal, places = self.s, self.state, self._coordinate_indices()
            self._build(self._run_kind)
            if self.kind.joints == CONSTRAINED:
                self.work = self._work()
                own_places = self._coordinate_indices()
                for own, shared in ((self.s.q, start.q), (self.s.v, start.v)):
                    own.reshape(-1)[own_places] = shared.reshape(-1)[places]
                self.evaluate_start()
            else:
                from fmus.physics.chain.flexible import cholesky

                singular = cholesky.factor(self.link, self.environment, self.s, self.work)
                if singular >= 0:
                    raise _singular_mass(singular)
                self.copy_state(nodal)
        super().begin_run()

    def _coordinate_indices(self) -> Integers:
        """Indices in the flat ``s.q`` of the coordinates of all links (links, rows, axes)."""
        return coordinate_indices(self.kit, self.s.q, len(self.work.mass), self.links_count)

    def copy_state(self, state: Floats) -> bool:
        """See ``ComponentModel``; a state of the same chain in nodal coordinates is accepted too."""
        if self.kind.coordinates == NODAL or state.size != self.state.size - self.s.p.size:
            return super().copy_state(state)
        from fmus.physics.chain.flexible.cholesky import to_cholesky

        self.state[self.s.p.size :] = state
        to_cholesky(self.link, self.s, self.work)
        return True

    def free_parameters(self, p: Mapping[str, Any]) -> FreeParameters:
        """See ``TrackModel``; besides, the tolerance and, with an implicit integrator, the relaxation time."""
        free = super().free_parameters(p)
        if p["integrator"] in EXPLICITLY:
            return free
        part = f" * {SOLID_PART!r}" if ELEMENTS[p["element"]].solid else ""
        stiff = self._stiff_tolerance(self._axial_stiffness(p))
        numbers = {"scheme.tolerance": f"min({{tolerance}}{part}, <{stiff!r}>)"}
        tau = "{material.relaxation_time}"
        if part:
            numbers["link.element.tau"] = tau
        else:
            young, s = p["material.youngs_modulus"], self.vehicle["section"]
            numbers["link.element.nuA"] = f"{tau} * <{young * s['area']!r}>"
            numbers["link.element.nuI"] = f"{tau} * <{young * s['bending']!r}>"
        return free._replace(numbers={**free.numbers, **numbers})

    def _work(self) -> Work:
        """Zeroed work arrays of the chain."""
        return work(
            self.kit,
            self.links_count,
            self.mesh,
            len(self.wheel_list),
            self.on_links_shape,
            self.most_points,
            self.ground_memory,
            self.s.rut,
            self.bushed,
        )

    def settle(self, pins: Floats, rest: bool, spin: float = 0.0) -> None:
        """See ``TrackModel``."""
        self.settle_pins(pins)
        if spin:
            if rest:
                self._stretch(spin)
            x, z = self.kit.PLANE.T
            self.s.v[:, x], self.s.v[:, z] = spin * self.s.q[:, z], -spin * self.s.q[:, x]
        self.evaluate_start(rest and not spin)

    def find_equilibrium(self, rows: Floats) -> None:
        """See ``TrackModel``."""
        self.start_rows[:] = rows
        if self.kind.axes != "free" or not rows[0, 11]:
            self._lay_axes()
            self.evaluate_start(rest=True)
            return
        lean = atan2(rows[0, 11], rows[0, 10])
        known, roll, before = lean, 0.5 * lean, self._turning(lean)
        for _ in range(TILTS):  # secant method: the pins' axis lies between the ground and the wheels' axis
            turning = self._turning(roll)
            known, roll, before = roll, roll - turning * (roll - known) / (turning - before), turning

    def _turning(self, roll: float) -> float:
        """Angular acceleration, rad/s2, of free axes at a ``roll``, rad, at which the links come to rest."""
        from fmus.physics.chain.flexible.axes_state import OMEGA_RATE

        self._lay_axes(roll)
        self.evaluate_start(rest=True)
        return float(self.s.axes[OMEGA_RATE])

    def add_rates(self, turning: Floats, velocity: Floats) -> None:
        """See ``TrackModel``; sets the rates of the pins and of the slopes at them."""
        place, *slopes = self.kit.PLANE
        per_link = len(slopes) // 2  # slopes of each of the two links; a shared slope lies along y
        pin = np.arange(self.mesh) % self.nodes  # index in the loop
        self.s.v[:, place] += velocity[pin]
        for vectors, rate in (
            (slopes[-2 * per_link : -per_link], turning[pin - 1]),
            (slopes[-per_link:], turning[pin]),
        ):
            for x, z in vectors:
                self.s.v[:, x] += rate * self.s.q[:, z]
                self.s.v[:, z] -= rate * self.s.q[:, x]
        self.evaluate_start()

    def tighten(self) -> None:
        """Deform the links to the tension of the release, so that no waves start; raises StepFailed."""
        from fmus.physics.chain.flexible.consistent_start import OpenChain, balance_links

        self.work.wheels[:] = self.start_rows
        chain = OpenChain(self.kit, self.s.q, self.work.mass, self.pitch, self.ends_kind == PINNED)
        if not balance_links(chain, self._residuals, self._rest_tolerance()):
            raise StepFailed("the tension at which the chain is let go was not found: its links are too soft")
        self.evaluate_start()

    def evaluate(self, motion: Motion, by: Slopes = NOTHING, fresh: bool = False) -> None:
        """Evaluate residuals, and with ``fresh`` matrices, of a motion into ``work``; see ``assembly``."""
        self._run_release(EVALUATE, motion, by, fresh)

    def _residuals(self, accelerations: Floats) -> Floats:
        """Residuals of the links (links, rows, axes), N, at rest with the accelerations (nodes, width)."""
        self.evaluate(Motion(self.s.q, self.work.still, accelerations, self.s.axes))
        return self.work.residual

    def _axial_stiffness(self, p: Mapping[str, Any]) -> float:
        """Axial stiffness of a link, or of the spring that closes the chain if that is larger, N."""
        closing = p["closure.stiffness"] * self.pitch if chain_kind(p).closure == SPRING else 0.0
        return max(p["material.youngs_modulus"] * self.vehicle["section"]["area"], closing)

    def _stiff_tolerance(self, stiffness: float) -> float:
        """Largest tolerance of Newton's iteration, m, at which the forces of pins are known to ``PIN_ERROR``.

        The last correction dx is not in the force that all pins share (``pins.py``): that is off by about its axial
        part, dx times the turn of a link since the matrix was new, at most CHORD over its length, times the stiffness.
        """
        weight = self.links_count * float(self.vehicle["track"]["mass"]) * 9.81
        return PIN_ERROR * weight * self.pitch**2 / (CHORD * stiffness)

    def _rounding(self) -> float:
        """Axial force, N, from rounding of the pins' positions: no residual is reliably smaller."""
        return 4.0 * float(np.finfo(float).eps) * self.stiffness * self.links_count

    def _rest_tolerance(self) -> float:
        """Largest residual of static equilibrium, N."""
        light = REST_ACCELERATION * float(self.vehicle["track"]["mass"])
        return max(min(REST_RESIDUAL, light), self._rounding())

    def settle_pins(self, pins: Floats) -> None:
        """Set the state to straight links at rest between the ``pins`` (nodes, 2), m."""
        self.state[:] = 0.0
        straight(self.kit, self.link, pins[np.arange(self.mesh) % self.nodes], self.s.q)
        self._lay_axes()

    def _lay_axes(self, roll: float = 0.0) -> None:
        """Set axes that turn to those at rest at the start, with the wheels at ``start_rows`` and a ``roll``, rad."""
        if self.kind.axes == "free":
            from fmus.physics.chain.flexible.axes_state import begin as lay

            low = float(self.s.q[:, self.kit.PLANE[0][1]].min())
            lay(self.s.axes, self.start_rows[:, :3], roll, low, self.vehicle["guide"]["clearance"])

    def _stretch(self, spin: float) -> None:
        """Set a free loop to its equilibrium relative to a rotation at ``spin`` rad/s; raises StepFailed."""
        from fmus.physics.chain.flexible.spinning import deform_open_mesh, deform_polygon

        loop = self.kit, self.s.q, len(self.work.mass), self.links_count, spin
        converged = deform_polygon(*loop, self._residuals, self._rounding())
        if converged and self.closing:
            converged = deform_open_mesh(*loop, self.closing.stiffness, self._residuals, self._rounding())
        if not converged:
            raise StepFailed(
                f"the loop that spins at {spin:g} rad/s has no relative equilibrium: its links are too soft"
            )

    def evaluate_start(self, rest: bool = False) -> None:
        """Evaluate accelerations and outputs of the start, with ``rest`` after equilibrium; raises StepFailed."""
        if self.kind.joints == CONSTRAINED:  # already at its start: equilibrium is not compiled for these links
            link = start_released(*self.system(), self.start_rows, self.s, self.work, self.report)
            failure, residual = SINGULAR if link >= 0 else DONE, 0.0
        else:
            # a belt without teeth slides on to a place of rest, far away at times
            for _ in range(20 if any(wheel["kind"] == "driving" for wheel in self.wheel_list) else 1):
                failure, _, link, residual = self._run_release(REST if rest else RELEASED)
                if failure != STALLED:
                    break
        if failure == SINGULAR:
            raise _singular_mass(link)
        if failure:
            raise not_at_rest(link, residual)

    def _run_release(
        self, task: int, motion: Motion | None = None, by: Slopes = NOTHING, fresh: bool = False
    ) -> IntegrationOutcome:
        """Do a task of ``release``, whose static equilibrium is without friction but for that on a slope."""
        motion = motion or Motion(self.s.q, self.s.v, self.s.vdot, self.s.axes)
        partners, least, env = self.contacts, self._rest_tolerance(), self.rest_environment(self.start_rows)
        link = self.link
        if self.rotary_factor != 1.0 and not ELEMENTS[self.kind.element].solid:  # those need no larger one
            inertia = self.rotary_factor * self.vehicle["track"]["inertia"][1]
            link = link._replace(element=link.element._replace(rotary=inertia))
        if partners is not None:
            from fmus.track.contacts import at_rest, settling

            partners = at_rest(settling(partners, 0.0), env.gravity)
        longest = LAST_PSEUDO_STEP if self.ends_kind == PINNED else 0.0
        outcome: IntegrationOutcome = release(
            link, self.contacts, self.environment, task, Evaluation(motion, by, fresh),
            Rest(partners, env, self.start_rows, least, longest),
            self.s, self.work, self.report,
        )  # fmt: skip
        return outcome
