"""fmuloader tried: ``python -m tests.tools.fmuloader_takes FOLDER``.

Its class for FMI 2.0 loads functions of model exchange, which FMUs for co-simulation alone need not have.
Needs cotrack[native] and fmuloader==0.1.2rc0.
"""

from fmpy import read_model_description
from fmuloader.fmi2 import Fmi2Slave, Fmi2Type
from fmuloader.fmi3 import Fmi3Slave

from tests.tools.made import STEPS, H, attempt, fmu, folder, said, speed_at, times

EXPECTED = {
    "FMI 2": "refused (AttributeError)",
    "FMI 3": "1 times",
    "arrays": "refused (Fmi3Error)",
    "Enumeration by number": "0 times",
}


def two() -> str:
    about = read_model_description(fmu(place, 2))
    speed = next(v.valueReference for v in about.modelVariables if v.name == "speed")
    slave = Fmi2Slave(fmu(place, 2), model_identifier=about.coSimulation.modelIdentifier)
    slave.instantiate("drive", Fmi2Type.CO_SIMULATION, guid=about.guid)
    slave.setup_experiment(start_time=0.0)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    for k in range(STEPS):
        slave.do_step(k * H, H)
    return times(slave.get_real([speed])[0], speed_at(STEPS * H))


def three(name: str, mode: int = 1) -> str:
    about = read_model_description(fmu(place, 3))
    references = {v.name: v.valueReference for v in about.modelVariables}
    slave = Fmi3Slave(fmu(place, 3), model_identifier=about.coSimulation.modelIdentifier)
    slave.instantiate_co_simulation("drive", instantiation_token=about.guid)
    slave.set_int64([references["mode"]], [mode])
    slave.enter_initialization_mode(start_time=0.0)
    slave.exit_initialization_mode()
    for k in range(STEPS):
        slave.do_step(k * H, H)
    value = slave.get_float64([references[name]])
    return times(value[0], speed_at(STEPS * H)) if name == "speed" else str([*value])


place = folder()
FOUND = {
    "FMI 2": attempt(two),
    "FMI 3": attempt(lambda: three("speed")),
    "arrays": attempt(lambda: three("sprocket.orientation")),
    "Enumeration by number": attempt(lambda: three("speed", 2)),
}
said("fmuloader 0.1.2rc0", FOUND, EXPECTED)
