"""ospx tried: ``python -m tests.tools.ospx_takes FOLDER``. Needs cotrack[native] and ospx==0.3.5."""

from pathlib import Path

from ospx.fmi.fmu import FMU

from tests.tools.made import attempt, fmu, folder, said

EXPECTED = {
    "FMI 2": "83 variables",
    "FMI 3": "0 variables",
}


def read(fmi: int) -> str:
    variables = FMU(Path(fmu(place, fmi))).variables
    return f"{len(variables)} variables"


place = folder()
said("ospx 0.3.5", {"FMI 2": attempt(lambda: read(2)), "FMI 3": attempt(lambda: read(3))}, EXPECTED)
