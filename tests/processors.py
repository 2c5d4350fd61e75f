"""Proof that runs give the same bits on every x86-64 processor: ``python -m tests.processors [SCENE ...]``.

It drives the vehicle of a scene for 4,000 communication steps in child processes and compares all outputs of all steps
and the resolved scene with those of a run without changes. glibc, OpenBLAS and numpy choose their code by processor, so
each child is given another choice, by environment; native FMUs also run in an emulator (``qemu-user``) as other
processors. numba compiles for the generic processor in one child.
"""

from __future__ import annotations

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

ROOT = Path(__file__).resolve().parents[1]
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
    from fmus import equilibrium, tensioning
    from orchestrator.scene.scene import load
    from tests.vehicle_in_process import InProcess

    for module in (equilibrium, tensioning):
        module.read_checked = lambda file: None  # type: ignore[attr-defined]
        module.write_checked = lambda file, content: None  # type: ignore[attr-defined]
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


def emulated(order: str, program: Path, outputs: int, words: Sequence[str], choice: Mapping[str, str]) -> np.ndarray:
    """Outputs (steps, outputs) of the C host ``program`` behind ``words``, for an ``order`` without a trace file."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "trace"
        command = [*words, str(program)]
        subprocess.run(command, input=f"{order} {file}", env=dict(choice), capture_output=True, text=True, check=True)
        return np.fromfile(file).reshape(-1, outputs)


def native_runs(scene: str, links: str, settings: Sequence[str], steps: int, folder: Path) -> dict[str, np.ndarray]:
    """Outputs of native FMUs by processor, run by the C host under tunables and in the emulator."""
    from orchestrator.scene.assembly import assemble
    from orchestrator.scene.placing import placed
    from orchestrator.scene.scene import load
    from tests.test_native_host import built, host, order_text

    resolved = placed(load(scene, links, settings))
    assembly = assemble(resolved)
    order, program = order_text(assembly, built(assembly), resolved.run.step, steps), host(folder)
    outputs = sum(int(line.split()[5]) for line in order.splitlines() if line.startswith("instance"))
    ways: dict[str, tuple[Sequence[str], Mapping[str, str]]] = {
        "as it is": ((), {}),
        "glibc without AVX and FMA": ((), {"GLIBC_TUNABLES": OLD_LIBM}),
    }
    if emulator := shutil.which("qemu-x86_64"):
        ways |= {f"{model}, emulated": ((emulator, "-cpu", model), {}) for model in EMULATED}
    return {name: emulated(order, program, outputs, words, choice) for name, (words, choice) in ways.items()}


def main(words: Sequence[str]) -> int:
    """Print a line for each scene and choice; 1 if a value differs."""
    if words[:1] == ["--child"]:
        drive(words[1], words[2], words[5:], int(words[3]), Path(words[4]))
        return 0
    total = 0
    for scene in words or ("straight", "turn"):
        for links in ("flexible", "rigid"):
            place, reference = driven(scene, links, DRIVING, STEPS, {})
            for name, choice in PYTHON.items():
                resolved, outputs = driven(scene, links, DRIVING, STEPS, choice)
                found = difference(reference, outputs)
                total += found.different + (resolved != place)
                same = "same start" if resolved == place else "another start"
                print(f"{scene}, {links}, Python, {name}: {same}, {_text(found)}", flush=True)
            with tempfile.TemporaryDirectory() as folder:
                runs = native_runs(scene, links, DRIVING, STEPS, Path(folder))
            for name, outputs in runs.items():
                found = difference(runs["as it is"], outputs)
                total += found.different
                print(f"{scene}, {links}, native, {name}: {_text(found)}", flush=True)
    return int(total > 0)


def _text(found: Difference) -> str:
    return f"{found.different} of {found.values} values differ, by {found.largest:.2g} at most"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
