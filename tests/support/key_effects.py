"""Cases and keys of ``test_sensitivity``: for each key the case in which it acts, the kinds of links, its change."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from vehicle_in_process import Overrides

from fmus.track.choices import TRACKS


class Case(NamedTuple):
    """A short run of a scene in which keys are changed."""

    scene: str
    settings: tuple[str, ...] = ()
    duration: float = 0.02  # s
    ulp: str = "vehicle.gravity"  # a key whose last digit shows the growth of rounding
    overrides: Overrides | None = None


QUICK = ("track.start=polygon", "drive.ramp_start=0", "drive.ramp_time=0.02", "track.link_outputs=false", "placed=true")
# it falls on its suspension, nose down, and drives off to the right
VEHICLE = (*QUICK, "start.pitch=0.01", "start.height=-0.01", "drive.speed=20")
STEERED = (*QUICK, "start.pitch=0.01", "start.height=-0.01")
UNRAMPED = (QUICK[0], *STEERED[3:])
LEFT, RIGHT = ("[[0.001, 0.1], [0.008, 3], [0.014, 2], [0.03, 4]]", "[[0.001, 0.1], [0.008, 2], [0.014, 3], [0.03, 5]]")
GROUSERS = "vehicle.track.grouser={height=0.03, length=0.03, width=0.3, count=2}"
BUSHED = (
    "vehicle.track.bushing={stiffness=500, preset=0.1, damping=20, friction=0.3, radius=0.02, slow=2, wear=1e-13,"
    " bearing=0.3}"
)
JOINED = ("drive.steering.ramp_start=0", "drive.steering.ramp_time=0.02")
RIG = (*QUICK, "drive.speed=2")
SLOWER: Overrides = {"left_drive": {"speed.end": 8.0}}
SOIL = (
    "n=0.7, kc=5e3, kphi=1.5e6, cohesion=2e3, friction_angle=0.5, shear_deformation_modulus=0.02, elastic=1e7,"
    " damping=1e3, width=0.3"
)
CASES = {
    "vehicle": Case("straight", VEHICLE, overrides=SLOWER),
    "guided": Case("straight", (*VEHICLE, "vehicle.guide.clearance=1e-5"), overrides=SLOWER),
    "eleven teeth": Case("straight", (*VEHICLE, "vehicle.sprocket.outer_radius=0.285"), overrides=SLOWER),
    "dense teeth": Case("straight", (*VEHICLE, "vehicle.sprocket.teeth=20", "vehicle.sprocket.gaps_per_pin=2",
        "vehicle.sprocket.seat_clearance=0.006", "vehicle.sprocket.tip_radius=0.004",
        "vehicle.sprocket.flank_angle=0.05", "vehicle.idler.x=-4.043"), overrides=SLOWER),
    "lugged": Case("sprocket_bench", (*RIG, "vehicle.sprocket.teeth=6", "vehicle.sprocket.pins_per_gap=7",
        "vehicle.track.links=56", "vehicle.track.pitch=0.03", "vehicle.sprocket.outer_radius=0.26")),
    "tensioned": Case("straight", ("track.link_outputs=false",), 0.002, "vehicle.track.tension"),
    "on grousers": Case("straight", (*VEHICLE, GROUSERS, "start.height=-0.07"), overrides=SLOWER),
    "worn": Case("straight", (*VEHICLE, "vehicle.sprocket.pitch=0.1523"), overrides=SLOWER),
    "stopped": Case("straight", (*VEHICLE, "drive.stop=0.02", "drive.stop_time=5e-3"), 0.03),
    "motor": Case("straight", (*UNRAMPED, "drive.mode=torque", "drive.torque=5e3", "drive.brake=1e3")),
    "steered": Case("turn", (*STEERED, "drive.speed=20", "drive.left.speed=8")),
    "steered and stopped": Case("turn", (*STEERED, "drive.left.stop=0.02", "drive.right.stop=0.021",
        "drive.stop_time=5e-3"), 0.03),
    "two motors and brakes": Case("turn", (*UNRAMPED, "drive.mode=torque", "drive.left.torque=5e3",
        "drive.right.torque=4e3", "drive.brake=1e3")),
    "two sides": Case("marder", (*UNRAMPED, f"drive.left.speed_points={LEFT}", f"drive.right.speed_points={RIGHT}")),
    "tank": Case("tank", (*VEHICLE, "vehicle.suspension.bump_stop.gap=1e-4",
        "vehicle.suspension.rebound_stop.gap=1e-4")),
    "crawler": Case("crawler", (*VEHICLE, "vehicle.tensioner.recoil.preload=10")),
    "further wheel": Case("elevated_sprocket", (*VEHICLE, "tracks=['left']", "start.height=-0.05", "start.pitch=-0.1")),
    "bushed": Case("hanging_chain", ("chain.links=8", "track.start=displaced", BUSHED)),
    "joined": Case("differential", (*STEERED, *JOINED, "drive.speed=20")),
    "joined and stopped": Case("differential", (*STEERED, *JOINED, "drive.steering.stop=0.02",
        "drive.steering.stop_time=5e-3"), 0.03),
    "joined, two motors": Case("differential", (*UNRAMPED, "drive.mode=torque", "drive.torque=5e3",
        "drive.steering.mode=torque", "drive.steering.torque=1e3", "drive.steering.brake=200")),  # it slips
    "driven": Case("serpentine", (*QUICK[:1], *QUICK[3:],
        "driver.arcs=[[0.1, 0.05], [0.1, 0.2], [0.1, -0.1], [9, 0.1]]", "driver.reach=0.5", "driver.ramp_start=0",
        "driver.ramp_time=0.02", "driver.speed=0.03")),
    "on one track": Case("straight", (*VEHICLE, "tracks=['left']", "start.height=-0.05", "start.pitch=-0.06")),
    "buried": Case("straight", ("tracks=[]", "ground.hull=true", "start.height=-2.5", "start.pitch=0.1",
        "placed=true"), 0.002),
    "towing": Case("straight", (*VEHICLE, "hitch.force=2e4", "hitch.drag_points=[[-5, -1e5], [5, 1e5]]",
        "hitch.ramp_start=0.005", "hitch.ramp_time=0.02", "vehicle.seat.payload.position=[-2, 0.3, 0.5]",
        "seats=['driver', 'payload']"), overrides=SLOWER),
    "over a bump": Case("straight", (*VEHICLE, "ground.bump.start=-1.6", "ground.bump.rise=0.05",
        "ground.bump.slope=0.5", "ground.bump.length=0.12", "ground.bump.radius=0.05")),
    "on an incline": Case("straight", (*VEHICLE, "ground.grade=0.1", "ground.bank=-0.05", "ground.incline_start=-3",
        "ground.incline_length=1")),
    "on patches": Case("straight", (*VEHICLE, "start.height=-0.03",
        "ground.friction=[{x=[-3, -1.6], y=[-1.2, 1.2], factor=2},"
        " {x=[-1.5, -0.5], y=[-1.2, 1.2], coefficient=0.5}]")),
    "on a bank": Case("straight", (*VEHICLE[:-3], "drive.speed=20", "ground.bank=0.1",
        "start.equilibrium={height=-0.02, roll=0.01, pitch=0.01, left=[0.1, 0.1, 0.1, 0.1, 0.1, 0.01],"
        " right=[0.1, 0.1, 0.1, 0.1, 0.1, 0.01], lateral=0.01}"), 0.002),
    "over obstacles": Case("straight", (*VEHICLE, "start.height=-0.03",
        "ground.step={x=[-1.5], rise=0.05, radius=0.04}", "ground.half_round={x=[-2.3], radius=0.05, fillet=0.06}")),
    "over a trench": Case("straight", (*VEHICLE, "ground.trench={start=-2.4, width=0.4, depth=0.03, radius=0.02}")),
    "on waves": Case("straight", (*VEHICLE,
        "ground.washboard={amplitude=0.02, wavelength=0.7, phase=1, start=-4, end=-1}",
        "ground.rough={iso_class='E', seed=3, start=-3, length=1, period=20}")),
    "on a map": Case("straight", (*VEHICLE,
        "ground.heightmap={heights=[[0.01, 0.02], [0.03, 0.01]], corner=[-3, -1.2], spacing=[1.5, 2.4],"
        " start=-4, length=2}")),
    "on a kerb": Case("straight", (  # hull and bare wheels feel the same ground
        *VEHICLE, "tracks=[]", "ground.hull=true", "start.height=-0.15",
        "ground.kerb={y=1.1, rise=0.05, radius=0.02, start=-4, length=2}")),
    "on soil": Case("straight", (*VEHICLE, f"ground.soil={{{SOIL}, k0=5e7, Au=5e9}}")),
    "on soil that springs back": Case("straight", (*VEHICLE, f"ground.soil={{{SOIL}, rebound=0.2}}")),
    "follows an error": Case("sprocket_bench", ("drive.speed=2", "drive.ramp_time=0.05", "run.stop=0.03",
        "run.variable.estimate=power", "run.variable.tolerance=1e-2", "run.variable.energy=30",
        "run.variable.shortest=9e-4", "run.variable.longest=2e-3"), 0.03, "bench.upper"),
    "hanging": Case("hanging_chain", ("chain.links=8", "track.start=displaced")),
    "damped": Case("hanging_chain", ("chain.links=8", "track.start=displaced", "track.spectral_radius=0.8")),
    "adaptive": Case("hanging_chain", ("chain.links=8", "track.start=displaced", "track.integrator=adams",
        "track.rtol=1e-8", "track.atol=1e-8")),
    "sled": Case("shear_sled", (), 0.02, "chain.pull"),
    "released": Case("released_chain", ("chain.links=8",)),
    "ovalling": Case("spinning_loop", ("chain.links=16", "chain.ovalling=1"), ulp="chain.spin"),
    "sprung": Case("spinning_loop", ("chain.links=16", "chain.ovalling=1", "track.closure=spring",
        "track.closure_stiffness=1e5", "track.closure_damping=100"), ulp="chain.spin"),
    "spinning": Case("spinning_loop", ("chain.links=16",), ulp="chain.spin"),
    "bench": Case("sprocket_bench", ("drive.speed=2", "drive.ramp_time=0.01"), ulp="bench.upper"),
    "rig": Case("rig", RIG, ulp="drive.speed"),
    "tensioned rig": Case("rig", ("track.link_outputs=false",), 0.002, "rig.tension"),
    "two speeds": Case("rig", (*RIG, "idler_drive.mode=speed", "idler_drive.speed=2", "idler_drive.ramp_start=0.002",
        "idler_drive.ramp_time=0.01", "idler_drive.stop=0.015", "idler_drive.stop_time=0.01"), ulp="drive.speed"),
    "two motors": Case("rig", (*RIG, "idler_drive.torque=100", "idler_drive.brake=50"), ulp="drive.speed"),  # it slips
}  # fmt: skip
FLEXIBLE = ("cable", "beam")
WIDE = ("beam", *(model for model in TRACKS if model != "flexible"))
ALL = ("cable", *WIDE)


class Acts(NamedTuple):
    """Place of action of a key: a case, kinds of links, another value, outputs."""

    case: str
    kinds: tuple[str, ...] = ("cable",)  # of links; keys of other components are tested with the cheapest
    value: Any = None  # instead of FACTOR times the value
    seen: str = ""  # pattern of outputs, where the key changes no motion or force


# The first match counts; keys of the vehicle's parts act through the chassis or a drive, whatever the links.
KEYS: dict[str, Acts] = {
    "vehicle.chassis.hull.*": Acts("buried"),
    "vehicle.track.tension": Acts("tensioned", ALL),
    "vehicle.track.inertia.1": Acts("vehicle", ALL),
    "vehicle.track.inertia.*": Acts("vehicle", WIDE),  # a cable has inertia about its pin only
    "vehicle.track.links": Acts("vehicle", ALL, 65),
    "vehicle.track.bushing.preset": Acts("bushed", ("rigid",), seen="energy.strain"),  # torques of a loop cancel
    "vehicle.track.bushing.*": Acts("bushed", ("rigid",)),  # other links: tests/fmus/test_bushing.py
    "vehicle.track.grouser.width": Acts("on grousers", WIDE),
    "vehicle.track.grouser.*": Acts("on grousers", ALL),
    "vehicle.sprocket.pitch": Acts("worn", ("rigid",)),
    "vehicle.track.pitch": Acts("eleven teeth", ALL, 0.1527),
    "vehicle.track.width": Acts("vehicle", WIDE),  # a cable has contact on its line
    "vehicle.road_wheel.x.5": Acts("two sides", ("rigid",)),  # the m113 has five wheels a side
    "vehicle.road_wheel.x.6": Acts("tank"),
    "vehicle.return_roller.x.3": Acts("tank"),
    "vehicle.suspension.rotary_damper.wheels.*": Acts("tank", value=4),  # a wheel that has none
    **{
        f"vehicle.suspension.{name}.*": Acts("tank")
        for name in ("torsion_bar", "rotary_damper", "bump_stop", "rebound_stop")
    },
    "vehicle.tensioner.recoil.*": Acts("crawler"),
    "vehicle.return_roller.*": Acts("two sides", ("rigid",)),
    "vehicle.right.*": Acts("two sides", ("rigid",)),
    "vehicle.wheel.*": Acts("further wheel"),
    "vehicle.*.width": Acts("on one track"),
    "vehicle.track.*": Acts("vehicle", ALL),
    "vehicle.section.lateral_bending": Acts("vehicle", ("beam",)),  # a cable bends alike about both axes
    "vehicle.section.torsion": Acts("vehicle", ("beam",)),  # a cable has none
    "vehicle.section.outer_fibre": Acts("vehicle", FLEXIBLE, seen="stress.max"),
    "vehicle.section.*": Acts("vehicle", FLEXIBLE),
    "vehicle.material.shear_modulus": Acts("vehicle", ("beam",)),
    "vehicle.material.*": Acts("vehicle", FLEXIBLE),
    "vehicle.contact.*": Acts("vehicle", ALL),
    "vehicle.guide.clearance": Acts("guided", WIDE, 2e-5),  # cables stay in their plane
    "vehicle.sprocket.teeth": Acts("eleven teeth", ALL),
    "vehicle.sprocket.gaps_per_pin": Acts("dense teeth", ("rigid",), 3),
    "vehicle.sprocket.pins_per_gap": Acts("lugged", ("rigid",), 8),
    "vehicle.sprocket.*radius": Acts("vehicle", ALL),
    "vehicle.sprocket.seat_clearance": Acts("vehicle", ALL),
    "vehicle.sprocket.flank_angle": Acts("vehicle", ALL),
    "vehicle.suspension.preload": Acts("vehicle", value=1e3),
    "vehicle.tensioner.preload": Acts("vehicle", value=1e3),
    "vehicle.gravity": Acts("vehicle", ALL),
    "vehicle.hitch.?": Acts("towing", ("rigid",), seen="road_wheel*.position.?"),
    "vehicle.seat.*": Acts("towing", ("rigid",), seen="seat.*.velocity.?"),
    "hitch.*": Acts("towing", ("rigid",)),
    "vehicle.*": Acts("vehicle"),
    "push": Acts("on one track", value=1e3),  # on the idler without a track
    "start.equilibrium.*": Acts("on a bank", ("rigid",)),
    "start.position.?": Acts("vehicle", value=1.0, seen="*.position.*"),
    "start.heading": Acts("vehicle", value=0.5),
    "start.roll": Acts("buried", value=math.pi),
    "start.*": Acts("vehicle", value=0.02),
    "drive.steering.stop*": Acts("joined and stopped", ("rigid",)),
    "drive.steering.brake": Acts("joined, two motors", ("rigid",)),
    "drive.steering.torque": Acts("joined, two motors", ("rigid",)),
    "drive.steering.*": Acts("joined", ("rigid",), 0.03),
    "drive.*.stop*": Acts("steered and stopped", ("rigid",)),
    "drive.*.brake": Acts("two motors and brakes", ("rigid",)),
    "drive.*.torque": Acts("two motors and brakes", ("rigid",)),
    "drive.*.speed_points.*": Acts("two sides", ("rigid",)),
    "drive.*.*": Acts("steered", ("rigid",), 0.03),
    "drive.stop*": Acts("stopped"),
    "drive.brake": Acts("motor"),
    "drive.torque": Acts("motor"),
    "drive.*": Acts("vehicle", value=0.03),
    "driver.arcs.3.0": Acts("driven", ("rigid",), 0.1),
    "driver.ramp_*": Acts("driven", ("rigid",), 0.03),
    "driver.*": Acts("driven", ("rigid",)),
    "ground.bump.*": Acts("over a bump", ALL),
    "ground.grade": Acts("on an incline", ("rigid",)),
    "ground.bank": Acts("on an incline", ("rigid",)),
    "ground.incline_*": Acts("on an incline", ("rigid",)),
    "ground.friction.0.x.*": Acts("on patches", ("rigid",), -2.3),
    "ground.friction.1.x.*": Acts("on patches", ("rigid",), -1.0),
    "ground.friction.*.y.0": Acts("on patches", ("rigid",), -1.0),
    "ground.friction.*.y.1": Acts("on patches", ("rigid",), 1.0),
    "ground.friction.*": Acts("on patches", ("rigid",)),
    "ground.step.radius": Acts("over obstacles", ("rigid",), 0.05),
    "ground.half_round.fillet": Acts("over obstacles", ("rigid",), 0.08),
    "ground.rough.band.0": Acts("on waves", ("rigid",), 0.3),
    "ground.step.*": Acts("over obstacles", ("rigid",)),
    "ground.half_round.*": Acts("over obstacles", ("rigid",)),
    "ground.trench.*": Acts("over a trench", ("rigid",)),
    "ground.kerb.*": Acts("on a kerb"),
    "ground.washboard.*": Acts("on waves", ("rigid",)),
    "ground.rough.*": Acts("on waves", ("rigid",)),
    "ground.heightmap.*": Acts("on a map", ("rigid",)),
    "ground.soil.rebound": Acts("on soil that springs back", ("rigid",)),
    "ground.soil.*": Acts("on soil", ("rigid",)),
    "track.closure_*": Acts("sprung", ("rigid",)),
    "track.spectral_radius": Acts("damped", ("cable", "rigid")),
    "track.?tol": Acts("adaptive", ("rigid",), 1e-5),
    "track.step": Acts("released", value=5e-5),
    "run.variable.shortest": Acts("follows an error", value=1.9e-3),
    "run.variable.*": Acts("follows an error"),
    "run.step": Acts("vehicle", value=0.5e-3),
    "chain.pull": Acts("sled"),
    "chain.spin": Acts("spinning"),
    "chain.ovalling": Acts("ovalling"),
    "chain.span": Acts("hanging", value=0.79),
    "chain.links": Acts("hanging", value=9),
    "bench.links": Acts("bench"),
    "bench.*": Acts("bench"),
    "rig.tension": Acts("tensioned rig"),
    "rig.links": Acts("rig"),
    "rig.*": Acts("rig"),
    "idler_drive.brake": Acts("two motors", seen="track.idler.torque.y"),
    "idler_drive.torque": Acts("two motors", seen="track.idler.torque.y"),
    "idler_drive.*": Acts("two speeds"),
}
# Duration, recording, checks, limits and what only views show: they must not change any computed value.
APART = (
    "run.start", "run.stop", "run.outputs", "run.links", "run.checkpoints", "expect.*", "vehicle.tensioner.travel",
    "vehicle.return_roller.width", "vehicle.longest_step", "vehicle.life.*",
    "vehicle.track.bushing.wear", "vehicle.track.bushing.bearing",
    "vehicle.track.belt.*",  # the numbers of links must follow: tests/fmus/test_belts.py
)  # fmt: skip
# Keys of [track] that are no numbers: tests/regression/runs.py has runs with each choice.
CHOICES = (
    "element", "elasticity", "axes", "formulation", "joints", "coordinates", "closure", "integrator", "start",
)  # fmt: skip
