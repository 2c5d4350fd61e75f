"""Proof that runs give the same bits on every x86-64 processor: ``python -m tests.processors``.

It drives the vehicle of a scene for 4,000 communication steps in child processes and compares all outputs of all steps
and the resolved scene with those of a run without changes. glibc, OpenBLAS and numpy choose their code by processor, so
each child is given another choice, by environment; numba compiles for the generic processor in one, for those of packs
in another. Native FMUs also run as other processors in an emulator (Debian's ``qemu-user``), and their libraries for
Windows in Wine (``wine``).
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fmus.cache.pack import LEVEL

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "tests" / "support"))
STEPS = 4000
DRIVING = ("drive.ramp_start=0",)  # the scene has no rest before its ramp
OLD_LIBM = "glibc.cpu.hwcaps=-AVX2_Usable,-AVX2,-FMA,-FMA4,-AVX512F,-AVX"  # code for SSE2
# Choices of the libraries by environment; the first is the machine's own.
PYTHON: Mapping[str, Mapping[str, str]] = {
    "as it is": {},
    "glibc without AVX and FMA": {"GLIBC_TUNABLES": OLD_LIBM},
    "OpenBLAS for Nehalem": {"OPENBLAS_CORETYPE": "Nehalem"},
    "OpenBLAS for Haswell": {"OPENBLAS_CORETYPE": "Haswell"},
    "OpenBLAS for Zen": {"OPENBLAS_CORETYPE": "Zen"},
    "numpy without AVX": {"NPY_DISABLE_CPU_FEATURES": "X86_V3,X86_V4,AVX512_ICL,AVX512_SPR"},
    "all of them": {
        "GLIBC_TUNABLES": OLD_LIBM,
        "OPENBLAS_CORETYPE": "Nehalem",
        "NPY_DISABLE_CPU_FEATURES": "X86_V3,X86_V4,AVX512_ICL,AVX512_SPR",
    },
    "numba for the generic processor": {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""},
    "numba for the processors of packs": dict(zip(("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"), LEVEL, strict=True)),
}
EMULATED = "Nehalem", "Haswell", "EPYC"


class Difference(NamedTuple):
    """Comparison of a run with the reference."""

    values: int  # values compared
    different: int  # of them, those with other bits
    largest: float  # difference relative to the largest amount of the output


def difference(reference: np.ndarray, other: np.ndarray) -> Difference:
    """Compare two runs (steps, outputs) bit by bit."""
    unequal = reference.view(np.int64) != other.view(np.int64)
    scale = np.maximum(np.abs(reference).max(axis=0), 1e-300)
    return Difference(reference.size, int(unequal.sum()), float((np.abs(other - reference).max(axis=0) / scale).max()))


def drive(scene: str, links: str, settings: Sequence[str], steps: int, file: Path) -> None:
    """Drive in this process; write outputs (steps + 1, outputs) to ``file`` and print the resolved scene as JSON.

    The placed scene is computed, not taken from the cache.
    """
    from vehicle_in_process import InProcess

    from fmus.rest import equilibrium, tensioning
    from orchestrator.scene.scene import load

    for module in (equilibrium, tensioning):
        module.cached_result = lambda kind, name, request, compute: compute()  # type: ignore[attr-defined]
    vehicle = InProcess(load(scene, links, settings))

    def row() -> list[np.ndarray]:
        members = vehicle.members.values()
        return [array for member in members for array in (member.model.state.copy(), member.y.copy())]

    rows = [np.concatenate(row())]
    for _ in range(steps):
        vehicle.step()
        rows.append(np.concatenate(row()))
    np.save(file, np.array(rows))
    print(json.dumps(vehicle.scene.resolved(), sort_keys=True))


def driven(
    scene: str, links: str, settings: Sequence[str], steps: int, choice: Mapping[str, str]
) -> tuple[str, np.ndarray]:
    """Resolved scene and outputs of ``drive`` in a child with this environment."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "outputs.npy"
        words = [sys.executable, "-m", "tests.processors", "--child", scene, links, str(steps), str(file), *settings]
        child = subprocess.run(words, cwd=ROOT, env={**os.environ, **choice}, capture_output=True, text=True)
        if child.returncode:
            raise RuntimeError(child.stderr[-2000:])
        return child.stdout, np.load(file)


def native_runs(scene: str, links: str, steps: int, folder: Path) -> dict[str, np.ndarray]:
    """Outputs (steps, outputs) of native FMUs by processor and system, by the C host."""
    from c_host import host, order_text, windows_host

    from fmus.native.machine_code import LINUX, WINDOWS
    from orchestrator.scene.assembly import assemble, build_native_all
    from orchestrator.scene.placing import placed
    from orchestrator.scene.scene import load

    resolved = placed(load(scene, links, DRIVING))
    assembly = assemble(resolved)
    emulator, wine = shutil.which("qemu-x86_64"), shutil.which("wine")
    parts = [(part.kind, part.config | {"parameters": part.parameters}, None) for part in assembly.parts]
    files, program = build_native_all(parts, windows=wine is not None), host(folder)
    trace, runs = folder / "trace", {}
    ways: dict[str, tuple[Sequence[str], Mapping[str, str]]] = {
        "as it is": ((program,), {}),
        "glibc without AVX and FMA": ((program,), {"GLIBC_TUNABLES": OLD_LIBM}),
        **{f"{model}, emulated": ((emulator, "-cpu", model, program), {}) for model in EMULATED if emulator},
    }
    if wine:
        ways["Windows, in Wine"] = (wine, windows_host(folder)), os.environ
    for name, (command, environment) in ways.items():
        order = order_text(assembly, files, resolved.run.step, steps, WINDOWS if command[0] == wine else LINUX)
        subprocess.run(
            command, input=f"{order} {trace}", env=dict(environment), capture_output=True, text=True, check=True
        )
        runs[name] = np.fromfile(trace).reshape(steps, -1)
    return runs


def compare_python(scene: str, links: str, steps: int, choices: Sequence[str] = tuple(PYTHON)) -> int:
    """Print a line for each choice of the libraries; number of values that differ, a scene counting as one."""
    place, reference = driven(scene, links, DRIVING, steps, {})
    total = 0
    for name in choices:
        resolved, outputs = driven(scene, links, DRIVING, steps, PYTHON[name])
        found = difference(reference, outputs)
        total += found.different + (resolved != place)
        start = "same start" if resolved == place else "another start"
        print(f"{scene}, {links}, Python, {name}: {start}, {_text(found)}", flush=True)
    return total


def compare_native(scene: str, links: str, steps: int) -> int:
    """Print a line for each processor; number of values that differ."""
    with tempfile.TemporaryDirectory() as folder:
        runs = native_runs(scene, links, steps, Path(folder))
    total = 0
    for name, outputs in runs.items():
        found = difference(runs["as it is"], outputs)
        total += found.different
        print(f"{scene}, {links}, native, {name}: {_text(found)}", flush=True)
    return total


def _text(found: Difference) -> str:
    return f"{found.different} of {found.values} values differ, by {found.largest:.2g} at most"


def main() -> int:
    """Compare as the command line says; 1 if a value differs."""
    if sys.argv[1:2] == ["--child"]:
        scene, links, steps, file, *settings = sys.argv[2:]
        drive(scene, links, settings, int(steps), Path(file))
        return 0
    parser = argparse.ArgumentParser(prog="python -m tests.processors", description="Same bits on every processor")
    parser.add_argument("scenes", nargs="*", default=["straight", "turn"])
    parser.add_argument("--links", choices=["flexible", "rigid"], nargs="+", default=["flexible", "rigid"])
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--no-native", action="store_true")
    chosen = parser.parse_args()
    total = 0
    for scene in chosen.scenes:
        for links in chosen.links:
            total += compare_python(scene, links, chosen.steps)
            if not chosen.no_native:
                total += compare_native(scene, links, chosen.steps)
    return int(total > 0)


if __name__ == "__main__":
    sys.exit(main())
