"""libcosim tried: ``python -m tests.tools.libcosim_takes FOLDER``. Needs cotrack[native] and libcosimpy==0.0.6."""

from zipfile import ZipFile

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

from tests.tools.made import PLACES, STEPS, H, attempt, fmu, folder, said, speed_at, times

EXPECTED = {
    "FMI 2": "1 times",
    "archive": "1 times",
    "parameter set": "2 times",
    "numbers of FMUs of one shape": "its own",
    "LinearTransformation": "2 times",
    "DefaultExperiment": "starts at 1 s",
    "system connector": "refused (AssertionError)",
    "system connector of another name": "refused (AssertionError)",
    "archive with FMI 3": "refused (AssertionError)",
}
NS = round(H * 1e9)


def values(execution: CosimExecution, steps: int, names: list[tuple[str, str]]) -> list[float]:
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    if not execution.step(steps):
        raise RuntimeError("a step failed")
    found = []
    for part, name in names:
        index = execution.slave_index_from_instance_name(part)
        references = {each.name.decode(): each.reference for each in execution.slave_variables(index)}
        found.append(observer.last_real_values(index, [references[name]])[0])
    return found


def opened(name: str) -> CosimExecution:
    unpacked = place / "unpacked" / name
    with ZipFile(place / f"{name}.ssp") as packed:
        packed.extractall(unpacked)
    return CosimExecution.from_ssp_file(str(unpacked), step_size=NS)


def of_mount(name: str) -> str:
    names = [("second", "sprocket.angular_velocity.y"), ("second", "speed"), ("first", "speed")]
    mount, own, first = values(opened(name), STEPS, names)
    return times(mount - own, first)


def first(name: str) -> str:
    return times(values(opened(name), STEPS, [("first", "speed")])[0], speed_at(STEPS * H))


def single() -> str:
    execution = CosimExecution.from_step_size(NS)
    execution.add_local_slave(CosimLocalSlave(fmu(place, 2), "drive"))
    return times(values(execution, STEPS, [("drive", "speed")])[0], speed_at(STEPS * H))


def numbers() -> str:
    places = values(opened("numbers"), 1, [(part, "sprocket.position.x") for part in ("first", "second")])
    return PLACES.get(tuple(places), str(places))


def later() -> str:
    return "starts at 1 s" if values(opened("later"), 10, [("first", "speed")])[0] > 1.0 else "starts at 0 s"


place = folder()
FOUND = {
    "FMI 2": attempt(single),
    "archive": attempt(lambda: of_mount("drives")),
    "parameter set": attempt(lambda: first("set")),
    "numbers of FMUs of one shape": attempt(numbers),
    "LinearTransformation": attempt(lambda: of_mount("scaled")),
    "DefaultExperiment": attempt(later),
    "system connector": attempt(lambda: of_mount("system")),
    "system connector of another name": attempt(lambda: of_mount("named_drives")),
    "archive with FMI 3": attempt(lambda: str(opened("three"))),
}
said("libcosim 0.11.2 (libcosimpy 0.0.6)", FOUND, EXPECTED)
