"""A master in C without an environment runs native FMUs with the bits of the Python models."""

from __future__ import annotations

import json
import subprocess
import sys
from functools import partial
from time import perf_counter

import numpy as np
import pytest
from c_host import HOST, built, host, order_text
from fmpy import read_model_description
from fmpy.fmi2 import FMU2Slave
from vehicle_in_process import InProcess

from fmus.fmi.build import build_all
from fmus.native.machine_code import compiler
from orchestrator.fmi.fmu_files import unpack
from orchestrator.scene.assembly import assemble
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load

SETTINGS = ("run.step=1 ms", "track.step=1 ms", "run.stop=3 s", "drive.ramp_start=0", "drive.ramp_time=0.5")


@pytest.mark.study
@pytest.mark.parametrize(("scene", "links"), [("straight", "flexible"), ("turn", "rigid")])
def test_a_host_without_an_environment_drives_the_vehicle(scene, links, tmp_path):
    vehicle = InProcess(load(scene, links, SETTINGS))
    assembly, steps = assemble(vehicle.scene), 1000
    order = order_text(assembly, built(assembly), vehicle.scene.run.step, steps)
    said = subprocess.run([host(tmp_path)], input=order, capture_output=True, text=True, env={})
    assert said.returncode == 0, said.stderr
    *parts, _ = (line.split() for line in said.stdout.splitlines())  # the last one has times
    for _ in range(steps):
        vehicle.step()
    for part, line in zip(assembly.parts, parts, strict=True):
        y = vehicle[part.name].y
        shown = [float.fromhex(x) for x in line[1 : 1 + len(y)]]  # those of links follow
        np.testing.assert_array_equal(shown, y, err_msg=part.name)
    assert vehicle["chassis"].y.size > 100


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="the counter needs glibc")
@pytest.mark.parametrize(
    ("scene", "links", "settings"),
    [
        ("straight", "flexible", []),
        *(pytest.param(*each, marks=pytest.mark.study) for each in (
            ("serpentine", "rigid", []), ("differential", "rigid", []),
            ("straight", "flexible", ["track.element=beam"]),
            ("straight", "flexible", ["track.elasticity=engineering"]),
        )),
    ],
)  # fmt: skip
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
        times = [float(line.split()[0]) for line in said.stdout.splitlines()[:-1]]
        assert len(times) == len(files)
        assert min(times) > 0.0, "an instance did not step"
    assert counts[0] > 10, "the counter was not loaded"
    assert counts[1] - counts[0] < 10  # of the host, for its output


@pytest.mark.study
def test_libcosim_drives_the_vehicle(tmp_path):
    """libcosim drives 3 s of ``straight`` with the bits of the same calls here.

    Needs the extra `hosts`.
    """
    pytest.importorskip("libcosimpy")
    vehicle, steps, ns = InProcess(load("straight", "flexible", SETTINGS[:3])), 3000, 1_000_000
    assembly = assemble(vehicle.scene)
    parts, wires, known = [], [], {}
    for part, file in zip(assembly.parts, built(assembly), strict=True):
        references = {v.name: v.valueReference for v in read_model_description(file).modelVariables}
        known[part.name] = len(parts), references
        outputs = [references[name] for name in vehicle[part.name].outputs]
        parts.append({"name": part.name, "fmu": str(file), "outputs": outputs})
    for wire in assembly.connections:
        (i, outputs), (j, inputs) = known[wire.source], known[wire.target]
        wires += [[i, outputs[out], j, inputs[into]] for out, into in zip(wire.outputs, wire.inputs, strict=True)]
    order = tmp_path / "system.json"
    order.write_text(json.dumps({"h": ns, "steps": steps, "parts": parts, "wires": wires}))
    subprocess.run([sys.executable, HOST.with_name("libcosim_host.py"), order], check=True, capture_output=True)
    for k in range(steps):
        vehicle.further = k * ns / 1e9  # libcosim counts nanoseconds: a step is not always 1e-3
        vehicle.step((k + 1) * ns / 1e9 - vehicle.further, at_once=True)
    for part, values in zip(assembly.parts, json.loads(order.read_text()), strict=True):
        assert vehicle[part.name].y.tolist() == [float.fromhex(value) for value in values]
    assert vehicle["chassis"]["distance"] > 0.1, "the vehicle did not drive"


@pytest.mark.benchmark
def test_times_of_kinds_in_hosts(tmp_path, capsys):
    """Print times of set, step and get, us: native FMUs in C, native and Python FMUs by fmpy.

    They are medians; the kinds step in turn.
    """
    vehicle = InProcess(load("straight", "flexible", SETTINGS))
    assembly = assemble(vehicle.scene)
    files, order = built(assembly), partial(subprocess.run, capture_output=True, text=True, env={})
    said = order([host(tmp_path)], input=order_text(assembly, files, 1e-3, 3000))
    in_c = {p.name: float(line.split()[0]) for p, line in zip(assembly.parts, said.stdout.splitlines(), strict=False)}
    ours = build_all([(part.kind, part.config | {"parameters": part.parameters}, None) for part in assembly.parts])
    instances = {}
    for part, *both in zip(assembly.parts, files, ours, strict=True):
        for file in both if part.name not in ("right_track", "right_drive") else ():
            about = read_model_description(file)
            kind, reals = about.coSimulation.modelIdentifier, [v for v in about.modelVariables if v.type == "Real"]
            fmu = FMU2Slave(guid=about.guid, modelIdentifier=kind, unzipDirectory=str(unpack(file)), instanceName="a")
            fmu.instantiate()
            fmu.enterInitializationMode()
            fmu.exitInitializationMode()
            u, y = ([v.valueReference for v in reals if v.causality == each] for each in ("input", "output"))
            instances.setdefault(part.name, []).append((fmu, u, y[: len(vehicle[part.name].y)], []))
    for k in range(500):
        for name, pair in instances.items():
            given, shown = vehicle[name].u.tolist(), []
            for fmu, inputs, outputs, times in pair:
                began = perf_counter()
                fmu.setReal(inputs, given)
                fmu.doStep(k * 1e-3, 1e-3)
                shown.append(fmu.getReal(outputs))
                times.append(1e6 * (perf_counter() - began))
            assert shown[0] == shown[1]
        vehicle.step()
    with capsys.disabled():
        print("\n                in C  native   Python, us")
        for name, pair in instances.items():
            print(f"{name:12} {in_c[name]:8.1f} ", *(f"{np.median(times):8.1f}" for *_, times in pair))
