"""The rig with a drive that is not ours."""

import foreign_fmus
from foreign_fmus import DRIVE, UNITS, library_of

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
