"""Base of both track models: parameters, parts of the kernels, and the frame of the track.

The frame of a track is at the vehicle's start position, turned by its start heading and tilted as the ground there,
with the track plane at y = 0: the joint axis is y and the ground level for every start, and the numbers are small.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.ground.refinement import sections
from fmus.interface.defaults import parameter_values
from fmus.interface.model import ComponentModel, FreeParameters, InvalidParameter
from fmus.interface.ports import STATE, Port
from fmus.kernels.jit import plain
from fmus.physics.arrays import Floats
from fmus.physics.chain import state
from fmus.physics.chain.bushing import Bushing
from fmus.physics.chain.explicit import sizes, slopes
from fmus.physics.chain.implicit import ImplicitMethod
from fmus.physics.chain.integration import HELD, LOOP, PINNED, PULLED, Environment
from fmus.physics.chain.interface import pin_places
from fmus.physics.chain.layout import ovalling
from fmus.physics.chain.report import COUNTERS, REPORT
from fmus.physics.integrate.adams import adams
from fmus.physics.integrate.dormand_prince import dormand_prince
from fmus.physics.vector import scale
from fmus.physics.wheels import WIDTH, read_states
from fmus.start import FRAME, HEIGHT, KEYS, LEVEL, StartPose, part_at_rest, start_pose
from fmus.track import link_outputs, steps
from fmus.track.choices import ADAMS, DORMAND_PRINCE, EXPLICIT, EXPLICITLY, HHT, IMPLICIT
from fmus.track.failures import WARNINGS, failure_sentences, warning_sentences
from fmus.track.motions import exchange_size
from fmus.track.ports import start_stance, track_ports
from fmus.track.start import LaidChain, drawn, drawn_keys


def bushing(track: Mapping[str, Any], bent: float = 0.0) -> Bushing | None:
    """Bush of each pin, or None; ``bent``: compliance of links in series, rad/(N m). Raises InvalidParameter."""
    table = track.get("bushing")
    if not table:
        return None
    if (left := 1.0 - bent * table["stiffness"] * table.get("in_series", 0.0)) <= 0.0:
        raise InvalidParameter(f"track.bushing.stiffness: must be below that of a link, {1.0 / bent:g} N m/rad")
    arm = table["friction"] * (table["radius"] or 0.0)
    return Bushing(table["stiffness"] / left, table["preset"], table["damping"] / left, arm, table["slow"])


END_KINDS = {"pinned": PINNED, "pulled": PULLED, "held": HELD}


class TrackModel(LaidChain, ComponentModel):
    """Chain of links with the ports of a track; a subclass adds the mechanics of its links.

    The subclass implements ``shapes``, ``stable_step``, ``prepare``, ``settle``, ``find_equilibrium`` and
    ``add_rates``; ``prepare`` sets ``link``, ``method`` and ``work``.
    """

    start_kernel, step_kernel = staticmethod(steps.begin), staticmethod(steps.implicit)
    output_kernel, link_output_kernel = staticmethod(steps.write_outputs), staticmethod(steps.write_link_outputs)
    start_parameters = *KEYS, "start.lateral"
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
        counted = ["teeth", "gaps_per_pin", "pins_per_gap", "radius"]
        shaped = ["pitch", "pin_radius", "outer_radius", "seat_clearance", "flank_angle", "tip_radius"]
        return [
            *(f"track.{key}" for key in ("pitch", "mass", "inertia", "face", "width", "lateral", "grouser")),
            *(f"track.bushing.{key}" for key in ("stiffness", "preset", "damping", "friction", "radius", "slow")),
            *(f"sprocket.{key}" for key in (counted + shaped if wheels or ground else counted)),
            *drawn_keys(wheels),
            *(("road_wheel.radius", "road_wheel.z") if ground or not wheels else ()),
            "guide.clearance",
            "contact",
        ]

    def __init__(self, config: Mapping[str, Any]) -> None:
        """Make a track from the resolved config (keys vehicle, track, link_outputs) and allocate its arrays.

        Wheels of ``track.wheels`` have a name, a kind ("teeth", "rim", "driving": by friction of its rim) and a stance
        ``start``, by default as drawn.
        """
        self.vehicle = config["vehicle"]
        self.config = config["track"]
        self.wheel_list = drawn(self.vehicle, self.config["wheels"])
        self.links_count = int(self.config["links"])
        self.closed = bool(self.config["closed"])
        self.ends_kind = END_KINDS[self.config["ends"]["kind"]] if self.config.get("ends") else LOOP
        self.nodes = self.links_count if self.closed else self.links_count + 1
        self.pitch = float(self.vehicle["track"]["pitch"])
        wheels = len(self.wheel_list)
        self.rows = np.zeros((wheels, WIDTH))
        self.start_rows = np.zeros((wheels, WIDTH))
        self.frame = np.zeros(FRAME)
        self.bushing = bushing(self.vehicle["track"])
        self.bushed = self.nodes if self.bushing else 0  # number of pins that may have a bush
        self.link_groups = link_outputs.chosen_groups(
            config.get("link_outputs", True), bool(self.config["ground"]), self.bushed > 0
        )
        self.on_links_shape = link_outputs.on_links_shape(self.link_groups, self.nodes, self.bushed > 0)
        link_ports = link_outputs.ports(self.link_groups, self.links_count, self.nodes)
        self.link_ports = len(link_ports)
        self.ports = track_ports(config, self.wheel_list, link_ports) + self.link_parameters(self.vehicle)
        self.counters = np.zeros(COUNTERS, dtype=np.int64)
        self.inputs = STATE * wheels
        names = [wheel["name"] for wheel in self.wheel_list]
        self.failures = failure_sentences(names)
        self.ground_memory = self._ground_memory()
        self.warning_sentences = warning_sentences(names, self.ground_memory.rut > 0)
        self.allocate()

    def _ground_memory(self) -> state.GroundMemory:
        """Sizes of what the ground remembers under the chain."""
        if not self.config["ground"]:
            return state.HARD
        each = sections(self.vehicle["track"], self.config.get("refinement"), hard=True)
        points = 2 * len(each) * self.links_count
        if not self.config.get("soil"):
            return state.HARD._replace(points=points)
        from fmus.physics.contact.soil.memory import MEMORY, PENDING, RUT

        return state.GroundMemory(points, MEMORY, PENDING, RUT)

    def allocate(self) -> None:
        """Allocate the zeroed state and its views; again where a parameter changes the size of the chain."""
        shapes = self.shapes()
        size = state.size(shapes)
        warned = size + REPORT + len(WARNINGS)
        self.state = np.zeros(warned + exchange_size(len(self.wheel_list)))
        self.s = state.views(self.State, shapes, self.state[:size])
        self.report, self.given_warnings = self.state[size : size + REPORT], self.state[size + REPORT : warned]
        self.exchange = self.state[warned:]

    def link_parameters(self, vehicle: Mapping[str, Any]) -> tuple[Port, ...]:
        """Parameters of this kind of links alone."""
        return ()

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
        if self.config.get("soil") and p["integrator"] in EXPLICITLY:
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

    def compile(self, parameters: Mapping[str, float | int | str], native: bool = False) -> None:
        """See ``ComponentModel``; kernels of the start take as long and are compiled by the one who starts."""
        self.read(parameters)
        self.begin_run()
        self.compile_run(native)

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
                    longest=self.longest_step,
                    plane=self.plane,
                    pitch=self.pitch,
                    play=float(self.vehicle["guide"]["clearance"]),
                    frame=self.frame,
                    start_rows=self.start_rows,
                    rows=self.rows,
                    given_warnings=self.given_warnings,
                    exchange=self.exchange,
                    mean=self.s.mean[: len(self.rows)],
                    report=self.report,
                    weight=self.links_count * float(self.vehicle["track"]["mass"]) * float(self.config["gravity"]),
                    counters=self.counters,
                    interval=self.interval,
                ),
                s=self.s,
                work=self.work,
                report=self.report,
            ),
            steps.OutputData(self.frame, self.s.mean[: len(self.rows)].reshape(-1, 3), self.report),
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
                link_outputs.link_arrays(self.s.on_links_sum.shape, self.links_count, self.nodes),
            ),
        )

    def _scheme(self) -> tuple[Any, Any]:
        """Kernel of a step, and the parameters or arrays of its integrator."""
        if self.integrator == EXPLICIT:
            return steps.explicit, slopes(self.s)
        if self.integrator == ADAMS:
            return steps.adams, adams(*sizes(self.s), *self.tolerances)
        if self.integrator == DORMAND_PRINCE:
            return steps.dormand_prince, dormand_prince(*sizes(self.s), *self.tolerances)
        return steps.implicit, self.method

    def contact_partners(self, p: Mapping[str, Any]) -> Any:
        """Contact partners (``physics.chain.contacts``); None, without importing them, where there are none."""
        if not (self.wheel_list or self.config["ground"]):
            return None
        from fmus.track.contacts import contacts

        ground = self.config if self.config["ground"] else None
        return contacts(self.vehicle, self.wheel_list, ground, p, self.config.get("soil"))

    @property
    def most_points(self) -> int:
        """Most contact points of the chain; 0 if it can touch nothing."""
        if self.contacts is None:
            return 0
        from fmus.physics.chain.contacts import most_points

        return most_points(self.contacts, self.pitch, self.nodes)

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
        pull = np.zeros((2, 3))
        if self.ends_kind == PULLED:
            ends = self.config["ends"]
            pull[:, 0] = ends["first"][0], ends["last"][0]
            pull[:, 2] = ends["first"][1], ends["last"][1]
        damping = float(self.config.get("transverse_damping", 0.0))
        sprockets = [k for k, wheel in enumerate(self.wheel_list) if wheel["kind"] != "rim"]
        mount = [*sprockets, 0][0] if self.wheel_list else -1
        gravity = scale(float(self.config["gravity"]), self.pose.down())
        return Environment(gravity, self.ends_kind, pull, damping, mount)

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

    @property
    def longest_step(self) -> float:
        """Longest internal step of the chosen integrator, s."""
        return min(self.max_step, self.stable_step) if self.integrator == EXPLICIT else self.max_step

    # Implemented by subclasses ---------------------------------------------------------------------------------

    def shapes(self) -> state.Shapes:
        """Shapes of the views into the chain's state, by name."""
        raise NotImplementedError

    @property
    def stable_step(self) -> float:
        """Longest internal step, s, at which the explicit integrator is stable whatever the links touch."""
        raise NotImplementedError

    def prepare(self, p: Mapping[str, Any]) -> None:
        """Make the kernel parameters of the links from the FMI parameters ``p``; raises InvalidParameter."""
        raise NotImplementedError

    def add_rates(self, turning: Floats, velocity: Floats) -> None:
        """Add rates of the links about y (n), rad/s, and velocities of the pins (n, 2), m/s, to a free loop's."""
        raise NotImplementedError
