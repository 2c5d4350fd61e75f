"""Flexible track: a chain of steel cables or beams behind the ports of a track."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.interface.model import Floats, FreeParameters, InvalidParameter, StepFailed
from fmus.interface.ports import POSITIVE, Port, Range
from fmus.kernels.jit import implementation
from fmus.physics.ancf import rotary
from fmus.physics.ancf.element import ELASTICITIES
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
from fmus.physics.chain.flexible.link_layout import PIN_WIDTH, coordinate_indices, straight
from fmus.physics.chain.flexible.state import Motion, State, Work, shapes, work
from fmus.physics.chain.implicit import ImplicitMethod
from fmus.physics.chain.integration import DONE, PINNED, SINGULAR, IntegrationOutcome
from fmus.physics.elementary import atan2
from fmus.physics.integrate.generalized_alpha import Slopes
from fmus.track.choices import (
    ADAMS,
    CHOLESKY,
    CONSTRAINED,
    ELIMINATED,
    EXPLICIT,
    NODAL,
    conflict_of_links,
)
from fmus.track.model import TrackModel
from fmus.track.parameters import PIN, SPRING, closure_ports, integrator_coefficients, integrator_ports
from fmus.track.start import not_at_rest
from fmus.track_flexible import parameters

REST_RESIDUAL = 1e-3  # residual of static equilibrium, N, or if that is less:
REST_ACCELERATION = 1e-4  # that residual over the mass of a link, m/s2
LAST_PSEUDO_STEP = 10.0  # last pseudo step of a chain between pins, s: its slowest modes come to rest too
TILTS = 2  # corrections of the roll of free axes at rest
SHEAR = 5.0 / 6.0  # correction of a beam's shear stiffness, rectangular section
BEAM_PART = 0.1  # part of the tolerance that holds for beams, whose sections strain by more than their pins move
TOLERANCE_RANGE = Range(POSITIVE.least, 1e-5, "greater than 0 and 1e-05 at most")


class Model(TrackModel):
    """Chain of cables or beams between ideal pins, integrated implicitly or explicitly."""

    State = State
    element, axes, closure, joints, coordinates = "cable", "fixed", PIN, ELIMINATED, NODAL

    @classmethod
    def reads(cls, config: Mapping[str, Any]) -> list[str]:
        """See ``ComponentModel``."""
        return [*super().reads(config), "section", "material"]

    def link_parameters(self, vehicle: Mapping[str, Any]) -> tuple[Port, ...]:
        """Parameters of element, material, joints, coordinates, integration and closure."""
        return (
            *parameters.link_kind_ports(tuple(PIN_WIDTH)),
            *parameters.material_ports(vehicle["material"]),
            *parameters.coordinate_ports(),
            *integrator_ports(),
            Port(
                "tolerance",
                "parameter",
                "m",
                "largest Newton correction of a converged step; of beams a tenth of it",
                1e-7,
                allowed=TOLERANCE_RANGE,
            ),
            *(closure_ports() if self.closed else ()),
        )

    def shapes(self) -> state.Shapes:
        """Shapes of the views into the chain's state, by name."""
        axes = 0
        if self.axes == "free":
            from fmus.physics.chain.flexible.axes_state import SIZE

            axes = SIZE
        width = PIN_WIDTH[self.element]
        if self.joints == CONSTRAINED:
            from fmus.physics.chain.flexible.constrained import NODE

            width = NODE
        return shapes(
            width,
            self.mesh,
            len(self.wheel_list),
            axes,
            self.on_links_shape,
            self.coordinates == CHOLESKY,
            self.ground_memory,
        )

    @property
    def mesh(self) -> int:
        """Number of pins of the mesh: one more with a closing spring, 2 a link with constrained joints."""
        return 2 * self.links_count if self.joints == CONSTRAINED else self.nodes + (self.closure == SPRING)

    def prepare(self, p: Mapping[str, Any]) -> None:
        """Make the links from material and section, allocate state and work; raises InvalidParameter."""
        if conflict := conflict_of_links(p):
            raise InvalidParameter(conflict)
        element, elasticity, axes = p["element"], p["elasticity"], p["axes"]
        if axes == "free" and not self.wheel_list:
            raise InvalidParameter("axes = 'free' needs wheels: they turn with what carries them")
        young, tau = p["material.youngs_modulus"], p["material.relaxation_time"]
        closed_by = p.get("closure", PIN)
        self.closing = ClosingSpring(p["closure.stiffness"], p["closure.damping"]) if closed_by == SPRING else None
        beam = element == "beam"
        tolerance = p["tolerance"] * (BEAM_PART if beam else 1.0)
        self.method = ImplicitMethod(integrator_coefficients(p), tolerance, True)
        self.link = self._beams(young, tau) if beam else self._cables(element, elasticity, axes, young, tau)
        self._nodal_link = self.link
        axial = young * self.vehicle["section"]["area"]
        self.stiffness = max(axial, self.closing.stiffness * self.pitch if self.closing else 0.0)  # axial, N
        self.kit = implementation("elements")(type(self.link))
        kind = element, axes, closed_by, ELIMINATED, NODAL  # every chain starts so, see ``begin_run``
        if kind != (self.element, self.axes, self.closure, self.joints, self.coordinates):
            self.element, self.axes, self.closure, self.joints, self.coordinates = kind
            self.allocate()
        self.environment = self.environment._replace(pull=np.ascontiguousarray(self.environment.pull[:, self.kit.AXES]))
        self.work = self._work(self.kit)
        self._run_formulation = p["joints"], p["coordinates"]
        self.plane = int(element != "beam" and axes == "fixed")

    @property
    def stable_step(self) -> float:
        """See ``TrackModel``; joints and coordinates of a run change nothing in it."""
        return stable(self._nodal_link)

    def begin_run(self) -> None:
        """Change to the wanted joints and coordinates, then begin as ``TrackModel.begin_run``."""
        joints, coordinates = self._run_formulation
        if joints == CONSTRAINED and self.joints == ELIMINATED:
            self._constrain()
        if coordinates == CHOLESKY and self.coordinates == NODAL:
            self._transform()
        super().begin_run()

    def _transform(self) -> None:
        """Change to Cholesky coordinates, stored before the nodal ones; raises StepFailed for a singular mass."""
        from fmus.physics.chain.flexible import cholesky

        nodal, layout = self.state, self.kit.LAYOUT
        self.link = cholesky.cholesky_links(self.link, len(layout.own), (self.mesh, len(layout.shared)))
        self.coordinates = CHOLESKY
        self.allocate()
        singular = cholesky.factor(self.link, self.environment, self.s, self.work)
        if singular >= 0:
            raise StepFailed(f"the chain's mass matrix is singular at the start, link {singular + 1}")
        self.copy_state(nodal)

    def copy_state(self, state: Floats) -> bool:
        """See ``ComponentModel``; a state of the same chain in nodal coordinates is accepted too."""
        if self.coordinates == NODAL or state.size != self.state.size - self.s.p.size:
            return super().copy_state(state)
        from fmus.physics.chain.flexible.cholesky import to_cholesky

        self.state[self.s.p.size :] = state
        to_cholesky(self.link, self.s, self.work)
        return True

    def _constrain(self) -> None:
        """Change to links with own coordinates and constrained joints, and evaluate their accelerations."""
        from fmus.physics.chain.flexible import constrained

        eliminated, rows = self.s, len(self.work.M)
        old_places = coordinate_indices(self.kit, eliminated.q, rows, self.links_count)
        self.joints, self.kit, self.link = CONSTRAINED, constrained, constrained.ConstrainedCables(*self.link)
        self.allocate()
        new_places = coordinate_indices(constrained, self.s.q, rows, self.links_count)
        for new, old in ((self.s.q, eliminated.q), (self.s.v, eliminated.v)):
            new.reshape(-1)[new_places] = old.reshape(-1)[old_places]
        self.work = self._work(constrained)
        self._evaluate_start()

    def compile(self, parameters: Mapping[str, float | int | str]) -> None:
        """Compile the kernels of a run; those of the start take as long and are compiled by the one who starts."""
        self.read(parameters)
        self.begin_run()
        self.compile_run()

    def free_parameters(self, p: Mapping[str, Any]) -> FreeParameters:
        """See ``TrackModel``; besides, the tolerance and, with an implicit integrator, the relaxation time."""
        free = super().free_parameters(p)
        if p["integrator"] in (EXPLICIT, ADAMS):
            return free
        tau, numbers = "{material.relaxation_time}", {"scheme.tolerance": "{tolerance}"}
        if p["element"] == "beam":
            numbers |= {"link.element.tau": tau, "scheme.tolerance": f"{{tolerance}} * {BEAM_PART!r}"}
        else:
            young, s = p["material.youngs_modulus"], self.vehicle["section"]
            numbers["link.element.nuA"] = f"{tau} * <{young * s['area']!r}>"
            numbers["link.element.nuI"] = f"{tau} * <{young * s['bending']!r}>"
        return free._replace(numbers={**free.numbers, **numbers})

    def _work(self, links_module: Any) -> Work:
        """Work arrays of a chain of the links of a module."""
        touching = self.contacts is not None
        return work(
            links_module,
            self.links_count,
            self.mesh,
            len(self.wheel_list),
            self.on_links_shape,
            touching,
            self.ground_memory,
            self.s.rut,
        )

    def _cables(self, element: str, elasticity: str, turning: str, young: float, tau: float) -> Any:
        if element == "planar":
            from fmus.physics.chain.flexible.planar import PlanarCables

            kind: Any = PlanarCables
            axes: tuple[int, ...] = (0, 2)
        else:
            from fmus.physics.chain.flexible.cables import Cables

            kind, axes = Cables, (0, 1, 2)
        s, v = self.vehicle["section"], self.vehicle
        area, second = s["area"], s["bending"]
        cable = ELASTICITIES[elasticity](
            self.pitch,
            v["track"]["mass"] / self.pitch,
            young * area,
            young * second,
            tau * (young * area),
            tau * (young * second),
            axes,
            self._rotary_of_cables(),
        )
        common = self.links_count, int(self.closed), cable, v["track"]["face"], s["outer_fibre"], area, second
        if turning == "free":
            from fmus.physics.chain.flexible.turning import TurningCables

            track = v["track"]
            across = rotary.second_moments(track["inertia"])[1]
            if across <= 0.0:
                raise self._inertia_error(1)
            lateral_bending, twist = young * (s["lateral_bending"] - second), self.links_count * across
            return TurningCables(*common, 0.25 * track["width"], lateral_bending, twist, self.closing)
        return kind(*common, self.closing)

    def _beams(self, young: float, tau: float) -> Any:
        """Beams with a rectangle of the section's radii of gyration, moduli scaled to its area, a link's mass."""
        from fmus.physics.chain.flexible.beams import Beam, Beams

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
        more = self._rotary_of_beams(width, height)
        beam = Beam(self.pitch, width, height, rho, scale * young, poisson, SHEAR, twist, True, tau, more)
        return Beams(
            self.links_count,
            int(self.closed),
            beam,
            track["face"],
            0.25 * track["width"],
            s["outer_fibre"],
            s["area"],
            young,
            self.closing,
        )

    def _rotary_of_cables(self) -> float:
        """Inertia of a link about its pin less that of a rod, kg m2; raises InvalidParameter."""
        mass, pin = self.vehicle["track"]["mass"], self.vehicle["track"]["inertia"][1]
        rod, least = mass * self.pitch**2 / 12.0, rotary.NONE
        if pin < least * rod:
            raise InvalidParameter(
                f"vehicle.track.inertia[1] = {pin:g} kg m2, about the pin: must be at least {least:g} of a rod's of"
                f" {mass:g} kg and {self.pitch:g} m, {least * rod:.6g} kg m2, or a cable's mass matrix is singular"
            )
        return float(pin - rod)

    def _rotary_of_beams(self, width: float, height: float) -> tuple[float, float, float]:
        """Second moments of a link's mass less those of the beam's section, kg m2; raises InvalidParameter."""
        mass, moments = self.vehicle["track"]["mass"], rotary.second_moments(self.vehicle["track"]["inertia"])
        section_moments = tuple(float(mass * size * size / 12.0) for size in (self.pitch, width, height))
        for axis, (moment, section) in enumerate(zip(moments, section_moments, strict=True)):
            if moment < rotary.NONE * section:
                raise self._inertia_error(axis)
        x, y, z = (moment - section for moment, section in zip(moments, section_moments, strict=True))
        return x, y, z

    def _inertia_error(self, axis: int) -> InvalidParameter:
        """Error for an inertia that no body has about the ``axis`` (0 to 2) of a link."""
        inertia = self.vehicle["track"]["inertia"]
        return InvalidParameter(
            f"vehicle.track.inertia[{axis}] = {inertia[axis]:g} kg m2: must be less than the sum of the other two,"
            f" {sum(inertia) - inertia[axis]:g} kg m2 (no body has more), or the chain's mass matrix is not positive"
            " definite"
        )

    def settle(self, pins: Floats, rest: bool, spin: float = 0.0) -> None:
        """See ``TrackModel``."""
        self.settle_pins(pins)
        if spin:
            if rest:
                self._stretch(spin)
            x, z = self.kit.PLANE.T
            self.s.v[:, x], self.s.v[:, z] = spin * self.s.q[:, z], -spin * self.s.q[:, x]
        self._evaluate_start(rest and not spin)

    def find_equilibrium(self, rows: Floats) -> None:
        """See ``TrackModel``."""
        self.start_rows[:] = rows
        if self.axes != "free" or not rows[0, 11]:
            self._lay_axes()
            self._evaluate_start(rest=True)
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
        self._evaluate_start(rest=True)
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
        self._evaluate_start()

    def tighten(self) -> None:
        """Deform the links to the tension of the release, so that no waves start; raises StepFailed."""
        from fmus.physics.chain.flexible.consistent_start import OpenChain, balance_links

        self.work.wheels[:] = self.start_rows
        chain = OpenChain(self.kit, self.s.q, self.work.M, self.pitch, self.ends_kind == PINNED)
        if not balance_links(chain, self._residuals, self._rest_tolerance()):
            raise StepFailed("the tension at which the chain is let go was not found: its links are too soft")
        self._evaluate_start()

    def evaluate(self, motion: Motion, by: Slopes = NOTHING, fresh: bool = False) -> None:
        """Evaluate residuals, and with ``fresh`` matrices, of a motion into ``work``; see ``assembly``."""
        self._run_release(EVALUATE, motion, by, fresh)

    def _residuals(self, accelerations: Floats) -> Floats:
        """Residuals of the links (links, rows, axes), N, at rest with the accelerations (nodes, width)."""
        self.evaluate(Motion(self.s.q, self.work.still, accelerations, self.s.axes))
        return self.work.R

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
        if self.axes == "free":
            from fmus.physics.chain.flexible.axes_state import begin as lay

            low = float(self.s.q[:, self.kit.PLANE[0][1]].min())
            lay(self.s.axes, self.start_rows[:, :3], roll, low, self.vehicle["guide"]["clearance"])

    def _stretch(self, spin: float) -> None:
        """Set a free loop to its equilibrium relative to a rotation at ``spin`` rad/s; raises StepFailed."""
        from fmus.physics.chain.flexible.spinning import deform_open_mesh, deform_polygon

        loop = self.kit, self.s.q, len(self.work.M), self.links_count, spin
        converged = deform_polygon(*loop, self._residuals, self._rounding())
        if converged and self.closing:
            converged = deform_open_mesh(*loop, self.closing.stiffness, self._residuals, self._rounding())
        if not converged:
            raise StepFailed(
                f"the loop that spins at {spin:g} rad/s has no relative equilibrium: its links are too soft"
            )

    def _evaluate_start(self, rest: bool = False) -> None:
        """Evaluate accelerations and outputs of the start, with ``rest`` after equilibrium; raises StepFailed."""
        if self.joints == CONSTRAINED:  # already at its start: equilibrium is not compiled for these links
            link = start_released(*self.system(), self.start_rows, self.s, self.work, self.report)
            failure, residual = SINGULAR if link >= 0 else DONE, 0.0
        else:
            failure, _, link, residual = self._run_release(REST if rest else RELEASED)
        if failure == SINGULAR:
            raise StepFailed(f"the chain's mass matrix is singular at the start, link {link + 1}")
        if failure:
            raise not_at_rest(link, residual)

    def _run_release(
        self, task: int, motion: Motion | None = None, by: Slopes = NOTHING, fresh: bool = False
    ) -> IntegrationOutcome:
        """Do a task of ``release``, whose static equilibrium is without friction but for that on a slope."""
        motion = motion or Motion(self.s.q, self.s.v, self.s.vdot, self.s.axes)
        partners, least, env = self.contacts, self._rest_tolerance(), self.rest_environment(self.start_rows)
        link = self.link
        if self.rotary_factor != 1.0 and self.element != "beam":  # beams find the equilibrium without
            inertia = self.rotary_factor * self.vehicle["track"]["inertia"][1]
            link = link._replace(element=link.element._replace(rotary=inertia))
        if partners is not None:
            from fmus.track.contacts import at_rest, without_friction

            partners = at_rest(without_friction(partners), env.gravity)
        longest = LAST_PSEUDO_STEP if self.ends_kind == PINNED else 0.0
        outcome: IntegrationOutcome = release(
            link, self.contacts, self.environment, task, Evaluation(motion, by, fresh),
            Rest(partners, env, self.start_rows, least, longest),
            self.s, self.work, self.report,
        )  # fmt: skip
        return outcome
