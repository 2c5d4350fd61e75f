"""Example of a user's own master: a vehicle drives off, with fmpy and its FMUs alone.

``cotrack build --vehicle NAME -o FOLDER`` or ``cotrack ssp SCENE -o FILE.ssp``, of two tracks, two drives and a
chassis; then ``python tests/own_master.py FOLDER|FILE.ssp [TrackFlexible|TrackRigid] [STOP]``. It reads wheels, lateral
places and communication step from the model descriptions.
"""

import sys
from pathlib import Path
from shutil import rmtree

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

MOTION = [f"{group}.{axis}" for group in ("position", "orientation", "velocity", "angular_velocity")
          for axis in ("wxyz" if group == "orientation" else "xyz")]  # fmt: skip
WRENCH = [f"{group}.{axis}" for group in ("force", "torque") for axis in "xyz"]


def file_of(folder, kind, name):
    """Return the FMU of a part: its own, in an archive or where the sides differ, else that of its kind."""
    own = (folder / "resources" / f"{name}.fmu", folder / f"{kind}-straight-{name}.fmu")
    return next((file for file in own if file.exists()), folder / f"{kind}.fmu")


def load(file, name):
    """Return an instance, unpacked into its own folder, its variables by name, and the experiment it is made for."""
    unpacked = extract(str(file))
    said = read_model_description(unpacked)
    kind = said.coSimulation.modelIdentifier
    fmu = FMU2Slave(guid=said.guid, unzipDirectory=unpacked, modelIdentifier=kind, instanceName=name)
    fmu.instantiate(loggingOn=True)
    return fmu, {variable.name: variable for variable in said.modelVariables}, said.defaultExperiment


def wheels_of(chassis, side):
    """Names of the wheels that the chassis moves on a side; the sprocket is the drive's, which has its mount there."""
    motions = (name.split(".") for name in chassis if name.startswith(f"{side}.") and name.endswith(".position.x"))
    return [wheel for _, wheel, *_ in motions if wheel != "sprocket"]


def main(vehicle, track="TrackFlexible", stop=0.1, speed=None, ramp=None):
    """Position and speed of the chassis after ``stop`` s; unset drives keep their scene's profile."""
    packed = str(vehicle).endswith(".ssp")
    folder = Path(extract(str(vehicle)) if packed else vehicle)
    order = {f"{side}_{part}": kind for part, kind in (("track", track), ("drive", "SprocketDrive"))
             for side in ("left", "right")} | {"chassis": "Chassis"}  # fmt: skip
    fmus, said = {}, {}
    for name, kind in order.items():
        fmus[name], said[name], experiment = load(file_of(folder, kind, name), name)
    where = {name: {each: v.valueReference for each, v in variables.items()} for name, variables in said.items()}
    h = float(experiment.stepSize)  # s
    feeds = []  # source, its references, target, its references

    def connect(giver, connector, taker, port, names):
        feeds.append((giver, [where[giver][f"{connector}.{n}"] for n in names],
                      taker, [where[taker][f"{port}.{n}"] for n in names]))  # fmt: skip

    for side in ("left", "right"):
        chain, drive = f"{side}_track", f"{side}_drive"
        for name in (chain, drive) if side == "right" else ():  # one FMU serves both sides: its place is the left one's
            fmus[name].setReal([where[name]["start.lateral"]], [-abs(float(said[name]["start.lateral"].start))])
        profile = {} if speed is None else {"speed.end": speed}
        profile |= {} if ramp is None else {"ramp.start": ramp[0], "ramp.end": ramp[1]}
        fmus[drive].setReal([where[drive][name] for name in profile], list(profile.values()))
        pairs = [(drive, "sprocket", chain, "sprocket"), ("chassis", f"{side}.sprocket", drive, "mount")]
        pairs += [("chassis", f"{side}.{wheel}", chain, wheel) for wheel in wheels_of(said["chassis"], side)]
        for mover, connector, pusher, port in pairs:
            connect(mover, connector, pusher, port, MOTION)
            connect(pusher, port, mover, connector, WRENCH)
    for fmu in fmus.values():
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
    for k in range(round(stop / h)):
        for name, fmu in fmus.items():  # order of the steps: tracks, drives, chassis
            for giver, given, taker, taken in feeds:
                if taker == name:
                    fmu.setReal(taken, fmus[giver].getReal(given))
            fmu.doStep(k * h, h)
    shown = ("chassis.position.x", "chassis.position.z", "speed")
    values = fmus["chassis"].getReal([where["chassis"][name] for name in shown])
    for fmu in fmus.values():
        fmu.terminate()
        fmu.freeInstance()
        rmtree(fmu.unzipDirectory)
    if packed:
        rmtree(folder)
    return dict(zip(shown, values, strict=True))


if __name__ == "__main__":
    print(main(*sys.argv[1:3], *map(float, sys.argv[3:4])))
