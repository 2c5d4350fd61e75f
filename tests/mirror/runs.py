"""The runs that are checked: vehicles that start turned, drive, yaw, brake and nod.

Further runs have the outputs that a vehicle does not use: pulled and free ends, hulls on the ground.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from vehicle_in_process import InProcess

from fmus.track.link_outputs import GROUPS
from mirror.record import Record
from orchestrator.scene.scene import load

# The tension puts the idler where it was when tolerances of what one step samples were set (touch-down, pins that
# pass). With 14.38 kN a horn force is at 1.3 of what is allowed at 1 ms, and all are below 0.21 at 0.5 ms.
PLACE = ("vehicle.track.tension=14377.4266 N", "start.heading=37 deg", "start.position=[12.0, -7.0, 0.4]")
DRIVE = (
    "drive.ramp_start=0 s", "drive.ramp_time=0.3 s", "drive.speed=12 rad/s", "drive.stop=0.5 s",
    "drive.stop_time=0.1 s", "vehicle.contact.ground.friction=0.9", "run.step=1 ms",
)  # fmt: skip
# all link outputs of a track
ALL = f"track.link_outputs={json.dumps(list(GROUPS))}"
EVERY = "run.links=1"  # means of links over one communication step
HUNT_CROSSLEY = tuple(f"vehicle.contact.{pair}.law=hunt_crossley" for pair in ("ground", "wheel", "sprocket"))
DENSE = (  # a tooth between every second gap
    "vehicle.sprocket.teeth=21", "vehicle.sprocket.gaps_per_pin=2", "vehicle.sprocket.outer_radius=0.272",
)  # fmt: skip
LUGGED = "vehicle.sprocket.pins_per_gap=2", "vehicle.track.pitch=0.0762", "bench.links=64"
STEPS = "run.step=1 ms", "track.step=1 ms"  # the steps that the checks' tolerances assume
RAISED = "start.height=5 cm", "start.pitch=2 deg"
UNLIKE = tuple(  # wheels
    f"vehicle.road_wheel.{key}={numbers}"
    for key, numbers in {
        "radius": [0.25, 0.305, 0.31, 0.29, 0.27], "z": [-0.19, -0.215, -0.22, -0.2, -0.21],
        "width": [0.35, 0.381, 0.37, 0.3, 0.38], "mass": [377.0, 561.0, 570.0, 500.0, 440.0],
        "spin_inertia": [11.8, 26.1, 27.0, 21.0, 16.0], "transverse_inertia": [9.0, 20.0, 21.0, 16.0, 12.0],
    }.items()
)  # fmt: skip
BEAMS = (  # of three and two wheels, whose arms differ, and idlers on slides at an angle
    "vehicle.road_arm.beams=[[1, 2, 3], [4, 5]]",
    "vehicle.road_arm.mass=[90, 40, 120, 60, 30]", "vehicle.road_arm.pin_inertia=[3, 0.5, 5, 1, 0.6]",
    "vehicle.road_arm.long_inertia=[0.4, 0.2, 0.5, 0.3, 0.1]", "vehicle.tensioner.angle=0.3",
    "vehicle.road_arm.pivot=[[-0.717, 0.3], [-0.05, 0.3], [0.617, 0.3], [-0.3, 0.1], [0.366, 0.1]]",
)  # fmt: skip
# the left drive is slower and controlled, or braked
TURN = {"left_drive": {"mode": "controller", "speed.end": 2.0}, "right_drive": {"speed.end": 16.0}}
BRAKED = {
    "left_drive": {"mode": "torque", "torque.drive": 2000.0, "brake.torque": 3000.0},
    "right_drive": {"speed.end": 16.0},
}


def vehicle(model: str, *settings: str, overrides=None, duration: float = 0.65) -> Record:
    scene = load("straight", model, [*PLACE, *DRIVE, *STEPS, ALL, EVERY, *settings])
    return Record(InProcess(scene, overrides), duration)


def other(scene: str, model: str, *settings: str, overrides=None, duration: float = 0.2) -> Record:
    return Record(InProcess(load(scene, model, [*PLACE, ALL, EVERY, *settings]), overrides), duration)


SOFT = (
    "vehicle.material.youngs_modulus=2e6 Pa", "vehicle.material.shear_modulus=769e3 Pa",
    "vehicle.material.relaxation_time=100 ms",
)  # fmt: skip
LINKS = {
    "rigid": ("rigid",),
    "cable": ("flexible",),
    "beam": ("flexible", "track.element=beam"),
    "planar": ("flexible", "planar=true"),
}
SOFT_LINKS = {kind: (*settings, *SOFT) for kind, settings in LINKS.items()} | {
    name: ("flexible", f"track.elasticity={name}", *SOFT) for name in ("general", "engineering")
}


EXPLICIT, UNDAMPED = ("track.integrator=runge_kutta",), ("vehicle.material.relaxation_time=0.1 ms",)


def swinging(model: str, *settings: str, overrides=None, duration: float = 0.2) -> Record:
    """A chain that swings between its pins."""
    return other("hanging_chain", model, "track.start=displaced", *settings, overrides=overrides, duration=duration)


def drawn(model: str, *settings: str, overrides=None, duration: float = 0.2) -> Record:
    """A chain that forces on its ends pull over a driven sprocket."""
    drive = "drive.speed=4 rad/s", "drive.ramp_time=0.1 s", "run.step=0.5 ms"
    return other("sprocket_bench", model, *drive, *settings, overrides=overrides, duration=duration)


def free(model: str, *settings: str) -> Record:
    """A chain held at one end; steel pin forces depend on the last correction by 20 N per nanometre."""
    fine = {} if model == "rigid" else {"chain": {"tolerance": 1e-11}}
    return other("released_chain", model, "chain.links=12", "run.step=0.2 ms", *settings, overrides=fine, duration=0.04)


def thrown(*settings: str) -> Record:
    """A vehicle without tracks, thrown nose down onto the ground so that hull and wheels touch it; it tows."""
    load_on_hitch = (
        "hitch.force=3 kN", "hitch.drag_points=[[-9, -4e3], [0, 0], [4, 1e4]]", "hitch.ramp_start=0.05 s",
        "hitch.ramp_time=0.2 s", "seats=['driver']",
    )  # fmt: skip
    scene = load("straight", "rigid", [*PLACE, "tracks=[]", "ground.hull=true", "start.height=0.3 m",
                                       "start.pitch=0.35", "run.step=1 ms", *load_on_hitch, *settings])  # fmt: skip
    system = InProcess(scene)
    for axis, force in zip("xyz", (-2e3, 1.5e3, -3e3), strict=True):  # of another component
        system["chassis"].u[system["chassis"].inputs.index(f"hitch.force.{axis}")] = force
    x = system["chassis"].model.state
    c, s = np.cos(np.radians(37.0)), np.sin(np.radians(37.0))
    x[7:13] = 3.0 * c + 0.5 * s, 3.0 * s - 0.5 * c, -0.5, 0.3, 0.4, 0.6
    system["chassis"].model.outputs(system["chassis"].y)
    return Record(system, 0.5)


def sloping(model: str, *settings: str, duration: float = 0.3) -> Record:
    """A vehicle that climbs across a slope; pads that creep depend on the last correction by newtons."""
    fine = {} if model == "rigid" else {"*_track": {"tolerance": 1e-11}}
    return vehicle(model, "ground.grade=0.2", "ground.bank=0.12", "drive.ramp_time=0.1 s", *settings,
                   overrides={"left_drive": {"speed.end": 18.0}, **fine}, duration=duration)  # fmt: skip


def sinking(model: str, *settings: str, duration: float = 0.3) -> Record:
    """A vehicle that drives off on firm sand, its left side faster; links leave its ruts and come down again."""
    return vehicle(model, "ground.soil.name=lete_sand", "drive.ramp_time=0.1 s", "drive.speed=16 rad/s", *settings,
                   overrides={"left_drive": {"speed.end": 22.0}}, duration=duration)  # fmt: skip


GROUSERS = "vehicle.track.grouser={height=0.015, length=0.04, width=0.3, count=2}"


def waving(*settings: str, duration: float = 0.2) -> Record:
    """A vehicle on waves that end beneath it, other ones on its right side; links have 6 and 4 points."""
    waves = 'ground.washboard={amplitude=0.005, wavelength=0.9, phase="70 deg", start=7.0, end=11.6}'
    place = "start.position=[12.0, 1.0, 0.4]", "start.height=2 mm", "ground.refinement=[3, 2]"
    return vehicle("rigid", waves, *place, "ground.grade=0.05", *settings, duration=duration)


def driven(*settings: str, duration: float = 0.8) -> Record:
    """A vehicle that follows a path to the left and to the right."""
    path = "driver.arcs=[[0.3, 0], [1, 0.2], [2, -0.2]]", "driver.ramp_start=0 s", "driver.ramp_time=0.3 s"
    return other("serpentine", "rigid", *path, "driver.speed=3 m/s", *settings, duration=duration)


def joined() -> Record:
    """A vehicle with a differential and a controller; its right side is faster for a while."""
    motors = (
        "drive.mode=controller", "drive.speed=8 rad/s", "drive.ramp_start=0 s", "drive.ramp_time=0.3 s",
        "drive.stop=0.5 s", "drive.stop_time=0.1 s", "drive.brake=800 N m", "drive.steering.speed=9 rad/s",
        "drive.steering.ramp_start=0 s", "drive.steering.ramp_time=0.3 s",
    )  # fmt: skip
    return other("differential", "rigid", *motors, duration=0.65)


class Run(NamedTuple):
    """A run: the function that makes it, and components without checks, because they repeat another one."""

    make: Callable[[], Record]
    without: tuple[str, ...] = ()


SIDE = ("left_track", "left_drive", "right_drive", "chassis")  # the right track is checked
ALONE = ("left_track", "right_track", "left_drive", "right_drive")  # the chassis is checked
RUNS = {
    "rigid": Run(lambda: vehicle("rigid", overrides=TURN), ("left_track",)),
    "cable": Run(lambda: vehicle("flexible", overrides={"left_drive": {"speed.end": 10.0}}), ("right_track",)),
    "turning": Run(  # little clearance, so that guides lose energy within the run
        lambda: vehicle("flexible", "track.axes=free", "vehicle.guide.clearance=3 mm",
                        overrides={"left_drive": {"speed.end": 18.0}}),
        ("right_track", "left_drive", "right_drive", "chassis"),
    ),
    "beam": Run(lambda: vehicle("flexible", "track.element=beam", overrides=BRAKED), ("left_track",)),
    "planar": Run(lambda: vehicle("flexible", "symmetric=true", "planar=true", *RAISED)),
    "thrown": Run(thrown),
    "thrown on a slope": Run(partial(thrown, "ground.grade=0.2", "ground.bank=-0.3", *HUNT_CROSSLEY, *UNLIKE)),
    "sloping": Run(partial(sloping, "rigid"), ("left_track",)),
    "sloping turning": Run(partial(sloping, "flexible", "track.axes=free", duration=0.65), ("left_track", "chassis")),
    "waving": Run(waving, SIDE),
    "sinking": Run(partial(sinking, "rigid"), SIDE),
    "waving on grousers": Run(partial(waving, GROUSERS), SIDE),
    "sinking on grousers": Run(partial(sinking, "rigid", GROUSERS, "ground.soil.cohesion=0 Pa"), SIDE),
    "beams": Run(lambda: vehicle("rigid", *BEAMS, overrides=TURN), ALONE),
    "joined": Run(joined, ("left_track", "right_track", "chassis")),
    "driven": Run(  # without friction, slip follows from the width alone
        partial(driven, "driver.friction=0", *DENSE),
        ("left_track", "right_track", "left_drive", "right_drive", "chassis"),
    ),
    "gripping": Run(partial(driven, "driver.ramp_time=1.5 s", "driver.speed=1.4 m/s", duration=1.8),
                    ("left_track", "right_track", "left_drive", "right_drive", "chassis")),
    "hht rigid": Run(
        partial(drawn, "rigid", "track.integrator=hht", "track.spectral_radius=0.8", *HUNT_CROSSLEY, *DENSE)
    ),
    "lugs": Run(partial(drawn, "rigid", *LUGGED)),
    "explicit rigid": Run(partial(drawn, "rigid", *EXPLICIT, "bench.transverse_damping=0 N s/m", duration=0.02)),
    "explicit cable": Run(partial(swinging, *SOFT_LINKS["cable"], *EXPLICIT, *UNDAMPED, duration=0.05)),
    **{f"{name} {kind}": Run(partial(make, *settings))
       for name, make, kinds in (("drawn", drawn, LINKS), ("swinging", swinging, SOFT_LINKS), ("free", free, LINKS))
       for kind, settings in kinds.items()},
}  # fmt: skip
# Each compiles half a minute; the runs above have the same outputs.
STUDIES = {
    **{name: Run(partial(vehicle, "flexible", "symmetric=true", f"track.elasticity={name}"))
       for name in ("general", "engineering")},
    "waving hunt_crossley": Run(partial(waving, *HUNT_CROSSLEY), SIDE),
    # with cohesion, the last correction decides whether a point that hardly touches has shear or none
    "sinking refined": Run(partial(sinking, "rigid", "ground.refinement=[2, 2]", "ground.soil.cohesion=0 Pa"), SIDE),
    "sinking turning": Run(partial(sinking, "flexible", "track.axes=free", "ground.soil.cohesion=0 Pa"), SIDE),
}  # fmt: skip


def record(name: str) -> Record:
    """Make a run and return its record."""
    return (RUNS | STUDIES)[name].make()
