"""Ecos tried: ``python -m tests.tools.ecos_takes FOLDER``.

Needs cotrack[native] and ecospy==0.7.2, with libtbb12 of Debian or tbb==2023.2.0 in LD_LIBRARY_PATH.
"""

from ecospy import EcosSimulation, EcosSimulationStructure

from tests.tools.made import PLACES, STEPS, H, attempt, fmu, folder, said, speed_at, times

EXPECTED = {
    "FMI 2": "1 times",
    "FMI 3": "1 times",
    "arrays": "a wrong number, no error",
    "archive": "1 times",
    "parameter set": "1 times",
    "parameter set, chosen": "2 times",
    "numbers of FMUs of one shape": "its own",
    "LinearTransformation": "2 times",
    "DefaultExperiment": "starts at 0 s",
    "system connector": "refused (Exception)",
    "system connector of another name": "refused (Exception)",
    "archive with FMI 3": "1 times",
}
T = STEPS * H


def system(name: str, names: list[str], chosen: str = "") -> list[float]:
    simulation = EcosSimulation(step_size=H, ssp_path=str(place / f"{name}.ssp"))
    if chosen:
        simulation.init(parameter_set=chosen)
    else:
        simulation.init()
    simulation.step(STEPS)
    values = [simulation.get_real(each) for each in names]
    simulation.terminate()
    return values


def of_mount(name: str) -> str:
    mount, own, first = system(name, ["second::sprocket.angular_velocity.y", "second::speed", "first::speed"])
    return times(mount - own, first)


def first(name: str, chosen: str = "") -> str:
    return times(system(name, ["first::speed"], chosen)[0], speed_at(T))


def single(fmi: int, name: str) -> str:
    structure = EcosSimulationStructure()
    structure.add_model("drive", fmu(place, fmi))
    simulation = EcosSimulation(structure=structure, step_size=H)
    simulation.init()
    simulation.step(STEPS)
    value = simulation.get_real(f"drive::{name}")
    simulation.terminate()
    return times(value, speed_at(T)) if name == "speed" else ("right" if value == 1.0 else "a wrong number, no error")


def numbers() -> str:
    places = system("numbers", ["first::sprocket.position.x", "second::sprocket.position.x"])
    return PLACES.get(tuple(places), str(places))


def later() -> str:
    simulation = EcosSimulation(step_size=H, ssp_path=str(place / "later.ssp"))
    simulation.init()
    simulation.step(10)
    value = simulation.get_real("first::speed")
    simulation.terminate()
    return "starts at 1 s" if value > 1.0 else "starts at 0 s"


place = folder()
FOUND = {
    "FMI 2": attempt(lambda: single(2, "speed")),
    "FMI 3": attempt(lambda: single(3, "speed")),
    "arrays": attempt(lambda: single(3, "sprocket.orientation")),
    "archive": attempt(lambda: of_mount("drives")),
    "parameter set": attempt(lambda: first("set")),
    "parameter set, chosen": attempt(lambda: first("set", "drives")),
    "numbers of FMUs of one shape": attempt(numbers),
    "LinearTransformation": attempt(lambda: of_mount("scaled")),
    "DefaultExperiment": attempt(later),
    "system connector": attempt(lambda: of_mount("system")),
    "system connector of another name": attempt(lambda: of_mount("named_drives")),
    "archive with FMI 3": attempt(lambda: times(system("three", ["drive::speed"])[0], speed_at(T))),
}
said("Ecos 0.7.2", FOUND, EXPECTED)
