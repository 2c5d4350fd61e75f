"""A master in C without an environment runs native FMUs with the bits of the Python models."""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import ExitStack
from time import perf_counter

import numpy as np
import pytest
from c_host import HOST, built, host, order_text
from fmpy.fmi2 import FMU2Slave
from vehicle_in_process import InProcess

from fmus.fmi.build import build_all
from fmus.native.link import compiler
from orchestrator.cosim.component import Component
from orchestrator.cosim.fmu_files import unpack
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load


def driven(scene, links, settings, steps, folder):
    """Final Real outputs by part, of the host and in this process, and the host's times, us."""
    vehicle = InProcess(load(scene, links, settings))
    assembly, h = assemble(vehicle.scene), vehicle.scene.run.step
    order = order_text(assembly, built(assembly), h, steps)
    said = subprocess.run([host(folder)], input=order, capture_output=True, text=True, env={})
    assert said.returncode == 0, said.stderr
    *parts, times = (line.split() for line in said.stdout.splitlines())
    shown = {part.name: [float.fromhex(x) for x in line[1:]] for part, line in zip(assembly.parts, parts, strict=True)}
    for _ in range(steps):
        vehicle.step()
    return shown, {name: member.y for name, member in vehicle.members.items()}, times


@pytest.mark.study
@pytest.mark.parametrize(("scene", "links"), [("straight", "flexible"), ("turn", "rigid")])
def test_a_host_without_an_environment_drives_the_vehicle(scene, links, tmp_path):
    settings = ("run.step=1 ms", "track.step=1 ms", "run.stop=3 s", "drive.ramp_start=0", "drive.ramp_time=0.5")
    shown, expected, _ = driven(scene, links, settings, 1000, tmp_path)
    for name, values in expected.items():
        np.testing.assert_array_equal(shown[name][: len(values)], values, err_msg=name)  # those of links follow
    assert expected["chassis"].size > 100


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="the counter needs glibc")
@pytest.mark.parametrize(
    ("scene", "links", "settings"),
    [
        ("straight", "flexible", []),
        pytest.param("serpentine", "rigid", [], marks=pytest.mark.study),
        pytest.param("differential", "rigid", [], marks=pytest.mark.study),
        pytest.param("straight", "flexible", ["track.element=beam"], marks=pytest.mark.study),
        pytest.param("straight", "flexible", ["track.elasticity=engineering"], marks=pytest.mark.study),
    ],
)
def test_no_call_allocates(scene, links, settings, tmp_path):
    """Set, step, get of all outputs, saving, serialising and restoring the state: once it runs, none does."""
    counter = tmp_path / "allocations.so"
    source = HOST.with_name("allocations.c")
    subprocess.run([*compiler(), "-std=c11", "-shared", "-fPIC", "-o", counter, source], check=True)
    resolved = placed(load(scene, links, settings))
    assembly, program = assemble(resolved), host(tmp_path)
    files, counts = built(assembly), []
    for steps in (50, 150):
        order = f"states\n{order_text(assembly, files, resolved.run.step, steps)}"
        environment = {"LD_PRELOAD": str(counter)}
        said = subprocess.run([program], input=order, capture_output=True, text=True, env=environment, check=True)
        counts.append(int(said.stderr.split()[-1]))
    assert counts[0] > 10, "the counter was not loaded"
    assert counts[1] - counts[0] < 10  # of the host, for its output


@pytest.mark.study
def test_libcosim_drives_the_vehicle(tmp_path):
    """libcosim drives 3 s of ``straight`` with the bits of the same calls here.

    Needs the extra `hosts`.
    """
    pytest.importorskip("libcosimpy")
    settings = ("run.step=1 ms", "track.step=1 ms", "run.stop=3 s")
    assembly, steps, ns = assemble(placed(load("straight", "flexible", settings))), 3000, 1_000_000
    with ExitStack() as stack:
        parts, wires, known, feeds = [], [], {}, []
        for part, file in zip(assembly.parts, built(assembly), strict=True):
            component = stack.enter_context(Component(file, part.name))
            component.initialise({})
            references = {v.name: v.valueReference for v in component.description.modelVariables}
            known[part.name] = len(parts), component, references
            outputs = [references[name] for name in component.outputs]
            parts.append({"name": part.name, "fmu": str(file), "outputs": outputs})
        for wire in assembly.connections:
            (i, source, outputs), (j, target, inputs) = known[wire.source], known[wire.target]
            pairs = list(zip(wire.outputs, wire.inputs, strict=True))
            wires += [[i, outputs[out], j, inputs[into]] for out, into in pairs]
            ends = zip(*((source.outputs.index(out), target.inputs.index(into)) for out, into in pairs), strict=True)
            feeds.append((source, target, *map(list, ends)))
        order = tmp_path / "system.json"
        order.write_text(json.dumps({"h": ns, "steps": steps, "parts": parts, "wires": wires}))
        subprocess.run([sys.executable, HOST.with_name("libcosim_host.py"), order], check=True, capture_output=True)
        components = [component for _, component, _ in known.values()]
        for k in range(steps):
            now = {component.name: component.y.copy() for component in components}
            for source, target, outputs, inputs in feeds:
                target.u[inputs] = now[source.name][outputs]
            t, end = k * ns / 1e9, (k + 1) * ns / 1e9  # libcosim counts nanoseconds: a step is not always 1e-3
            for component in components:
                component.write()
                component.step(t, end - t)
                component.read()
        shown = [[float.fromhex(value) for value in each] for each in json.loads(order.read_text())]
        for component, values in zip(components, shown, strict=True):
            assert np.array_equal(component.y, values)
        chassis = known["chassis"][1]
        assert chassis.y[chassis.outputs.index("distance")] > 0.1, "the vehicle did not drive"


@pytest.mark.benchmark
def test_times_of_kinds_in_hosts(tmp_path, capsys):
    """Print times of set, step and get, us: native FMUs in C, native and Python FMUs by fmpy.

    They are medians; the kinds step in turn.
    """
    settings = ("run.step=1 ms", "track.step=1 ms", "run.stop=3 s", "drive.ramp_start=0", "drive.ramp_time=0.5")
    vehicle = InProcess(load("straight", "flexible", settings))
    assembly = assemble(vehicle.scene)
    files = built(assembly)
    said = subprocess.run(
        [host(tmp_path)], input=order_text(assembly, files, 1e-3, 3000), capture_output=True, text=True, env={}
    )
    in_c = {p.name: float(line.split()[0]) for p, line in zip(assembly.parts, said.stdout.splitlines(), strict=False)}
    ours = build_all([(part.kind, part.config | {"parameters": part.parameters}, None) for part in assembly.parts])
    rows = []
    with ExitStack() as stack:
        pairs = {}
        for part, *both in zip(assembly.parts, files, ours, strict=True):
            if part.name not in ("right_track", "right_drive"):
                pairs[part.name] = [stack.enter_context(Component(file, part.name)) for file in both]
                for component, file in zip(pairs[part.name], both, strict=True):
                    component.file = file
        spent = {name: ([], []) for name in pairs}
        for pair in pairs.values():
            for component in pair:
                component.initialise({})
                identifier, place = component.description.coSimulation.modelIdentifier, str(unpack(component.file))
                component._fmu = FMU2Slave(guid="", modelIdentifier=identifier, unzipDirectory=place, instanceName="")
                component._fmu.component = component._handle  # fmpy's own calls with their wrappers
        references = {
            name: [[{v.name: v.valueReference for v in pair[0].description.modelVariables}[port] for port in ports]
                   for ports in (pair[0].inputs, pair[0].outputs)]
            for name, pair in pairs.items()
        }  # fmt: skip
        for k in range(500):
            for name, pair in pairs.items():
                u = vehicle[name].u.tolist()
                shown = []
                for component, times in zip(pair, spent[name], strict=True):
                    fmu, (inputs, outputs) = component._fmu, references[name]
                    began = perf_counter()
                    fmu.setReal(inputs, u)
                    fmu.doStep(k * 1e-3, 1e-3)
                    shown.append(fmu.getReal(outputs))
                    times.append(1e6 * (perf_counter() - began))
                assert shown[0] == shown[1]
            vehicle.step()
    for name, (native, python) in spent.items():
        rows.append(f"{name:12} {in_c[name]:8.1f} {np.median(native):8.1f} {np.median(python):8.1f}")
    with capsys.disabled():
        print("\n                in C  native   Python, us", *rows, sep="\n")
