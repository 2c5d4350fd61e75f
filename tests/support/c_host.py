"""The host in C of `host/host.c`: built, and the description of a scene's system for it."""

import subprocess
from pathlib import Path

from fmus.native.machine_code import LINUX, WINDOWS, compiler
from orchestrator.cosim.component import Component
from orchestrator.fmi.fmu_files import unpack
from orchestrator.scene.assembly import build_native_all

HOST = Path(__file__).parents[1] / "host" / "host.c"


def host(folder):
    program = folder / "host"
    subprocess.run([*compiler(), "-std=c11", "-O2", "-o", str(program), str(HOST), "-ldl"], check=True)
    return program


def windows_host(folder):
    program = folder / "host.exe"
    subprocess.run([*compiler(WINDOWS), "-std=c11", "-O2", "-o", str(program), str(HOST)], check=True)
    return program


def built(assembly):
    """One FMU per part, with the scene's parameters as defaults."""
    return build_native_all([(p.kind, p.config | {"parameters": p.parameters}, None) for p in assembly.parts])


def order_text(assembly, files, h, steps, platform=LINUX):
    """Description of a system for the host, with the libraries of a platform; it reads outputs of links too."""
    lines, names = [], {}
    for part, file in zip(assembly.parts, files, strict=True):
        with Component(file, part.name) as component:
            ends = {name: k for k, name in enumerate(component.inputs)}, {n: k for k, n in enumerate(component.outputs)}
            guid, outputs = component.description.guid, len(component.outputs) + len(component.links)
        names[part.name] = len(names), ends
        library = unpack(file) / "binaries" / platform.folder / f"{part.kind}{platform.suffix}"
        lines.append(f"instance {library} {guid} {part.stage} {len(ends[0])} {outputs}")
    for wire in assembly.connections:
        (source, (_, outputs)), (target, (inputs, _)) = names[wire.source], names[wire.target]
        pairs = zip(wire.outputs, wire.inputs, strict=True)
        lines += [f"connect {source} {outputs[out]} {target} {inputs[into]}" for out, into in pairs]
    return "\n".join([*lines, f"run {steps} {h!r}"])
