"""Base of both track models: ports, parameters, the start layout, and the frame of the track.

The frame of a track is at the vehicle's start position, turned by its start heading and tilted as the ground there,
with the track plane at y = 0: the joint axis is y and the ground level for every start, and the numbers are small.

The module is long because ports, layout and start of all chains are methods of one base class on the same fields.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

import fmus.track_steps as steps
from fmus import drawn_wheels, link_outputs
from fmus.defaults import configured_ports, parameter_values
from fmus.jit import plain
from fmus.model import ComponentModel, FreeParameters, InvalidParameter, StepFailed
from fmus.physics.arrays import Floats
from fmus.physics.chain import state
from fmus.physics.chain.explicit import adams, slopes
from fmus.physics.chain.implicit import ImplicitMethod
from fmus.physics.chain.integration import (
    HELD,
    LOOP,
    PINNED,
    PULLED,
    Environment,
)
from fmus.physics.chain.interface import pin_places
from fmus.physics.chain.layout import (
    catenary,
    chain_of_angles,
    closed_polygon,
    folded,
    hanging_arc,
    ovalling,
    over_sprocket,
    regular_polygon,
    rescaled,
)
from fmus.physics.chain.report import COUNTERS, REPORT
from fmus.physics.elementary import hypot, sin
from fmus.physics.vector import scale
from fmus.physics.wheels import WIDTH, read_states
from fmus.ports import (
    NOT_NEGATIVE,
    POSITIVE,
    STATE,
    Port,
    Range,
    motion_ports,
    start_pose_ports,
    wrench_ports,
)
from fmus.sentences import Sentence
from fmus.stance import Stance, part_at_rest, stance
from fmus.standing import ground_level
from fmus.start import FRAME, HEIGHT, KEYS, LEVEL, StartPose, start_pose
from fmus.track_choices import ADAMS, EXPLICIT, HHT, IMPLICIT, INTEGRATORS
from fmus.track_failures import OFF_ITS_PLACE, RUT_SENTENCE, WARNING_SENTENCES, failure_sentences

# Outputs of a chain after the wrenches, in the order of its report (``chain.report``): name, unit, text.
OUTPUTS = (
    ("travel", "m", "length of chain that has passed a point of the vehicle, along its own index"),
    ("speed", "m/s", "speed of the chain along itself, seen from the vehicle, mean of its straight runs"),
    ("tension.min", "N", "smallest link tension"),
    ("tension.mean", "N", "mean link tension"),
    ("tension.max", "N", "largest link tension"),
    ("stress.max", "Pa", "largest axial stress at an outer fibre, 0 for rigid links"),
    ("energy.kinetic", "J", "kinetic energy of the links"),
    ("energy.strain", "J", "strain energy of the links and of a closing spring"),
    ("energy.gravity", "J", "potential energy of the links over the origin of the start frame"),
    ("energy.contact", "J", "energy stored in contact springs"),
    ("energy.dissipated", "J", "energy lost by friction and damping, the sum of its causes"),
    ("energy.work", "J", "work done so far by the loads on the ends"),
    ("penetration.max", "m", "deepest penetration of any contact"),
    ("ground.force.x", "N", "force of the ground on the chain, x, world, mean over the step"),
    ("ground.force.y", "N", "force of the ground on the chain, y, world, mean over the step"),
    ("ground.force.z", "N", "force of the ground on the chain, z, world, mean over the step"),
    (
        "slip",
        "m/s",
        "rearward velocity of the ground contact points along the vehicle's present heading, weighted by their load",
    ),
    ("energy.covered", "J", "energy lost so far as spread contacts come to cover other parts of a link"),
    ("energy.dissipated.ground_friction", "J", "energy lost by friction of links on the ground"),
    ("energy.dissipated.ground_damping", "J", "energy lost by normal damping of the ground"),
    ("energy.dissipated.wheel_friction", "J", "energy lost by friction of links on rims"),
    ("energy.dissipated.wheel_damping", "J", "energy lost by normal damping of rims"),
    ("energy.dissipated.tooth_friction", "J", "energy lost by friction of pins on teeth"),
    ("energy.dissipated.tooth_damping", "J", "energy lost by normal damping of teeth"),
    ("energy.dissipated.guides", "J", "energy lost by friction and damping of guide horns on wheels"),
    ("energy.dissipated.material", "J", "energy lost by damping of the material of links"),
    ("energy.dissipated.joints", "J", "energy lost by damping of pins across the chain and of a closing spring"),
)
ON_SOIL = {  # texts of outputs that are others on soil
    "penetration.max": "deepest penetration of a contact with a wheel or a tooth",
    "energy.contact": "energy stored in contact springs and in sheared and pressed soil",
    "energy.dissipated.ground_friction": "energy lost by shear of the soil",
    "energy.dissipated.ground_damping": "energy lost by compaction and normal damping of the soil",
}
INTERVALS = Range(1.0, 1e6, "a whole number from 1 to 1e6")


def not_at_rest(link: int, residual: float) -> StepFailed:
    """Failure of the search for static equilibrium; the ``residual``, N, is that of a ``link``, an index."""
    return StepFailed(
        f"static equilibrium of the track was not found: {residual:.3g} N are left on link {link + 1};"
        " start = 'polygon' needs none"
    )


# Rotary inertia of links that sink, over their own: deep soil holds a link up far below its centre, so that its level
# place is an equilibrium on an edge, and a search in which links may turn at once tips them over.
SINKING = 1e6
LOWERED = 0.05  # m, by which wheels go into soil at a time as a chain comes to rest
KINDS = {"pinned": PINNED, "pulled": PULLED, "held": HELD}
STARTS = {
    "rest": "static equilibrium, of a loop that spins relative to its turning",
    "polygon": "as laid out",
    "displaced": "equilibrium of ends 0.7 S apart, its link angles scaled to the span",
    "straight": "level, along x",
    "folded": "down, one link across, and up again",
}


def start_stance(wheel: Mapping[str, Any]) -> Stance:
    """Stance of a wheel of a track's config at the start, y from the track plane; as drawn by default."""
    x, z = wheel["position"]
    return stance(wheel.get("start", (x, 0.0, z)))


class TrackModel(ComponentModel):
    """Chain of links with the ports of a track; a subclass adds the mechanics of its links.

    The subclass implements ``shapes``, ``stable_step``, ``prepare``, ``settle``, ``find_equilibrium`` and
    ``add_rates``; ``prepare`` sets ``link``, ``method`` and ``work``.
    """

    start_kernel, step_kernel = staticmethod(steps.begin), staticmethod(steps.implicit)
    output_kernel, link_output_kernel = staticmethod(steps.write_outputs), staticmethod(steps.write_link_outputs)
    start_parameters = *KEYS, "start.lateral"
    warning_sentences: tuple[Sentence, ...] = WARNING_SENTENCES
    plane = 0  # 1: links that stay in their plane
    State: Any  # class of the state's views
    link: Any  # parameters of the links
    method: ImplicitMethod  # of the implicit integrator
    work: Any  # scratch arrays

    @classmethod
    def reads(cls, config: Mapping[str, Any]) -> list[str]:
        """See ``ComponentModel``."""
        track = config["track"]
        wheels, ground = track["wheels"], bool(track["ground"])
        shaped = ["teeth", "pin_radius", "outer_radius", "seat_clearance", "flank_angle", "tip_radius"]
        return [
            *(f"track.{key}" for key in ("pitch", "mass", "inertia", "face", "width", "lateral")),
            *(f"sprocket.{key}" for key in (shaped if wheels or ground else shaped[:1])),
            *drawn_wheels.keys(wheels),
            *(("road_wheel.radius", "road_wheel.z") if ground or not wheels else ()),
            "guide.clearance",
            "contact",
        ]

    def __init__(self, config: Mapping[str, Any]) -> None:
        """Make a track from the resolved config (keys vehicle, track, link_outputs) and allocate its arrays.

        Wheels of ``track.wheels`` have a name, a kind ("teeth" or "rim") and a stance ``start``, by default as drawn.
        """
        self.vehicle = config["vehicle"]
        self.config = config["track"]
        self.wheel_list = drawn_wheels.drawn(self.vehicle, self.config["wheels"])
        self.links_count = int(self.config["links"])
        self.closed = bool(self.config["closed"])
        self.ends_kind = KINDS[self.config["ends"]["kind"]] if self.config.get("ends") else LOOP
        self.nodes = self.links_count if self.closed else self.links_count + 1
        self.pitch = float(self.vehicle["track"]["pitch"])
        wheels = len(self.wheel_list)
        self.rows = np.zeros((wheels, WIDTH))
        self.start_rows = np.zeros((wheels, WIDTH))
        self.frame = np.zeros(FRAME)
        self.link_groups = link_outputs.chosen_groups(config.get("link_outputs", True), bool(self.config["ground"]))
        self.on_links_shape = link_outputs.on_links_shape(self.link_groups, self.nodes)
        self.ports = self._ports(config)
        self.link_ports = len(link_outputs.ports(self.link_groups, self.links_count, self.nodes))
        self.counters = np.zeros(COUNTERS, dtype=np.int64)
        self.inputs = STATE * wheels
        names = [wheel["name"] for wheel in self.wheel_list]
        self.failures = failure_sentences(names)
        self.ground_memory = self._ground_memory()
        self.warning_sentences = (*WARNING_SENTENCES, Sentence(OFF_ITS_PLACE, tuple(names)))
        if self.ground_memory != state.HARD:
            self.warning_sentences += (RUT_SENTENCE,)
        self.allocate()

    def _ground_memory(self) -> state.GroundMemory:
        """Sizes of what the ground remembers under the chain."""
        if not self.config.get("soil"):
            return state.HARD
        from fmus.physics.contact.soil.memory import MEMORY, PENDING
        from fmus.physics.contact.soil.rut import RUT
        from fmus.physics.point import ON_FACE

        return state.GroundMemory(ON_FACE * self.links_count, MEMORY, PENDING, RUT)

    def allocate(self) -> None:
        """Allocate the zeroed state and its views; again where a parameter changes the size of the chain."""
        shapes = self.shapes()
        size = state.size(shapes)
        self.state = np.zeros(size + REPORT + len(steps.WARNINGS))
        self.s = state.views(self.State, shapes, self.state[:size])
        self.report, self.given_warnings = self.state[size : size + REPORT], self.state[size + REPORT :]

    def _ports(self, config: Mapping[str, Any]) -> tuple[Port, ...]:
        vehicle, ports = self.vehicle, []
        text = "lateral position of the track plane in the vehicle, left positive"
        pose_ports = [*start_pose_ports(), Port("start.lateral", "parameter", "m", text, vehicle["track"]["lateral"])]
        pose_values = {port.name: port.start for port in configured_ports(pose_ports, config)}
        pose, lateral = start_pose(pose_values), float(pose_values["start.lateral"])
        for wheel in self.wheel_list:
            x, y, *rest = start_stance(wheel)
            ports += motion_ports(wheel["name"], "input", plain(part_at_rest)(pose, stance((x, y + lateral, *rest))))
        for wheel in self.wheel_list:
            ports += wrench_ports(wheel["name"], "output")
        other = ON_SOIL if self.config.get("soil") else {}
        ports += [Port(name, "output", unit, other.get(name, text)) for name, unit, text in OUTPUTS]
        ports += link_outputs.ports(self.link_groups, self.links_count, self.nodes)
        for name in ("steps", "evaluations", "iterations", "rejected"):
            ports.append(Port(f"solver.{name}", "output", "1", f"{name} of the integrator so far", 0))
        ports += pose_ports
        starts = {PINNED: ("rest", "polygon", "displaced"), HELD: ("straight", "folded")}.get(
            self.ends_kind, ("rest", "polygon")
        )
        text = "; ".join(f"{start}: {STARTS[start]}" for start in starts)
        ports.append(Port("start", "parameter", "1", text, starts[0], starts))
        if self._is_free_loop():
            ports.append(Port("start.spin", "parameter", "rad/s", "turning of the loop about y at the start"))
            text = "turning of links by this times cos(2 angle) at the start besides: the loop becomes oval"
            ports.append(Port("start.ovalling", "parameter", "rad/s", text))
        ports.append(
            Port(
                "integrator",
                "parameter",
                "1",
                "time integration of the chain",
                INTEGRATORS[0],
                INTEGRATORS,
            )
        )
        ports.append(Port("step", "parameter", "s", "largest internal step", 1e-3, allowed=POSITIVE))
        text = "communication steps over which forces, sliding and depth of links are means, a whole number"
        ports.append(Port(link_outputs.INTERVAL, "parameter", "1", text, 1.0, allowed=INTERVALS))
        kinds = {wheel["kind"] for wheel in self.wheel_list}
        hard = bool(self.config["ground"]) and not self.config.get("soil")
        existing = {"sprocket": "teeth" in kinds, "wheel": bool(kinds), "ground": hard}
        for pair in (pair for pair, exists in existing.items() if exists):
            from fmus.physics.contact.laws import LAWS  # of chains that touch something

            law, text = vehicle["contact"][pair], f"normal law of {pair} contact"
            ports.append(Port(f"contact.{pair}.law", "parameter", "1", text, law["law"], tuple(LAWS)))
            for key, unit, text, allowed in (
                ("stiffness", "N/m", "normal stiffness", NOT_NEGATIVE),
                ("damping", "N.s/m", "normal damping", NOT_NEGATIVE),
                ("friction", "1", "friction coefficient", NOT_NEGATIVE),
                ("friction_velocity", "m/s", "regularisation velocity of friction", POSITIVE),
            ):
                name, text = f"contact.{pair}.{key}", f"{text} of {pair} contact"
                ports.append(Port(name, "parameter", unit, text, law[key], allowed=allowed))
        return tuple(ports) + self.link_parameters(vehicle)

    def link_parameters(self, vehicle: Mapping[str, Any]) -> tuple[Port, ...]:
        """Parameters of this kind of links alone."""
        return ()

    def _is_free_loop(self) -> bool:
        """Whether the chain is a loop without wheels."""
        return self.closed and not self.wheel_list

    def initialise(self, parameters: Mapping[str, float | int | str]) -> None:
        """Lay the chain out and, unless ``start`` says otherwise, bring it to rest on its wheels.

        Raises InvalidParameter, StepFailed.
        """
        p = self.read(parameters)
        self.lay_out(p["start"], p.get("start.spin", 0.0))
        oval = p.get("start.ovalling", 0.0)
        if oval:
            if self.links_count < 4:
                raise InvalidParameter(f"start.ovalling = {oval}: a triangle of links is rigid, it must be 0")
            self.add_rates(*ovalling(self.pins()[:, [0, 2]], oval))
        self.begin_run()

    def read(self, parameters: Mapping[str, float | int | str]) -> Mapping[str, Any]:
        """Read the parameters and prepare links and contacts; returns all of them. Raises InvalidParameter."""
        p = parameter_values(self.ports, parameters)
        self.pose = start_pose(p)
        self.max_step, self.integrator, self.interval = p["step"], p["integrator"], p[link_outputs.INTERVAL]
        if self.interval != round(self.interval):
            raise InvalidParameter(f"{link_outputs.INTERVAL} = {self.interval:g}: must be a whole number")
        if self.config.get("soil") and p["integrator"] in (EXPLICIT, ADAMS):
            raise InvalidParameter(
                f"integrator = '{p['integrator']}': soil remembers accepted steps and needs an implicit integrator,"
                f" '{IMPLICIT}' or '{HHT}'"
            )
        self.contacts = self.contact_partners(p)
        self.environment = self._environment()
        self.rotary_factor = 1.0
        level = StartPose(0.0, 0.0, 0.0, 0.0, 0.0, self.pose.pitch)
        wheels = np.array([plain(part_at_rest)(level, start_stance(wheel)) for wheel in self.wheel_list]).ravel()
        plain(read_states)(wheels, LEVEL, self.start_rows)
        self.counters[:] = 0
        self.state[:] = 0.0
        self.prepare(p)
        self.tolerances = p["adams.rtol"], p["adams.atol"]
        self._parameters = p
        return p

    def free_parameters(self, p: Mapping[str, Any]) -> FreeParameters:
        """Pose on a level ground that moves with the vehicle, and parameters without influence on the statics."""
        numbers = {"common.interval": f"{{{link_outputs.INTERVAL}}}"}
        if p["integrator"] != EXPLICIT:
            numbers["common.longest"] = "{step}"
        names = {port.name for port in self.ports}
        for pair, field in (("sprocket", "sprocket"), ("wheel", "wheel"), ("ground", "soil")):
            keys = {"c": f"contact.{pair}.damping", "mu": f"contact.{pair}.friction"}
            keys["v_reg"] = f"contact.{pair}.friction_velocity"
            numbers |= {f"contacts.{field}.{key}": f"{{{name}}}" for key, name in keys.items() if name in names}
        fixed = KEYS[HEIGHT:]  # they change the static equilibrium of the chain
        if self.config.get("terrain"):  # its place on the ground too
            fixed = self.start_parameters
        return FreeParameters(numbers, tuple(name for name in self.start_parameters if name not in fixed))

    def begin_run(self) -> None:
        """Begin with the kernel of the chosen integrator and the prepared links."""
        self.step_kernel, scheme = self._scheme()
        self.begin(
            self._parameters,
            steps.Parts(
                *self.system(),
                scheme=scheme,
                common=steps.CommonData(
                    longest=min(self.max_step, self.stable_step) if self.integrator == EXPLICIT else self.max_step,
                    plane=self.plane,
                    pitch=self.pitch,
                    play=float(self.vehicle["guide"]["clearance"]),
                    frame=self.frame,
                    start_rows=self.start_rows,
                    rows=self.rows,
                    given_warnings=self.given_warnings,
                    counters=self.counters,
                    interval=self.interval,
                ),
                s=self.s,
                work=self.work,
                report=self.report,
            ),
            steps.OutputData(self.frame, self.s.mean[: len(self.rows)], self.report),
            steps.LinkOutputData(
                self.frame,
                self.own_links,
                self.environment,
                self.s,
                self.work,
                self.links_count,
                self.nodes,
                np.array([int(name in self.link_groups) for name in link_outputs.GROUPS]),
                1 if set(self.link_groups) & set(link_outputs.WITH_OWN_KERNELS) else None,
            ),
        )

    def _scheme(self) -> tuple[Any, Any]:
        """Kernel of a step, and the parameters or arrays of its integrator."""
        if self.integrator == EXPLICIT:
            return steps.explicit, slopes(self.s)
        if self.integrator == ADAMS:
            return steps.adams, adams(self.s, *self.tolerances)
        return steps.implicit, self.method

    def contact_partners(self, p: Mapping[str, Any]) -> Any:
        """Contact partners (``fmus.contacts.Contacts``); None, without importing them, where there are none."""
        if not (self.wheel_list or self.config["ground"]):
            return None
        from fmus.contacts import contacts

        ground = self.config if self.config["ground"] else None
        return contacts(self.vehicle, self.wheel_list, ground, p, self.config.get("soil"))

    def rest_environment(self, rows: Floats) -> Environment:
        """Loads of the static equilibrium on wheels ``rows`` (wheels, 15): gravity in the plane of the wheels.

        Normal forces of tilted wheels lie in that plane, and friction of the ground at rest follows gravity
        (``contacts.at_rest``), so that nothing pushes the chain off its place along the wheels' axis.
        """
        ahead, across, up = self.environment.gravity
        in_plane = -up * rows[0, 11] / rows[0, 10] if len(rows) else 0.0
        if not (ahead or across or in_plane):
            return self.environment
        return self.environment._replace(gravity=(ahead, in_plane, up))

    def _environment(self) -> Environment:
        ends = self.config.get("ends")
        pull = np.zeros((2, 3))
        if self.ends_kind == PULLED:
            pull[:, 0] = ends["first"][0], ends["last"][0]
            pull[:, 2] = ends["first"][1], ends["last"][1]
        damping = float(self.config.get("transverse_damping", 0.0))
        toothed = [k for k, wheel in enumerate(self.wheel_list) if wheel["kind"] == "teeth"]
        mount = [*toothed, 0][0] if self.wheel_list else -1
        gravity = scale(float(self.config["gravity"]), self.pose.down())
        return Environment(gravity, self.ends_kind, pull, damping, mount)

    def polygon(self, rest: bool = True) -> Floats:
        """Pins (nodes, 2) of the start layout, m; with ``rest`` near equilibrium. Raises InvalidParameter."""
        try:
            if self._is_free_loop():
                return regular_polygon(self.pitch, self.links_count)
            if self.closed:
                return closed_polygon(*self.circles(), self.pitch, self.links_count)
            if self.ends_kind == PINNED:
                first, last = (np.array(self.config["ends"][end], dtype=float) for end in ("first", "last"))
                return (catenary if rest else hanging_arc)(first, last, self.pitch, self.links_count)
            if not self.wheel_list:
                level = ground_level(self.vehicle) + self.vehicle["track"]["face"]
                return np.stack([-self.pitch * np.arange(self.nodes), np.full(self.nodes, level)], axis=1)
            centre = np.array(self.wheel_list[0]["position"], dtype=float)
            return over_sprocket(centre, self.pitch, self.vehicle["sprocket"]["teeth"], self.links_count)
        except ValueError as error:
            raise InvalidParameter(f"the track cannot be laid out: {error}") from None

    def circles(self) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Centres (wheels, 2) and radii (wheels) of the line of pins round the wheels, m; which wheels are rims."""
        wheels, face = self.wheel_list, self.vehicle["track"]["face"]
        pitch_radius = self.pitch / (2.0 * sin(np.pi / self.vehicle["sprocket"]["teeth"]))
        rims = np.array([w["kind"] != "teeth" for w in wheels])
        radii = np.array([w["radius"] + face if rim else pitch_radius for w, rim in zip(wheels, rims, strict=True)])
        return np.array([w["position"] for w in wheels], dtype=float), radii, rims

    def lay_out(self, layout: str, spin: float) -> None:
        """Lay the chain out, and with some layouts bring it to rest on the wheels of the start; raises StepFailed."""
        if layout in ("straight", "folded"):
            self.settle(self._released(layout), rest=False)
            self.tighten()
        elif layout == "displaced":
            first, last = (np.array(self.config["ends"][end], dtype=float) for end in ("first", "last"))
            near = first + (last - first) * 0.7 * self.links_count * self.pitch / hypot(*(last - first))
            self.settle(catenary(first, near, self.pitch, self.links_count), rest=True)
            pins = rescaled(self.pins()[:, [0, 2]], last, self.pitch)
            self.settle(pins, rest=False)
            self.tighten()
        else:
            rest = layout == "rest"
            pins = np.stack(self.pose.pitch_point(*self.polygon(rest).T), axis=1)
            if rest and self.wheel_list and self.config.get("soil"):
                self._sink(pins)
            elif self.ends_kind == PULLED and not self.wheel_list:
                self._lie(pins, rest)
            elif rest and self.wheel_list and self.start_rows[0, 11]:
                self._lean(pins)
            else:
                try:
                    self.settle(pins, rest, spin)
                except StepFailed:  # a slack chain on wheels may be on its way still: search on from there
                    if not (rest and self.wheel_list):
                        raise
                    self.find_equilibrium(self.start_rows)

    def _lean(self, pins: Floats) -> None:
        """Bring the chain to rest on upright wheels first, then on the wheels as they lean, see ``settle``."""
        leaning = self.start_rows.copy()
        self.start_rows[:, 9:12] = 0.0, 1.0, 0.0
        self.start_rows[:, 13] = 0.0
        self.settle(pins, rest=True)
        for _ in range(2):  # rounding decides where the first search ends across the chain
            self.find_equilibrium(leaning)

    def _lie(self, pins: Floats, rest: bool) -> None:
        """Lay the chain on the ground; its ends are pulled from then on, because friction holds nothing at rest."""
        pull = self.environment.pull.copy()
        self.environment.pull[:] = 0.0
        if rest and self.config.get("soil") and not (self.config.get("terrain") or self.config.get("bump")):
            self.rotary_factor = SINKING
            self.settle(pins, rest)
            self.rotary_factor = 1.0
            self.find_equilibrium(self.start_rows)
        else:
            self.settle(pins, rest)
        self.environment.pull[:] = pull
        self._evaluate_start()

    def _sink(self, pins: Floats) -> None:
        """Bring the chain that was laid round the wheels as drawn to rest in soil, in stages, see ``settle``.

        Soil would hold up a chain over wheels that are far below, and they would come to rest past its links.
        """
        wheels, drawn = self.start_rows.copy(), self.start_rows.copy()
        drawn[:, [0, 2]] = [self.pose.pitch_point(*wheel["position"]) for wheel in self.wheel_list]
        stages = max(ceil(abs(wheels - drawn).max() / LOWERED), 1)
        way = [drawn + k / stages * (wheels - drawn) for k in range(1, stages)]
        for k, rows in enumerate([*way, wheels]):
            self.start_rows[:] = rows
            if k == 0:
                self.settle(pins, rest=True)
            else:
                self.find_equilibrium(self.start_rows)

    def _released(self, layout: str) -> Floats:
        """Pins (nodes, 2), m, of a chain that is released and held at its first pin."""
        first = np.array(self.config["ends"]["first"], dtype=float)
        if layout == "straight":
            return chain_of_angles(first, np.zeros(self.links_count), self.pitch)
        try:
            return folded(first, self.pitch, self.links_count)
        except ValueError as error:
            raise InvalidParameter(f"start = 'folded': {error}") from None

    def advance(self, t: float, h: float) -> None:
        """Do a step with the present wheels ``rows``; raises StepFailed."""
        self._do_step(t, h, self._u[:0])

    def pins(self) -> Floats:
        """Positions of the pins (nodes, 3) in the track's frame, m."""
        positions = np.zeros((self.nodes, 3))
        pin_places(self.own_links, self.s, self.work, positions)
        return positions

    @property
    def own_links(self) -> Any:
        """Links themselves, which joint coordinates and Cholesky's wrap."""
        return getattr(self.link, "links", self.link)

    def system(self) -> tuple[Any, Any, Environment]:
        """First arguments of the kernels of a chain: links, contact partners, environment."""
        return self.link, self.contacts, self.environment

    # Implemented by subclasses ---------------------------------------------------------------------------------

    def _evaluate_start(self) -> None:
        """Evaluate accelerations and outputs of the start; raises StepFailed."""
        raise NotImplementedError

    def shapes(self) -> state.Shapes:
        """Shapes of the views into the chain's state, by name."""
        raise NotImplementedError

    @property
    def stable_step(self) -> float:
        """Longest stable step of the explicit integrator, s."""
        raise NotImplementedError

    def prepare(self, p: Mapping[str, Any]) -> None:
        """Make the kernel parameters of the links from the FMI parameters ``p``; raises InvalidParameter."""
        raise NotImplementedError

    def settle(self, pins: Floats, rest: bool, spin: float = 0.0) -> None:
        """Set the chain at rest to the polygon ``pins`` (nodes, 2), m; with ``rest``, to static equilibrium.

        A free loop may turn about the origin at ``spin`` rad/s; its equilibrium is then relative to that rotation.
        Raises StepFailed.
        """
        raise NotImplementedError

    def find_equilibrium(self, rows: Floats) -> None:
        """Find static equilibrium on wheels at rest at ``rows`` (wheels, 15), from the present state.

        Raises StepFailed.
        """
        raise NotImplementedError

    def add_rates(self, turning: Floats, velocity: Floats) -> None:
        """Add rates of the links about y (n), rad/s, and velocities of the pins (n, 2), m/s, to a free loop's."""
        raise NotImplementedError

    def tighten(self) -> None:
        """Give the links of a released chain the tension of that instant; rigid links need nothing."""
