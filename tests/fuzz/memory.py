"""Call sequences and altered states of native FMUs under valgrind, and with the C sources under gcc's sanitizers.

A child process (``python -m tests.fuzz.memory FMU SEQUENCES STATES``) makes the calls. Of the errors that valgrind
finds in it only those count whose stack passes through the library of the FMU: Python and its packages have their own.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from unittest.mock import patch
from xml.etree.ElementTree import Element, parse

from fmus.native import machine_code
from fmus.native.pack import build_native
from tests.fuzz import calls, states
from tests.fuzz.driven import Wrong

SANITIZERS = "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer"


def valgrind_errors(
    kind: str, config: Mapping[str, Any], sequences: int, altered: int, folder: Path, fmi: int = 2
) -> list[str]:
    """Errors in the library of a native FMU, one sentence each; the report stays in ``folder``. Raises Wrong.

    Processors with AVX2 get the code for all processors too: valgrind 3.19 does not know all instructions of AVX.
    """
    with (
        patch.dict(os.environ, {"COTRACK_CACHE": str(folder / "cache")}),
        patch.dict("fmus.native.machine_code.LEVELS", wide_=machine_code.ANY),
    ):
        fmu = build_native(kind, config, folder, fmi=fmi)
    report = folder / f"{fmu.stem}.xml"
    tool = ["valgrind", "-q", "--leak-check=full", "--errors-for-leak-kinds=definite", "--xml=yes"]
    _run([*tool, f"--xml-file={report}"], fmu, sequences, altered, {"PYTHONMALLOC": "malloc"})
    return [_sentence(error) for error in parse(report).getroot().iter("error") if _in_library(error)]


def sanitised(kind: str, config: Mapping[str, Any], folder: Path, fmi: int = 2) -> Path:
    """Native FMU whose C sources are compiled by gcc with its sanitizers, built into ``folder``."""
    flags = tuple(flag for flag in machine_code.FLAGS if flag not in ("-fno-sanitize=all", "-s")) + SANITIZERS
    with (
        patch.object(machine_code, "compiler", lambda platform: ["gcc"]),
        patch.object(machine_code, "FLAGS", flags),
        patch.dict(os.environ, {"COTRACK_CACHE": str(folder / "cache")}),
    ):
        linux = machine_code.LINUX._replace(
            flags=tuple(flag for flag in machine_code.LINUX.flags if flag != "-Wl,-z,defs")
        )
        with patch("fmus.native.pack.LINUX", linux):
            return build_native(kind, config, folder, fmi=fmi)


def run_sanitised(fmu: Path, sequences: int, altered: int) -> None:
    """Make the calls with a sanitised FMU; raises Wrong with the sanitizer's report."""
    libraries = (
        subprocess.run(["gcc", f"-print-file-name=lib{name}.so"], capture_output=True, text=True).stdout.strip()
        for name in ("asan", "ubsan")
    )
    _run([], fmu, sequences, altered, {"LD_PRELOAD": " ".join(libraries), "ASAN_OPTIONS": "detect_leaks=0"})


def _run(tool: list[str], fmu: Path, sequences: int, altered: int, environment: dict[str, str]) -> None:
    command = [*tool, sys.executable, "-m", "tests.fuzz.memory", str(fmu), str(sequences), str(altered)]
    child = subprocess.run(command, capture_output=True, text=True, env=os.environ | environment)
    if child.returncode:
        raise Wrong(f"{fmu.name}: exit {child.returncode}: {child.stderr[-2000:]}")


def _in_library(error: Element) -> bool:
    folders = f"/binaries/{machine_code.LINUX.folder}/", f"/binaries/{machine_code.LINUX.fmi3_folder}/"
    return any(folder in (frame.text or "") for frame in error.iter("obj") for folder in folders)


def _sentence(error: Element) -> str:
    functions = [frame.findtext("fn") or "?" for frame in error.iter("frame")]
    return f"{error.findtext('kind')} in {' < '.join(functions[:6])}"


def main() -> None:
    """Make the calls of the command line."""
    fmu, sequences, altered = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    calls.LONGEST_CALL = float("inf")
    for seed in range(sequences):
        calls.sequence(fmu, seed)
    states.run(fmu, 1, altered)


if __name__ == "__main__":
    main()
