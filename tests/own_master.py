"""Example of a user's own master: the vehicle drives off, with fmpy and the four standard FMUs alone.

``cotrack build -o FOLDER``, then ``python tests/own_master.py FOLDER [TrackFlexible|TrackRigid] [STOP]``.
"""

import sys
from shutil import rmtree

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

MOTION = [f"{group}.{axis}" for group in ("position", "orientation", "velocity", "angular_velocity")
          for axis in ("wxyz" if group == "orientation" else "xyz")]  # fmt: skip
WRENCH = [f"{group}.{axis}" for group in ("force", "torque") for axis in "xyz"]
H = 1.25e-3  # s


def load(folder, kind, name):
    """Return an instance, unpacked into its own folder, and the value references of its variables by name."""
    unpacked = extract(f"{folder}/{kind}.fmu")
    said = read_model_description(unpacked)
    fmu = FMU2Slave(guid=said.guid, unzipDirectory=unpacked, modelIdentifier=kind, instanceName=name)
    fmu.instantiate(loggingOn=True)
    return fmu, {variable.name: variable.valueReference for variable in said.modelVariables}


def main(folder, track="TrackFlexible", stop=0.1, speed=None, ramp=None, lateral=1.0795):
    """Position and speed of the chassis after ``stop`` s; unset drives keep their scene's profile."""
    order = {f"{side}_{part}": kind for part, kind in (("track", track), ("drive", "SprocketDrive"))
             for side in ("left", "right")} | {"chassis": "Chassis"}  # fmt: skip
    fmus, where = {}, {}
    for name, kind in order.items():
        fmus[name], where[name] = load(folder, kind, name)
    feeds = []  # source, its references, target, its references

    def connect(giver, connector, taker, port, names):
        feeds.append((giver, [where[giver][f"{connector}.{n}"] for n in names],
                      taker, [where[taker][f"{port}.{n}"] for n in names]))  # fmt: skip

    for side in ("left", "right"):
        chain, drive = f"{side}_track", f"{side}_drive"
        for name in (chain, drive) if side == "right" else ():  # the left side's place is the default
            fmus[name].setReal([where[name]["start.lateral"]], [-lateral])
        profile = {} if speed is None else {"speed.end": speed}
        profile |= {} if ramp is None else {"ramp.start": ramp[0], "ramp.end": ramp[1]}
        fmus[drive].setReal([where[drive][name] for name in profile], list(profile.values()))
        pairs = [(drive, "sprocket", chain, "sprocket"), ("chassis", f"{side}.sprocket", drive, "mount")]
        wheels = [f"road_wheel[{i}]" for i in range(1, 6)] + ["idler"]
        pairs += [("chassis", f"{side}.{wheel}", chain, wheel) for wheel in wheels]
        for mover, connector, pusher, port in pairs:
            connect(mover, connector, pusher, port, MOTION)
            connect(pusher, port, mover, connector, WRENCH)
    for fmu in fmus.values():
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
    for k in range(round(stop / H)):
        for name, fmu in fmus.items():  # order of the steps: tracks, drives, chassis
            for giver, given, taker, taken in feeds:
                if taker == name:
                    fmu.setReal(taken, fmus[giver].getReal(given))
            fmu.doStep(k * H, H)
    shown = ("chassis.position.x", "chassis.position.z", "speed")
    values = fmus["chassis"].getReal([where["chassis"][name] for name in shown])
    for fmu in fmus.values():
        fmu.terminate()
        fmu.freeInstance()
        rmtree(fmu.unzipDirectory)
    return dict(zip(shown, values, strict=True))


if __name__ == "__main__":
    print(main(*sys.argv[1:3], *map(float, sys.argv[3:4])))
