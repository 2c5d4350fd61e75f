"""FMPy tried: ``python -m tests.tools.fmpy_takes FOLDER``. Needs cotrack[native] and fmpy==0.3.32."""

from fmpy import read_model_description, simulate_fmu
from fmpy.ssp.simulation import simulate_ssp

from tests.tools.made import PLACES, STEPS, H, attempt, fmu, folder, said, speed_at, times

EXPECTED = {
    "FMI 2": "1 times",
    "choices by text, FMI 2": "0 times",
    "FMI 3": "1 times",
    "arrays": "[1.0, 2.0, 3.0]",
    "Enumeration by name": "refused (ValueError)",
    "Enumeration by number": "0 times",
    "DefaultExperiment of FMU": "to 14 s",
    "archive": "1 times",
    "parameter set": "1 times",
    "numbers of FMUs of one shape": "its own",
    "LinearTransformation": "1 times",
    "DefaultExperiment of archive": "0 to 0.99 s",
    "system connector": "refused (ValueError)",
    "system connector of another name": "1 times",
    "archive with FMI 3": "refused (Exception)",
    "units": "rad/s, RotationalSpeed, rpm",
}
MOUNT, OWN = "second.sprocket.angular_velocity.y", "second.speed"


def run(fmi: int, **values: object) -> str:
    rows = simulate_fmu(fmu(place, fmi), stop_time=STEPS * H, output_interval=H, start_values=values)
    return times(rows["speed"][-1], speed_at(STEPS * H))


def array() -> str:
    rows = simulate_fmu(fmu(place, 3), stop_time=0.01, output_interval=H, output=["sprocket.position"],
                        start_values={"mount.position": [1.0, 2.0, 3.0]})  # fmt: skip
    return str([float(value) for value in rows["sprocket.position"][-1]])


def system(name: str) -> dict[str, float]:
    rows = simulate_ssp(str(place / f"{name}.ssp"), stop_time=STEPS * H, step_size=H)
    return {column: float(rows[column][-1]) for column in rows.dtype.names}


def of_mount(name: str) -> str:
    row = system(name)
    return times(row[MOUNT] - row[OWN], row["first.speed"])


def of_shown() -> str:
    row = system("named_drives")
    return times(row["shown.turned"] - row["shown.own"], row["shown.first"])


def numbers() -> str:
    row = system("numbers")
    places = row["first.sprocket.position.x"], row["second.sprocket.position.x"]
    return PLACES.get(places, str(places))


def experiment_of_archive() -> str:
    times = simulate_ssp(str(place / "later.ssp"))["time"]
    return f"{times[0]:g} to {times[-1]:g} s"


def units() -> str:
    speed = next(v for v in read_model_description(fmu(place, 3)).modelVariables if v.name == "speed")
    return f"{speed.unit}, {speed.declaredType.name}, {speed.displayUnit}"


place = folder()
FOUND = {
    "FMI 2": attempt(lambda: run(2)),
    "choices by text, FMI 2": attempt(lambda: run(2, mode="torque")),
    "FMI 3": attempt(lambda: run(3)),
    "arrays": attempt(array),
    "Enumeration by name": attempt(lambda: run(3, mode="torque")),
    "Enumeration by number": attempt(lambda: run(3, mode=2)),
    "DefaultExperiment of FMU": attempt(lambda: f"to {simulate_fmu(fmu(place, 3))['time'][-1]:g} s"),
    "archive": attempt(lambda: of_mount("drives")),
    "parameter set": attempt(lambda: times(system("set")["first.speed"], speed_at(STEPS * H))),
    "numbers of FMUs of one shape": attempt(numbers),
    "LinearTransformation": attempt(lambda: of_mount("scaled")),
    "DefaultExperiment of archive": attempt(experiment_of_archive),
    "system connector": attempt(lambda: of_mount("system")),
    "system connector of another name": attempt(lambda: of_shown()),
    "archive with FMI 3": attempt(lambda: f"{system('three')}"),
    "units": attempt(units),
}
said("FMPy 0.3.32", FOUND, EXPECTED)
