"""Other tools tried on our FMUs and archives: ``python -m tests.tools TOOL FOLDER``, for one of TOOLS.

FOLDER gets what the tools need; the first time takes a minute or two. The mount of the drive ``second`` turns as fast
as the sprocket of ``first``. Results are given as multiples of that without changes: a parameter set or factor of 2
that is ignored reads "1 times", one that is applied "2 times"; a drive whose ``mode`` was set to ``torque`` stands,
"0 times". Exit status 1 and the differences if a result is not that of the table. Needs cotrack[native] and the
distribution in the table; Ecos also libtbb12 of Debian or tbb==2023.2.0 in LD_LIBRARY_PATH.
"""

import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import cos, pi
from pathlib import Path
from typing import NamedTuple
from zipfile import ZipFile

from fmpy import read_model_description

from orchestrator.log.reader import Log
from tests.tools.made import END, STEPS, H, command, fmu, write_archives

T = STEPS * H
FIRST, MOUNT, OWN = "first.speed", "second.sprocket.angular_velocity.y", "second.speed"
SHOWN = ["shown.first", "shown.own", "shown.turned"]
PLACES = {(0.0, -4.04498505): "its own", (-4.04498505,) * 2: "those of one for all"}  # in numbers.ssp, m
Questions = dict[str, Callable[[], object]]


def times(value: float, once: float) -> str:
    """How many times a value is another one, to a few per cent."""
    return next((f"{k:g} times" for k in (0.0, 1.0, 2.0) if abs(value - k * once) < 0.1 * abs(once)), f"{value!r}")


def as_driven(value: float) -> str:
    """How many times a value is the speed of the drive ``first`` at T of its ramp."""
    return times(value, 0.5 * END * (1.0 - cos(pi * min(T, 1.0))))


def of_archives(values: Callable[..., list[float]]) -> Questions:
    """Questions about archives; ``values(name, signals, steps)``: last values of variables PART.NAME in one of them."""

    def of_mount(name: str) -> str:
        mount, own, first = values(name, [MOUNT, OWN, FIRST])
        return times(mount - own, first)

    def numbers() -> str:
        places = tuple(values("numbers", ["first.sprocket.position.x", "second.sprocket.position.x"]))
        return PLACES.get(places, str(places))

    return {
        "archive": lambda: of_mount("drives"),
        "parameter set": lambda: as_driven(values("set", [FIRST])[0]),
        "numbers of FMUs of one shape": numbers,
        "LinearTransformation": lambda: of_mount("scaled"),
        "DefaultExperiment": lambda: f"starts at {int(values('later', [FIRST], 10)[0] > 1.0)} s",
        "system connector": lambda: of_mount("system"),
        "system connector of another name": lambda: of_mount("named_drives"),
        "archive with FMI 3": lambda: as_driven(values("three", ["drive.speed"])[0]),
    }


def fmpy(place: Path) -> Questions:
    from fmpy import simulate_fmu
    from fmpy.ssp.simulation import simulate_ssp

    def run(fmi: int, **values: object) -> str:
        rows = simulate_fmu(fmu(place, fmi), stop_time=T, output_interval=H, start_values=values)
        return as_driven(rows["speed"][-1])

    def array() -> list[float]:
        shown, given = "sprocket.position", {"mount.position": [1.0, 2.0, 3.0]}
        rows = simulate_fmu(fmu(place, 3), stop_time=0.01, output_interval=H, output=[shown], start_values=given)
        return [float(value) for value in rows[shown][-1]]

    def system(name: str, signals: list[str], steps: int = STEPS) -> list[float]:
        rows = simulate_ssp(str(place / f"{name}.ssp"), stop_time=steps * H, step_size=H)
        return [float(rows[each][-1]) for each in signals]

    def of_shown() -> str:
        first, own, turned = system("named_drives", SHOWN)
        return times(turned - own, first)

    def later() -> str:
        rows = simulate_ssp(str(place / "later.ssp"))["time"]
        return f"{rows[0]:g} to {rows[-1]:g} s"

    def units() -> str:
        speed = next(v for v in read_model_description(fmu(place, 3)).modelVariables if v.name == "speed")
        return f"{speed.unit}, {speed.declaredType.name}, {speed.displayUnit}"

    return of_archives(system) | {
        "FMI 2": lambda: run(2),
        "choices by text, FMI 2": lambda: run(2, mode="torque"),
        "FMI 3": lambda: run(3),
        "arrays": array,
        "Enumeration by name": lambda: run(3, mode="torque"),
        "Enumeration by number": lambda: run(3, mode=2),
        "DefaultExperiment of FMU": lambda: f"to {simulate_fmu(fmu(place, 3))['time'][-1]:g} s",
        "DefaultExperiment of archive": later,
        "system connector of another name": of_shown,
        "units": units,
    }


def libcosim(place: Path) -> Questions:
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    ns = round(H * 1e9)

    def last(execution: CosimExecution, signals: list[str], steps: int = STEPS) -> list[float]:
        observer = CosimObserver.create_last_value()
        execution.add_observer(observer)
        if not execution.step(steps):
            raise RuntimeError("a step failed")
        found = []
        for part, _, name in (signal.partition(".") for signal in signals):
            index = execution.slave_index_from_instance_name(part)
            references = {each.name.decode(): each.reference for each in execution.slave_variables(index)}
            found.append(observer.last_real_values(index, [references[name]])[0])
        return found

    def system(name: str, signals: list[str], steps: int = STEPS) -> list[float]:
        folder = place / "unpacked" / name
        with ZipFile(place / f"{name}.ssp") as packed:
            packed.extractall(folder)
        return last(CosimExecution.from_ssp_file(str(folder), step_size=ns), signals, steps)

    def single() -> str:
        execution = CosimExecution.from_step_size(ns)
        execution.add_local_slave(CosimLocalSlave(fmu(place, 2), "drive"))
        return as_driven(last(execution, ["drive.speed"])[0])

    return of_archives(system) | {"FMI 2": single}


def ecos(place: Path) -> Questions:
    from ecospy import EcosSimulation, EcosSimulationStructure

    def last(simulation: EcosSimulation, signals: list[str], steps: int = STEPS, **chosen: str) -> list[float]:
        simulation.init(**chosen)
        simulation.step(steps)
        values = [simulation.get_real(signal.replace(".", "::", 1)) for signal in signals]
        simulation.terminate()
        return values

    def system(name: str, signals: list[str], steps: int = STEPS, **chosen: str) -> list[float]:
        return last(EcosSimulation(step_size=H, ssp_path=str(place / f"{name}.ssp")), signals, steps, **chosen)

    def single(fmi: int, name: str) -> float:
        structure = EcosSimulationStructure()
        structure.add_model("drive", fmu(place, fmi))
        return last(EcosSimulation(structure=structure, step_size=H), [f"drive.{name}"])[0]

    return of_archives(system) | {
        "FMI 2": lambda: as_driven(single(2, "speed")),
        "FMI 3": lambda: as_driven(single(3, "speed")),
        "arrays": lambda: "right" if single(3, "sprocket.orientation") == 1.0 else "a wrong number, no error",
        "parameter set, chosen": lambda: as_driven(system("set", [FIRST], parameter_set="drives")[0]),
    }


def container(place: Path) -> Questions:
    from fmpy import simulate_fmu

    def made(name: str, fmi: int = 2) -> str:
        file = place / f"{name}.fmu"
        file.unlink(missing_ok=True)
        tool = Path(sys.executable).parent / "fmucontainer"
        words = [tool, "-container", f"{name}.ssp", "-fmu-directory", ".", "-fmi", str(fmi)]
        done = subprocess.run(words, cwd=place, capture_output=True, text=True, check=False)
        if not file.exists():
            raise RuntimeError(done.stdout + done.stderr)
        return str(file)

    def outputs(name: str) -> int:
        return sum(each.causality == "output" for each in read_model_description(made(name)).modelVariables)

    def values(name: str, shown: list[str], fmi: int = 2) -> list[float]:
        rows = simulate_fmu(made(name, fmi), stop_time=T, step_size=H, output_interval=H, output=shown)
        return [float(rows[each][-1]) for each in shown]

    def of_mount(name: str) -> str:
        first, own, turned = values(name, SHOWN)
        return times(turned - own, first)

    def experiment() -> str:
        found = read_model_description(made("later")).defaultExperiment
        return f"{found.startTime} to {found.stopTime} s"

    def units() -> object:
        return next(v.unit for v in read_model_description(made("system")).modelVariables if v.name[-1] == "d")

    return {
        "archive": lambda: f"{outputs('drives')} outputs",
        "system connector": lambda: f"{outputs('system')} output",
        "its numbers": lambda: of_mount("named_drives"),
        "parameter set": lambda: as_driven(values("named_set", SHOWN)[0]),
        "LinearTransformation": lambda: of_mount("named_scaled"),
        "DefaultExperiment": experiment,
        "units": units,
        "archive with FMI 3": lambda: as_driven(values("named_three", SHOWN[:1])[0]),
        "the same as FMI 3": lambda: as_driven(values("named_three", SHOWN[:1], 3)[0]),
    }


def cotrack(place: Path) -> Questions:
    file = place / "cotrack.mcap"

    def run(name: str, signals: Sequence[str], steps: int = STEPS) -> list[float]:
        length = ("--stop", str(steps * H)) if steps else ()
        with suppress(subprocess.CalledProcessError):  # the energy ledger is open, because nothing drives the mount
            file.unlink(missing_ok=True)
            command("run", place / f"{name}.ssp", "--log", file, *length)
        if not file.exists():
            raise RuntimeError(f"{name} did not run")
        with Log(file) as read:
            return [float(read.signal(each)[1][-1]) for each in signals]

    def later() -> str:
        speed = run("later", [FIRST], 0)[0]
        with Log(file) as read:
            return f"{read.signal(FIRST)[0][-1]:g} s, starts at {int(speed > 1.0)} s"

    return of_archives(run) | {"DefaultExperiment": later}


class Tool(NamedTuple):
    """A tool: its questions, name, distribution, and what it answers."""

    questions: Callable[[Path], Questions]
    name: str
    needs: str
    answers: dict[str, str]


CONNECTORS = "system connector", "system connector of another name"
TOOLS = {
    "fmpy": Tool(fmpy, "FMPy 0.3.32", "fmpy==0.3.32", {
        "FMI 2": "1 times", "choices by text, FMI 2": "0 times", "FMI 3": "1 times", "arrays": "[1.0, 2.0, 3.0]",
        "Enumeration by name": "refused (ValueError)", "Enumeration by number": "0 times",
        "DefaultExperiment of FMU": "to 14 s", "archive": "1 times", "parameter set": "1 times",
        "numbers of FMUs of one shape": "its own", "LinearTransformation": "1 times",
        "DefaultExperiment of archive": "0 to 0.99 s", "system connector": "refused (ValueError)",
        "system connector of another name": "1 times", "archive with FMI 3": "refused (Exception)",
        "units": "rad/s, RotationalSpeed, rpm",
    }),
    "libcosim": Tool(libcosim, "libcosim 0.11.2 (libcosimpy 0.0.6)", "libcosimpy==0.0.6", {
        "FMI 2": "1 times", "archive": "1 times", "parameter set": "2 times",
        "numbers of FMUs of one shape": "its own", "LinearTransformation": "2 times",
        "DefaultExperiment": "starts at 1 s", **dict.fromkeys(CONNECTORS, "refused (AssertionError)"),
        "archive with FMI 3": "refused (AssertionError)",
    }),
    "ecos": Tool(ecos, "Ecos 0.7.2", "ecospy==0.7.2", {
        "FMI 2": "1 times", "FMI 3": "1 times", "arrays": "a wrong number, no error", "archive": "1 times",
        "parameter set": "1 times", "parameter set, chosen": "2 times", "numbers of FMUs of one shape": "its own",
        "LinearTransformation": "2 times", "DefaultExperiment": "starts at 0 s",
        **dict.fromkeys(CONNECTORS, "refused (Exception)"), "archive with FMI 3": "1 times",
    }),
    "container": Tool(container, "FMUContainer 2.0", "fmu-manipulation-toolbox==2.0", {
        "archive": "0 outputs", "system connector": "1 output", "its numbers": "1 times", "parameter set": "1 times",
        "LinearTransformation": "1 times", "DefaultExperiment": "0.0 to 14.0 s", "units": "None",
        "archive with FMI 3": "1 times", "the same as FMI 3": "1 times",
    }),
    "cotrack": Tool(cotrack, "cotrack", "", {
        "archive": "1 times", "parameter set": "2 times", "numbers of FMUs of one shape": "its own",
        "LinearTransformation": "2 times", "DefaultExperiment": "0.05 s, starts at 0 s", "system connector": "1 times",
        "archive with FMI 3": "refused (RuntimeError)",
    }),
}  # fmt: skip


def attempt(call: Callable[[], object]) -> str:
    """Result of a call, or the kind of its error."""
    try:
        return str(call())
    except Exception as error:  # a tool's refusal is what is asked for
        return f"refused ({type(error).__name__})"


def main() -> None:
    if len(sys.argv) != 3 or sys.argv[1] not in TOOLS:
        raise SystemExit(f"usage: python -m tests.tools {'|'.join(TOOLS)} FOLDER")
    tool, place = TOOLS[sys.argv[1]], Path(sys.argv[2]).resolve()
    write_archives(place)
    asked = tool.questions(place)
    found = {name: attempt(asked[name]) for name in tool.answers}
    print(f"{tool.name}: " + "; ".join(f"{name}: {text}" for name, text in found.items()))
    if changed := [f"{name}: was {text}" for name, text in tool.answers.items() if found[name] != text]:
        raise SystemExit("changed: " + "; ".join(changed))


if __name__ == "__main__":
    main()
