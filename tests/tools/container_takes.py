"""FMUContainer tried: ``python -m tests.tools.container_takes FOLDER``.

Needs cotrack[native] and fmu-manipulation-toolbox==2.0, and fmpy==0.3.32 to run the containers.
"""

import subprocess
import sys
from pathlib import Path

from fmpy import read_model_description, simulate_fmu

from tests.tools.made import STEPS, H, attempt, folder, said, speed_at, times

EXPECTED = {
    "archive": "0 outputs",
    "system connector": "1 output",
    "its numbers": "1 times",
    "parameter set": "1 times",
    "LinearTransformation": "1 times",
    "DefaultExperiment": "0.0 to 14.0 s",
    "units": "None",
    "archive with FMI 3": "1 times",
    "the same as FMI 3": "1 times",
}
TOOL = Path(sys.executable).parent / "fmucontainer"
ELEMENTS = ["shown.first", "shown.own", "shown.turned"]


def container(name: str, fmi: int = 2) -> str:
    file = place / f"{name}.fmu"
    file.unlink(missing_ok=True)
    command = [TOOL, "-container", f"{name}.ssp", "-fmu-directory", ".", "-fmi", str(fmi)]
    done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
    if not file.exists():
        raise RuntimeError(done.stdout + done.stderr)
    return str(file)


def outputs(name: str) -> int:
    return sum(each.causality == "output" for each in read_model_description(container(name)).modelVariables)


def values(name: str, shown: list[str], fmi: int = 2) -> list[float]:
    file = container(name, fmi)
    rows = simulate_fmu(file, stop_time=STEPS * H, step_size=H, output_interval=H, output=shown)
    return [float(rows[each][-1]) for each in shown]


def of_mount(name: str) -> str:
    first, own, turned = values(name, ELEMENTS)
    return times(turned - own, first)


def experiment() -> str:
    times = read_model_description(container("later")).defaultExperiment
    return f"{times.startTime} to {times.stopTime} s"


def units() -> str:
    return str(next(v.unit for v in read_model_description(container("system")).modelVariables if v.name[-1] == "d"))


place = folder()
FOUND = {
    "archive": attempt(lambda: f"{outputs('drives')} outputs"),
    "system connector": attempt(lambda: f"{outputs('system')} output"),
    "its numbers": attempt(lambda: of_mount("named_drives")),
    "parameter set": attempt(lambda: times(values("named_set", ELEMENTS)[0], speed_at(STEPS * H))),
    "LinearTransformation": attempt(lambda: of_mount("named_scaled")),
    "DefaultExperiment": attempt(experiment),
    "units": attempt(units),
    "archive with FMI 3": attempt(lambda: times(values("named_three", ELEMENTS[:1])[0], speed_at(STEPS * H))),
    "the same as FMI 3": attempt(lambda: times(values("named_three", ELEMENTS[:1], 3)[0], speed_at(STEPS * H))),
}
said("FMUContainer 2.0", FOUND, EXPECTED)
