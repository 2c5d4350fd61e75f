"""The rig with a drive that is not ours."""

import foreign_fmus
from foreign_fmus import DRIVE, UNITS, Variable, library_of

from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load

H, TORQUE, INERTIA = 1e-3, 2000.0, 20.0
SHORT = {"run.stop": 0.1, "run.step": H, "expect": {}, "track.link_outputs": False}
PARAMETERS = {"torque": TORQUE, "inertia": INERTIA}


def rig(fmu=None, parameters=PARAMETERS, **settings):
    """The rig with rigid links, in short."""
    entry = {"fmu.drive": {"file": str(fmu), "parameters": dict(parameters)}} if fmu else {}
    return load("rig", "rigid", {**SHORT, **entry, **settings})


def changed(drive, file, change, units=UNITS):
    """The drive with other variables in its description."""
    variables = [new for each in DRIVE if (new := change(each)) is not None]
    return foreign_fmus.build(file, "drive", variables, units, library_of(drive))


MORE = (
    Variable("ticks", "input", 0, "Integer"),
    Variable("gate", "input", False, "Boolean"),
    Variable("pull", "input", unit="kN"),
)


def brake_fmu(tmp_path_factory):
    """The drive at the place of the idler, with further inputs."""
    units, place = {**UNITS, "kN": {**UNITS["N"], "factor": 1e3}}, -placed(rig()).rig.axle_distance
    there = [each._replace(start=place) if each.name.endswith("mount.position.x") else each for each in DRIVE]
    return foreign_fmus.build(tmp_path_factory.mktemp("brake") / "Brake.fmu", "drive", (*there, *MORE), units)


def braked(drive, brake, *connections):
    """The rig with FMUs of the user at both ends, and connections to them."""
    given = {"file": str(brake), "parameters": {"torque": 0.0, "inertia": INERTIA}}
    return rig(drive, **{"fmu.idler_drive": given, "connections": connections})
