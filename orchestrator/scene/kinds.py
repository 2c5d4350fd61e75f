"""Kinds of scenes with a track: chain, bench, rig and vehicle; frozen, complete, SI.

The resolved scene holds the whole vehicle table under ``vehicle``, so a dotted key reaches every number of a run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import reduce
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from fmus.ground.refinement import passed_over
from fmus.ground.tables import GroundTable, LevelGroundTable
from fmus.track.choices import TRACKS
from fmus.vehicles.sides import lopsided, pins_a_turn, pitch_radius
from fmus.vehicles.tables import BadInput, Force, is_logged, path_text, value_text
from fmus.vehicles.vehicle import Vehicle
from orchestrator.scene.drive_tables import DriverTable, DriveTable, HitchTable, VehicleDriveTable
from orchestrator.scene.fmu_table import FmuTable, pair_of, require_instance_name
from orchestrator.scene.ground_plane import GroundPlane, ground_plane
from orchestrator.scene.system_scene import ASSUMED_SPEED, SystemScene
from orchestrator.scene.tables import BenchTable, ChainTable, RigTable, StandingTable, StartTable, VehicleStartTable
from orchestrator.scene.track_table import TrackModelTable, short_track
from orchestrator.scene.values import OR_FALSE, SIDES, SOLVED, Side, TrackName
from orchestrator.vocabulary.analyses import UNSTRESSED, described

OUTER_TRACK = 1.2  # speed of the outer track in a turn, relative to the vehicle


class Scene(SystemScene):
    """Scene of FMUs, one of them a track; subclasses add what they assemble."""

    vehicle: Vehicle
    """name of a vehicle, a TOML file, or a table with the key base and the differences from that vehicle"""
    track: Annotated[TrackModelTable, BeforeValidator(short_track, TrackName | TrackModelTable)]
    """model of the links and numerical method, or the name of the model alone"""
    start: StartTable = StartTable()
    """place and state of the vehicle at the start, world frame"""
    placed: bool = Field(default=False, json_schema_extra=SOLVED)
    """the idler is where the chain carries its static tension"""
    planar: bool = False
    """cable chains without lateral dofs: all motion is in the plane of the track"""
    fmu: dict[str, FmuTable] | None = None
    """FMUs of the user by the names of the parts in whose place they run, or by names of their own"""
    connections: tuple[str, ...] | None = None
    """connections to FMUs of the user, and from them to chassis.hitch.force.{x,y,z}: "part.output -> part.input", or
    "2 * part.output + 1 -> part.input" """

    def changed(self, settings: Sequence[str] | Mapping[str, Any]) -> Scene:
        """The scene with other values, as of ``load``; its defaults are kept. Raises BadInput."""
        from orchestrator.scene.scene import with_settings, with_track  # late: it knows all kinds

        return with_track(with_settings(self, settings))

    def require_own_parts(self, what: str) -> None:
        """Raise BadInput if an FMU of the user is in place of a part; ``what``: subject of the sentence."""
        for name, fmu in (self.fmu or {}).items():
            raise BadInput(f"{self.where}: fmu.{name}.file = {path_text(fmu.file)}: {what} parts of cotrack alone")

    def recording_for(self, analyses: Sequence[str]) -> Scene:
        """The scene with the link outputs that analyses need besides its own, as often as they need them.

        Raises BadInput for an unknown name, and for an analysis of stress that the links do not have.
        """
        for name in analyses:
            if described(name).stress and not self.track.kind.stressed:
                raise BadInput(f"--for {name}: {self.track.kind.links} have no stress: {UNSTRESSED}")
        needed = [group for name in analyses for group in described(name).records]
        groups = dict.fromkeys([*self.track.link_outputs, *needed])
        seated = next((name for name in analyses if described(name).seats), None)
        every_step = any(described(name).every_step for name in analyses) and "run.links" not in self._settings
        often = {"run.links": 1} if every_step else {}
        seats = self._all_seats(seated) if seated else {}
        changed = self.changed({"track.link_outputs": [*groups], **often, **seats})
        return changed.read_from(self._archive, self._settings)  # it is the same run, with more in its log

    def _all_seats(self, analysis: str) -> dict[str, Any]:
        """Setting with which seats are recorded for an analysis; raises BadInput."""
        raise BadInput(f"--for {analysis}: assembly = '{self.assembly}' has no seats")

    @property
    def resumable(self) -> bool:
        """True if all FMUs are parts of cotrack."""
        return not self.fmu

    @model_validator(mode="after")
    def _check_connections(self) -> Scene:
        for name in self.fmu or {}:
            require_instance_name(name)
        for text in self.connections or ():
            pair_of(text)
        return self

    @model_validator(mode="after")
    def _check_planar(self) -> Scene:
        if not self.planar:
            return self
        kind = self.track.kind
        if not kind.planar:
            others = " or ".join(f"'{name}'" for name, track in TRACKS.items() if track.planar)
            raise ValueError(f"planar = true needs track.model = {others}: {kind.links} keep their six coordinates")
        for key, only in kind.planar.items():
            if getattr(self.track, key) not in (None, only):
                raise ValueError(f"planar = true needs track.{key} = '{only}', not '{getattr(self.track, key)}'")
        return self

    @property
    def variant(self) -> str:
        """The track model."""
        return self.track.model

    @property
    def start_pose(self) -> dict[str, float]:
        """Start parameters that all parts share: places in m, angles in rad."""
        return self.start.parameters()

    def with_axes(self) -> Scene:
        """The scene with the default axes of its cables: fixed."""
        return self

    def _check_no_closure(self, ends: str) -> None:
        """Raise ValueError if a chain with these ``ends``, which is no loop, has a closure."""
        if self.track.closure is not None:
            raise ValueError(f"track.closure = '{self.track.closure}' needs a loop: this chain has {ends}")

    def _teeth_rate(self, speed: float | None) -> float:
        """Pins per second at a sprocket speed, rad/s."""
        return pins_a_turn(self.vehicle.model_dump()) * (ASSUMED_SPEED if speed is None else speed) / (2.0 * math.pi)


class ChainScene(Scene):
    """Chain without wheels."""

    assembly: Literal["chain"]
    chain: ChainTable
    """chain without wheels"""
    ground: LevelGroundTable | None = None
    """ground under a lying chain"""

    @model_validator(mode="after")
    def _check_chain(self) -> ChainScene:
        if self.ground is not None and self.chain.ends != "lying":
            raise ValueError(f"ground needs chain.ends = 'lying', not '{self.chain.ends}'")
        if self.track.axes == "free":
            raise ValueError("track.axes = 'free' needs wheels, which a chain alone has not")
        if self.chain.ends != "loop":
            self._check_no_closure(f"ends = '{self.chain.ends}'")
        return self


class BenchScene(Scene):
    """Chain over a driven sprocket."""

    assembly: Literal["bench"]
    bench: BenchTable
    """open chain over one sprocket, its ends pulled by constant forces"""
    drive: DriveTable
    """drive of the sprocket"""

    @model_validator(mode="after")
    def _check_bench(self) -> BenchScene:
        self._check_no_closure("ends that are pulled")
        return self

    @property
    def teeth_rate(self) -> float:
        """Pins per second at the drive's top speed."""
        return self._teeth_rate(self.drive.top_speed)


class RigScene(Scene):
    """Closed chain round a driven sprocket and a braked idler."""

    assembly: Literal["rig"]
    rig: RigTable
    """closed chain round a sprocket and a smooth idler with fixed axles"""
    drive: DriveTable
    """drive of the sprocket"""
    idler_drive: DriveTable
    """drive or brake of the idler"""

    @property
    def teeth_rate(self) -> float:
        """Pins per second at the drive's top speed."""
        return self._teeth_rate(self.drive.top_speed)


class VehicleScene(Scene):
    """Vehicle on its ground."""

    assembly: Literal["vehicle"]
    start: VehicleStartTable = VehicleStartTable()
    """place and state of the vehicle at the start, world frame"""
    tracks: tuple[Side, ...] = SIDES
    """sides with a track; a side without one has no drive either"""
    ground: GroundTable = GroundTable()
    """ground beyond its level, and contacts beyond those of the tracks"""
    drive: VehicleDriveTable
    """drive of the sprockets of both sides"""
    driver: Annotated[DriverTable | None, OR_FALSE] = None
    """driver whose demands the drives follow; false or no table: they follow their own settings"""
    hitch: Annotated[HitchTable | None, OR_FALSE] = None
    """load that the vehicle tows at vehicle.hitch; false or no table: it tows nothing"""
    seats: tuple[str, ...] = ()
    """seats of vehicle.seat whose position, velocity and acceleration the chassis gives"""
    push: Force = Field(default=0.0, json_schema_extra=SOLVED)
    """share of the tensioners' preload that balances the tension of placed tracks"""
    standing: StandingTable | None = Field(default=None, json_schema_extra=SOLVED)
    """vehicle standing on level, hard ground, where its tracks carry their tension"""
    symmetric: bool = False
    """only the left half runs; the right one mirrors it"""

    @field_validator("tracks")
    @classmethod
    def _check_sides(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        if len(set(value)) < len(value):
            raise ValueError("names a side twice")
        return value

    @model_validator(mode="after")
    def _check_and_complete(self, info: ValidationInfo) -> VehicleScene:
        if self.symmetric and len(self.tracks) == 1:
            raise ValueError("symmetric = true needs both tracks or none")
        if self.symmetric and not is_logged(info) and (key := self._lopsided):
            sides = (reduce(getattr, key.split("."), self.vehicle.of_side(side)) for side in SIDES)
            raise ValueError(
                "symmetric = true needs a vehicle that is its own mirror image in its plane y = 0, but"
                f" vehicle.{key} = {' and '.join(dict.fromkeys(map(value_text, sides)))} is not"
            )
        shaped = self.ground.shaped_by()
        if shaped and self.start.heading_and_pitch() != (self.start.heading, self.start.pitch):
            raise ValueError(
                f"ground.{shaped[0]} needs start.roll = 0: rolled over, the vehicle's start looks the other way"
            )
        if self.ground.bump and len(shaped) > 1 and (self.start.heading, *self.start.position[:2]) != (0.0, 0.0, 0.0):
            raise ValueError(
                f"ground.bump lies ahead of the start, ground.{shaped[-1]} in the world: together they need"
                " start.heading = 0 and start.position = [0, 0, z]"
            )
        one_sided = self.ground.one_sided(self.start.position, self.start.heading)
        if self.symmetric and one_sided:
            raise ValueError(f"symmetric = true needs the same ground on both sides, but ground.{one_sided} differs")
        if one_sided and self.track.axes == "fixed":
            raise ValueError(f"ground.{one_sided} rolls the vehicle: track.axes = 'fixed' keeps cables in their plane")
        if self.ground.soil and (self.ground.hull or len(self.tracks) < 2):
            raise ValueError(
                "ground.soil needs both tracks and ground.hull = false: soil has no law for hull and bare wheels"
            )
        if self.planar and not self.symmetric:
            raise ValueError("planar = true needs symmetric = true: a vehicle on two tracks may roll and yaw")
        self._check_fittings()
        if self.turns:
            self._check_steering()
        if self.driver is not None:
            self._check_driver()
        return self.with_state().with_axes()

    def _all_seats(self, analysis: str) -> dict[str, Any]:
        if not self.vehicle.seat:
            raise BadInput(f"--for {analysis}: {self.vehicle.name} has no table [seat.NAME]")
        return {"seats": list(self.seats or self.vehicle.seat)}

    @property
    def teeth_rate(self) -> float:
        """Pins per second on the faster side; with a driver, in a turn of about ten metres radius."""
        if self.driver is not None:
            radius = pitch_radius(self.vehicle.model_dump())
            return self._teeth_rate(OUTER_TRACK * self.driver.top_speed / radius)
        speeds = [speed for side in SIDES if (speed := self.drive.of_side(side).top_speed) is not None]
        steering = self.drive.steering and self.drive.steering.top_speed
        return self._teeth_rate(max(speeds) + 0.5 * (steering or 0.0) if speeds else None)

    @property
    def ground_plane(self) -> GroundPlane:
        """Plane under the vehicle, drawn at its position of the start with its heading."""
        vehicle, start = self.vehicle, self.start
        return ground_plane(self.ground, start.position, start.heading, vehicle.road_wheel.x, vehicle.track.lateral)

    @property
    def start_pose(self) -> dict[str, float]:
        """Start parameters that all parts share, also those of a vehicle that the ground moves or tilts."""
        from fmus.start import standing_pose  # late: it loads kernels

        ground, start = self.ground_plane[:3], self.start
        slope = standing_pose(self.vehicle.model_dump(), start.position, start.heading, ground) if any(ground) else {}
        return start.parameters() | slope

    def with_state(self) -> VehicleScene:
        """The scene with its start state, by default equilibrium where possible; raises ValueError."""
        rests = self.track.start in (None, "rest")
        if self.start.state == "equilibrium" and not rests:
            raise ValueError(f"start.state = 'equilibrium' needs track.start = 'rest', not '{self.track.start}'")
        if self.start.state is not None:
            return self
        solved = self.start.equilibrium is not None or not self.placed  # logs of older versions hold no equilibrium
        state = "equilibrium" if rests and solved and not self.start.is_displaced else "drawn"
        return self.model_copy(update={"start": self.start.model_copy(update={"state": state})})

    @property
    def turns(self) -> bool:
        """True if the sides may be driven differently: by their tables, a differential, a driver or demands."""
        demanded = self.drive.demand and not self.symmetric and len(self.tracks) > 1
        return self.drive.steers or self.drive.steering is not None or self.driver is not None or demanded

    @property
    def kept_heading(self) -> float | None:
        """Heading of a vehicle that is not made to turn, rad; None of others."""
        return None if self.turns else self.start.heading

    @property
    def unfelt(self) -> list[str]:
        """As of any scene, and one sentence for each feature of the ground that may pass between contact points."""
        ground, track = self.ground.model_dump(exclude_none=True), self.vehicle.track.model_dump()
        narrow = passed_over(ground, track, self.kept_heading)
        return [*super().unfelt, *(f"{self.where}: {sentence}" for sentence in narrow)]

    @property
    def _lopsided(self) -> str:
        """Key by which the vehicle differs from its mirror image, or empty."""
        return lopsided(self.vehicle.model_dump(), self.ground.hull)

    @property
    def leaves_plane(self) -> str:
        """Reason why tracks may leave their planes; empty if they stay in them."""
        if self.turns:
            return "the sides are driven differently"
        if key := self._lopsided:
            return f"the sides of the vehicle differ in {key}"
        if one_sided := self.ground.one_sided(self.start.position, self.start.heading):
            return f"ground.{one_sided} rolls the vehicle"
        return "one side alone has a track" if len(self.tracks) == 1 else ""

    def with_axes(self) -> VehicleScene:
        """The scene with free axes, if none are given, for cables of a vehicle that may turn or roll."""
        track = self.track
        if not self.leaves_plane or track.axes is not None or track.choices().get("element") != "cable":
            return self
        return self.model_copy(update={"track": track.model_copy(update={"axes": "free"})})

    def _check_fittings(self) -> None:
        """Raise ValueError for a hitch or seats that the vehicle has not."""
        if self.hitch is not None and self.vehicle.hitch is None:
            raise ValueError("hitch: needs vehicle.hitch, the point x, z at which the vehicle tows")
        for name in self.seats:
            if name not in self.vehicle.seat:
                known = ", ".join(self.vehicle.seat) or "none"
                raise ValueError(f"seats names {value_text(name)}: the vehicle has {known}")
        if len(set(self.seats)) < len(self.seats):
            raise ValueError("seats names a seat twice")

    def _check_steering(self) -> None:
        """Raise ValueError if the sides' drives differ and another setting forbids that."""
        if self.symmetric:
            raise ValueError("symmetric = true needs the same drive on both sides: the right half mirrors the left")
        if without := [side for side in SIDES if side not in self.tracks]:
            reason = "a driver steers with both sides" if self.driver else "drive.left and drive.right differ"
            reason = "drive.steering joins both sides" if self.drive.steering else reason
            raise ValueError(f"{reason}, but tracks has no '{without[0]}'")
        if self.track.axes == "fixed":
            raise ValueError("this vehicle turns: track.axes = 'fixed' keeps cables in their plane")

    def _check_driver(self) -> None:
        """Raise ValueError if the drives cannot follow a driver."""
        for where, drive in self.drive.motors().items():
            if drive.mode == "torque":
                raise ValueError(f"{where}.mode = 'torque': a driver needs 'speed' or 'controller'")
            conditions = DriveTable.conditions()
            for key in ("demand", *conditions):
                given = (value := getattr(drive, key)) not in (None, DriveTable.model_fields[key].default)
                if given and (key.startswith("demand") or conditions[key].lacks({**vars(drive), "demand": True})):
                    raise ValueError(
                        f"{where}.{key} = {value_text(value)}: a driver says how fast sprockets turn, leave it out"
                    )
