"""Check that a run has the same bits again, beside another instance, and in another thread."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from orchestrator.fmu_check.instance import STEPS, Floats, Instance, Subject
from orchestrator.fmu_check.verdict import Refused, Verdict, listed


def check(subject: Subject) -> Verdict:
    """Compare a run with a second one, with two that step in turn, and with one whose steps another thread makes."""
    varied = f"inputs vary by {subject.amplitude:g}" if subject.amplitude else "inputs keep their start values"
    inputs = varied if subject.inputs else f"no {subject.fmi.REAL} inputs"
    (expected,) = _again(subject)
    faults = []
    for where, runs in (
        ("in a second run", _again),
        ("of two instances that step in turn", _in_turn),
        ("in another thread than that of the instantiation", _in_thread),
    ):
        subject.begin(where)
        try:
            names = dict.fromkeys(name for run in runs(subject) for name in subject.differing(expected, run))
        except Refused as refusal:
            faults.append(f"{where}: {refusal}")
        else:
            faults += [f"{where} {listed([*names])} differ"] if names else []
    return Verdict(f"{STEPS} steps of {subject.step:g} s, {inputs}: the same bits", tuple(faults))


def _again(subject: Subject) -> list[Floats]:
    with Instance(subject) as instance:
        instance.initialise()
        return [instance.run()]


def _in_turn(subject: Subject) -> list[Floats]:
    with Instance(subject) as one, Instance(subject) as two:
        one.initialise()
        two.initialise()
        pairs = [(one.step(k), two.step(k)) for k in range(STEPS)]
    return [np.array(rows) for rows in zip(*pairs, strict=True)]


def _in_thread(subject: Subject) -> list[Floats]:
    with Instance(subject) as instance, ThreadPoolExecutor(1) as pool:
        instance.initialise()
        return [pool.submit(instance.run).result()]
