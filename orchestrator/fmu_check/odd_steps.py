"""Check of unusual communication steps: outputs are finite, or the step is refused by its status."""

from __future__ import annotations

from orchestrator.fmu_check.instance import Instance, Subject, with_faults
from orchestrator.fmu_check.verdict import Verdict

SHORT = "1e-6 s"
# Steps that follow two ordinary ones: gap before the step, its length, both in communication steps.
CASES: dict[str, tuple[tuple[float, float], ...]] = {
    SHORT: (),
    "10 times the length": ((0.0, 10.0), (0.0, 1.0)),
    "unequal lengths": ((0.0, 0.3), (0.0, 1.7), (0.0, 0.01), (0.0, 1.0)),
    "length 0": ((0.0, 0.0), (0.0, 1.0)),
    "negative length": ((0.0, -1.0), (0.0, 1.0)),
    "a gap before it": ((0.5, 1.0), (0.0, 1.0)),
    "a begin before the last end": ((-0.5, 1.0), (0.0, 1.0)),
}


def check(subject: Subject) -> Verdict:
    """Make unusual steps, each kind in an instance of its own."""
    kinds: dict[str, list[str]] = {"taken": [], "refused": []}
    faults = []
    for name, steps in CASES.items():
        subject.begin(f"in a step of {name}")
        with Instance(subject) as instance:
            instance.initialise()
            instance.run(0, 2)
            t, taken = 2 * subject.step, True
            for gap, length in steps or ((0.0, 1e-6 / subject.step),) * 2:
                if taken:
                    t += gap * subject.step
                    taken, wrong = instance.attempt_step(t, length * subject.step)
                    t += length * subject.step
                    faults += with_faults(f"step of {name}", wrong)
        kinds["taken" if taken else "refused"].append(name)
    note = "; ".join(f"{kind}: {', '.join(names) or 'none'}" for kind, names in kinds.items())
    return Verdict(note, tuple(faults))
