"""Parts of scenes that ran as Python, and their native FMUs."""

from __future__ import annotations

from contextlib import contextmanager
from functools import cache
from typing import NamedTuple

import numpy as np
from fmpy import read_model_description
from fmpy.fmi2 import FMU2Slave
from vehicle_in_process import InProcess

from fmus.native.pack import build_native, with_constants
from orchestrator.cosim.component import Component
from orchestrator.fmi.fmu_files import unpack
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load

H, STEPS = 1e-3, 120
QUICK = "run.stop=1 s", "run.step=1 ms", "track.step=1 ms"
MOVING = *QUICK, "drive.ramp_start=0", "drive.ramp_time=0.1"
JOINTED = "track.formulation=recursive", "track.integrator=runge_kutta"
CHOLESKY = "track.coordinates=cholesky", "track.integrator=runge_kutta"
ROUND = "drive.ramp_start=0", "drive.ramp_time=0.05", "drive.left.speed=4", "drive.right.speed=12"

WAVES = "ground.washboard={amplitude=0.02, wavelength=2, start=-20}", "ground.half_round={x=[-1], radius=0.02}"
BELLY = "ground.hull=true", "vehicle.chassis.hull=[[-2.0, 0.0, -0.65]]"
SLOPE = "ground.grade=0.1", "ground.bank=0.05", "start.heading=0.4"
ELEMENTS = (  # of the suspension, one of each sort
    "vehicle.suspension.torsion_bar={stiffness=3e4}", "vehicle.suspension.rotary_damper={damping=500, wheels=[1, 5]}",
    "vehicle.suspension.gas_spring={pressure=2e6, area=2e-3, volume=1e-3}",
    "vehicle.suspension.spring={compression=[-0.1, 0, 0.1], force=[-1e4, 0, 3e4]}",
    "vehicle.suspension.damper={speed=[-1, 0, 1], force=[-1e4, 0, 3e3]}",
    "vehicle.suspension.bump_stop={gap=0.02, stiffness=5e5}", "vehicle.tensioner.recoil={preload=6e4, stiffness=3e5}",
)  # fmt: skip
BOGIES = (
    "vehicle.road_arm.beams=[[1, 2, 3], [4, 5]]", "vehicle.road_arm.mass=[90, 40, 120, 60, 30]",
    "vehicle.road_arm.pivot=[[-0.717, 0.15], [-0.05, 0.15], [0.617, 0.15], [-0.3, 0.15], [0.366, 0.15]]",
    "vehicle.tensioner.angle=0.2",
)  # fmt: skip
BUSHED = "vehicle.track.bushing={stiffness=500, preset=0.1, damping=5, friction=0.3, radius=0.02}"
GROUSERS = "vehicle.track.grouser={height=0.02, length=0.03, width=0.3, count=2}"
PARTS = ('track.link_outputs=["force", "wheels", "teeth", "rims", "horns", "moment"]',)
DENSE = (  # a tooth between every second gap
    "vehicle.sprocket.teeth=21", "vehicle.sprocket.gaps_per_pin=2", "vehicle.sprocket.outer_radius=0.272",
)  # fmt: skip
LUGGED = (  # on every second pin
    "vehicle.sprocket.teeth=10", "vehicle.sprocket.pins_per_gap=2", "vehicle.track.pitch=0.0762",
)  # fmt: skip
RELEASED = "track.start=displaced"
THERE_AND_BACK = "drive.speed_points=[[0, 0], [0.1, 8], [0.25, 8], [0.35, -8], [1, -8]]"


class Case(NamedTuple):
    """A part of a scene."""

    scene: str
    links: str
    part: str
    settings: tuple[str, ...] = QUICK
    steps: int = STEPS


FEW = [
    Case("hanging_chain", "flexible", "chain"),
    Case("straight", "rigid", "left_drive", MOVING),
    Case("straight", "rigid", "chassis", (*MOVING, *SLOPE)),
    Case("serpentine", "rigid", "driver"),
    Case("serpentine", "rigid", "right_drive"),
    Case("differential", "rigid", "differential"),
]
CHAINS = (  # links, settings
    ("flexible", ("track.integrator=runge_kutta", RELEASED)), ("rigid", ("track.integrator=runge_kutta", RELEASED)),
    ("flexible", ("track.integrator=adams", RELEASED)), ("rigid", ("track.integrator=adams", RELEASED)),
    ("rigid", ("track.integrator=dormand_prince", "track.formulation=recursive", RELEASED)),
    ("flexible", ("track.integrator=hht",)), ("flexible", (*CHOLESKY, RELEASED)),
    ("flexible", ("track.elasticity=general",)),
)  # fmt: skip
STRAIGHT = (  # links, part, settings
    ("rigid", "right_track", (*MOVING, *SLOPE)), ("flexible", "left_track", (*MOVING, "track.element=beam")),
    ("flexible", "left_track", (*MOVING, "symmetric=true", "planar=true")),
    ("rigid", "left_track", (*MOVING, *JOINTED)),
    ("rigid", "left_track", (*MOVING, *JOINTED, "track.closure=spring")),
    ("rigid", "left_track", (*MOVING, GROUSERS)),
    ("rigid", "left_track", (*MOVING, "track.closure=spring")), ("flexible", "left_track", (*MOVING, BUSHED)),
    ("flexible", "right_track", (*QUICK, "drive.speed=0")), ("rigid", "left_track", (*QUICK, "drive.speed=0")),
    ("rigid", "chassis", (*MOVING, "hitch.force=1e4", "hitch.drag_points=[[-1, -1e4], [1, 1e4]]", "seats=['driver']")),
    ("rigid", "chassis", (*MOVING, *BELLY)), ("rigid", "chassis", (*MOVING, *ELEMENTS, *BOGIES)),
    ("rigid", "right_track", (*MOVING, *WAVES)), ("rigid", "chassis", (*MOVING, *WAVES, *BELLY)),
)  # fmt: skip
MANY = [
    Case("hanging_chain", "rigid", "chain"),
    Case("straight", "flexible", "left_track", (*MOVING, *PARTS)),
    *(Case("straight", *each) for each in STRAIGHT),
    Case("turn", "flexible", "left_track", (*QUICK, *ROUND)),
    Case("turn", "rigid", "right_track", (*QUICK, *ROUND, *PARTS, *DENSE)),
    Case("sprocket_bench", "rigid", "track", (*QUICK, *LUGGED)),
    Case("soft_ground", "flexible", "left_track", (*MOVING, GROUSERS)),
    *(Case("hanging_chain", links, "chain", (*QUICK, *settings)) for links, settings in CHAINS),
]
CLAY = "ground.soil={name='lete_sand', rebound=0.5}"
SOIL = Case("soft_ground", "rigid", "left_track", (*QUICK, THERE_AND_BACK, CLAY), 600)


class Run(NamedTuple):
    """A part of a scene that ran as Python: its model, and its inputs and all outputs at each step."""

    part: object
    member: object
    u: np.ndarray
    y: np.ndarray
    links: np.ndarray


@cache
def ran(case):
    vehicle = InProcess(load(case.scene, case.links, case.settings))
    member = vehicle[case.part]
    u, y, links = [], [], []
    step = member.step

    def recorded(t, h):
        u.append(member.u.copy())
        step(t, h)
        y.append(member.y.copy())
        links.append(member.link_outputs())

    member.step = recorded
    for _ in range(case.steps):
        vehicle.step()
    (part,) = (part for part in assemble(vehicle.scene).parts if part.name == case.part)
    return Run(part, member, np.array(u), np.array(y), np.array(links))


def native(case):
    part = ran(case).part
    return build_native(part.kind, with_constants(part.kind, part.config, part.parameters))


def begun(case):
    component = Component(native(case), case.part)
    component.initialise(ran(case).part.parameters)
    return component


@contextmanager
def raw(case, **parameters):
    """Instance of FMI 2.0 in FMPy alone, initialised, and its variables by name."""
    description = read_model_description(native(case))
    variables = {v.name: v for v in description.modelVariables}
    kind, folder = description.coSimulation.modelIdentifier, str(unpack(native(case)))
    slave = FMU2Slave(guid=description.guid, modelIdentifier=kind, unzipDirectory=folder, instanceName="one")
    slave.instantiate()
    for name, value in (ran(case).part.parameters | parameters).items():
        if name in variables and variables[name].causality == "parameter":
            (slave.setString if isinstance(value, str) else slave.setReal)([variables[name].valueReference], [value])
    slave.enterInitializationMode()
    try:
        yield slave, variables
    finally:
        slave.freeInstance()


def follow(component, run, steps):
    """Return outputs (steps, ports) and link outputs (steps, link ports) after each of the steps."""
    shown = []
    for k in steps:
        component.u[:] = run.u[k]
        component.write()
        component.step(k * H, H)
        component.read()
        component.read_links()
        component.read_counters()
        shown.append((component.y.copy(), component.y_links.copy()))
    return [np.array(each) for each in zip(*shown, strict=True)]


CHAIN, DRIVE, CHASSIS = FEW[:3]
