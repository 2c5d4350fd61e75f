"""Check of memory: instances that come and go leave nothing behind."""

from __future__ import annotations

import gc
from pathlib import Path

from orchestrator.fmu_check.instance import Instance, Subject
from orchestrator.fmu_check.verdict import NotApplicable, Verdict

CYCLES, WARM_UP = 200, 50
LIMIT = 10.0  # MB
STATUS = Path("/proc/self/status")


def check(subject: Subject) -> Verdict:
    """Instantiate, initialise, step and free; measure the growth of resident memory after a warm-up."""
    if not STATUS.exists():
        raise NotApplicable("this system has no /proc/self/status")
    for _ in range(WARM_UP):
        _cycle(subject)
    before = _resident()
    for cycle in range(CYCLES):
        subject.begin(f"in cycle {WARM_UP + cycle} of instantiate, initialise, step and free")
        _cycle(subject)
    growth = _resident() - before
    sentence = f"resident memory grows by {growth:.1f} MB in {CYCLES} cycles of instantiate, initialise, step and free"
    return Verdict(sentence, (sentence,) if growth > LIMIT else ())


def _cycle(subject: Subject) -> None:
    with Instance(subject) as instance:
        instance.initialise()
        instance.step(0)


def _resident() -> float:
    """Resident memory, MB."""
    gc.collect()
    (line,) = (line for line in STATUS.read_text().splitlines() if line.startswith("VmRSS"))
    return int(line.split()[1]) / 1024.0
