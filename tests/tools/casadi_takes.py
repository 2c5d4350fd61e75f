"""CasADi tried: ``python -m tests.tools.casadi_takes FOLDER``. Needs cotrack[native] and casadi==3.8.2."""

from zipfile import ZipFile

from casadi import DaeBuilder

from tests.tools.made import fmu, folder, said

EXPECTED = {
    "FMI 2": "wants model exchange",
    "FMI 3": "stops at a String",
}
REASONS = {"must be of ModelExchange type": "wants model exchange", "Cannot handle: Start": "stops at a String"}


def read(fmi: int) -> str:
    unpacked = place / f"unpacked_drive_{fmi}"
    with ZipFile(fmu(place, fmi)) as packed:
        packed.extractall(unpacked)
    try:
        return str(DaeBuilder("drive", str(unpacked)).y())
    except RuntimeError as error:
        return next((short for text, short in REASONS.items() if text in str(error)), str(error))


place = folder()
said("CasADi 3.8.2", {"FMI 2": read(2), "FMI 3": read(3)}, EXPECTED)
