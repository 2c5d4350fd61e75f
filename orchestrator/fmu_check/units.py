"""Check of units: what another tool needs to compare the two ends of a connection."""

from __future__ import annotations

from orchestrator.fmu_check.instance import Subject
from orchestrator.fmu_check.verdict import Verdict, listed


def check(subject: Subject) -> Verdict:
    """Compare the units of Real inputs, outputs and parameters with the units that are defined.

    A Real without a unit is right unless all are without.
    """
    reals = [
        v for causality in ("input", "output", "parameter") for v in subject.variables(causality, subject.fmi.REAL)
    ]
    if not reals:
        return Verdict(f"there are no {subject.fmi.REAL} inputs, outputs and parameters", applicable=False)
    defined = {unit.name: unit for unit in subject.description.unitDefinitions}
    units = {v.name: v.unit or (v.declaredType.unit if v.declaredType is not None else None) for v in reals}
    bare = [name for name, unit in units.items() if unit is None]
    used = [*dict.fromkeys(unit for unit in units.values() if unit is not None)]
    faults = [] if used else [f"none of {len(reals)} {subject.fmi.REAL}s has a unit: connections cannot be checked"]
    faults += [f"unit '{unit}' is not defined" for unit in used if unit not in defined]
    faults += [
        f"unit '{unit}' has no base units: connections cannot be checked"
        for unit in used
        if unit in defined and defined[unit].baseUnit is None
    ]
    without = f"; without a unit: {listed(bare)}" if bare else ""
    return Verdict(f"{len(reals)} {subject.fmi.REAL}s in {len(used)} units with base units{without}", tuple(faults))
