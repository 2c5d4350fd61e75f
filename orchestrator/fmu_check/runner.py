"""Checks of an FMU, each in a child process whose crash or hang is a fault of the FMU.

The child is ``python -m orchestrator.fmu_check.runner CHECK FMU STEP JOURNAL``. Its journal is a JSON object: where the
check is, replaced at the end by the verdict. Streams cannot serve, because an FMU may write to them.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from orchestrator.fmi.model_description import BadDescription, describe
from orchestrator.fmu_check import call_checks, description_checks, run_checks
from orchestrator.fmu_check.instance import VERSIONS, CallRefused, NotApplicable, Subject, Verdict

CHECKS: dict[str, Callable[[Subject], Verdict]] = {
    "description": description_checks.check_description,
    "units": description_checks.check_units,
    "dependencies": description_checks.check_dependencies,
    "states": run_checks.check_states,
    "repeatability": run_checks.check_repeatability,
    "odd steps": call_checks.check_odd_steps,
    "non-finite inputs": call_checks.check_non_finite_inputs,
    "phases": call_checks.check_phases,
    "surroundings": run_checks.check_surroundings,
    "memory": run_checks.check_memory,
}
HANGING, LEAST, WORK = 1.2, 0.1, 0.9  # parts of the time limit of a check
STOPPED = "the process was stopped after"
ROOT = Path(__file__).resolve().parents[2]


def require_fmu(fmu: Path) -> None:
    """Raise ComponentFailed for what is no co-simulation FMU of these versions; checks report a bad description."""
    with suppress(BadDescription):
        describe(fmu, VERSIONS)


def verdicts(fmu: Path, step: float | None, limit: float, begun: Callable[[str], None]) -> dict[str, Verdict]:
    """Make all checks of an FMU; return their verdicts.

    :param step: communication step, s; None: the FMU's own.
    :param limit: time limit of a check, s; checks that are stopped take HANGING of it together, the rest is not made.
    :param begun: called with the name of each check before it.
    """
    results, left = {}, HANGING * limit
    for name in CHECKS:
        begun(name)
        if left < LEAST * limit:
            results[name] = Verdict("not made, because other checks did not come to an end", outcome="not finished")
            continue
        began = time.monotonic()
        results[name] = in_child(name, fmu, step, min(limit, left))
        if any(STOPPED in fault for fault in results[name].faults):
            left -= time.monotonic() - began
    return results


def in_child(name: str, fmu: Path, step: float | None, limit: float) -> Verdict:
    """Make one check in a child process; return its verdict."""
    path = os.pathsep.join([str(ROOT), *sys.path])
    with TemporaryDirectory() as folder:
        journal, errors = Path(folder, "journal"), Path(folder, "errors")
        journal.write_text("{}", encoding="utf-8")
        arguments = [name, str(fmu.absolute()), repr(step or 0.0), str(journal), repr(time.time() + WORK * limit)]
        with errors.open("wb") as stream:
            try:
                child = subprocess.run(
                    [sys.executable, "-m", "orchestrator.fmu_check.runner", *arguments],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=stream,
                    env={**os.environ, "PYTHONPATH": path},
                    timeout=limit,
                )
                end = _end(child.returncode, errors)
            except subprocess.TimeoutExpired:
                end = f"{STOPPED} {limit:.3g} s"
        content = json.loads(journal.read_text(encoding="utf-8"))
    note, faults, outcome = content.get("verdict", ("", (), "ok"))
    if not end and "verdict" not in content:
        end = "the process ended with exit status 0"  # the FMU has ended it
    if end:
        where = "at its exit" if "verdict" in content else content.get("at", "at the start")
        faults = (*faults, f"{end} {where}")
    return Verdict(note, tuple(faults), outcome)


def _end(code: int, errors: Path) -> str:
    """Say how a child process ended; empty if well."""
    if code == 0:
        return ""
    if code < 0:
        return f"the process was ended by {signal.Signals(-code).name}"
    lines = errors.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return f"the process ended with exit status {code}" + (f" ({lines[-1]})" if lines else "")


def judged(name: str, subject: Subject) -> Verdict:
    """Make a check in this process; return its verdict."""
    try:
        return CHECKS[name](subject)._replace(**subject.unfinished)
    except NotApplicable as reason:
        return Verdict(str(reason), outcome="not applicable")
    except CallRefused as refusal:
        return Verdict("", (str(refusal),))


def main(name: str, fmu: str, step: str, journal: str, deadline: str) -> None:
    """Make a check as a child process."""
    with Path(journal).open("r+b", buffering=0) as stream:  # a new file for each call of the FMU would take long

        def write(**content: object) -> None:
            stream.seek(0)
            stream.write(json.dumps(content).ljust(4096).encode())

        subject = Subject(Path(fmu), float(step), lambda words: write(at=words[:500]))
        subject.deadline = float(deadline)
        write(verdict=judged(name, subject))


if __name__ == "__main__":
    main(*sys.argv[1:])
