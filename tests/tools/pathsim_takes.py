"""PathSim tried: ``python -m tests.tools.pathsim_takes FOLDER``.

Its block reads all outputs as scalar Reals; our FMUs have an Int32 and, in FMI 3.0, arrays among them.
Needs cotrack[native], pathsim==0.27.1 and, for its block of FMUs, pathsim-fmi==0.1.1.
"""

import numpy as np
from pathsim import Connection, Simulation
from pathsim.blocks import Scope
from pathsim_fmi import CoSimulationFMU

from tests.tools.made import STEPS, H, attempt, fmu, folder, said, speed_at, times

EXPECTED = {
    "FMI 2": "refused (FMICallException)",
    "FMI 3": "refused (FMICallException)",
}


def run(fmi: int) -> str:
    drive = CoSimulationFMU(fmu(place, fmi), dt=H)
    scope = Scope()
    simulation = Simulation([drive, scope], [Connection(drive["speed"], scope)], dt=H, log=False)
    simulation.run(STEPS * H)
    speed = np.asarray(scope.read()[1]).ravel()[-1]
    return times(speed, speed_at(STEPS * H))


place = folder()
FOUND = {
    "FMI 2": attempt(lambda: run(2)),
    "FMI 3": attempt(lambda: run(3)),
}
said("PathSim 0.27.1 (pathsim-fmi 0.1.1)", FOUND, EXPECTED)
