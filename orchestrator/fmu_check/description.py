"""Check of the description: FMPy's validation with the XSD of FMI 2.0, files of the FMU, its binary."""

from __future__ import annotations

import fmpy
from fmpy.validation import validate_fmu

from orchestrator.cosim.fmu_files import unpack
from orchestrator.fmu_check.instance import Instance, Subject
from orchestrator.fmu_check.verdict import NotApplicable, Verdict


def check(subject: Subject) -> Verdict:
    """Validate modelDescription.xml; load and instantiate the binary of this platform."""
    faults = [" ".join(problem.split()) for problem in validate_fmu(str(subject.fmu))]
    folder = unpack(subject.fmu)
    binaries = sorted(path.name for path in (folder / "binaries").glob("*"))
    try:
        with Instance(subject):
            pass
    except NotApplicable as refusal:
        faults.append(str(refusal))
    documented = "documented" if (folder / "documentation" / "index.html").is_file() else "no documentation"
    note = f"valid; {documented}; binaries for {', '.join(binaries)}, that for {fmpy.platform} loads"
    return Verdict(note, tuple(faults))
