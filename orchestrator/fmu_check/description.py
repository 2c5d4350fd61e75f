"""Check of the description: FMPy's validation with the XSD of the FMU's version, files of the FMU, its binary."""

from __future__ import annotations

from pathlib import Path

import fmpy
from fmpy.validation import validate_fmu
from lxml import etree

from orchestrator.cosim.fmu_files import unpack
from orchestrator.fmu_check import fmi3
from orchestrator.fmu_check.instance import Instance, Subject
from orchestrator.fmu_check.verdict import NotApplicable, Verdict

TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"


def check(subject: Subject) -> Verdict:
    """Validate modelDescription.xml and the terminals; load and instantiate the binary of this platform."""
    faults = [" ".join(problem.split()) for problem in validate_fmu(str(subject.fmu))]
    folder = unpack(subject.fmu)
    if subject.fmi is fmi3:
        faults += _faults_of_terminals(folder / TERMINALS, {v.name for v in subject.description.modelVariables})
    binaries = sorted(path.name for path in (folder / "binaries").glob("*"))
    try:
        with Instance(subject):
            pass
    except NotApplicable as refusal:
        faults.append(str(refusal))
    documented = "documented" if (folder / "documentation" / "index.html").is_file() else "no documentation"
    note = f"valid; {documented}; binaries for {', '.join(binaries)}, that for {subject.fmi.PLATFORM} loads"
    return Verdict(note, tuple(faults))


def _faults_of_terminals(file: Path, variables: set[str]) -> list[str]:
    """Check the terminals of FMI 3.0 against their XSD; each member has to be a variable."""
    if not file.is_file():
        return []
    schema = etree.XMLSchema(etree.parse(Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"))
    try:
        root = etree.parse(file, etree.XMLParser(resolve_entities=False))
    except etree.XMLSyntaxError as error:
        return [f"{file.name}: {error}"]
    if not schema.validate(root):
        return [f"{file.name}: {error.message}" for error in schema.error_log]
    members = [member.get("variableName") for member in root.iter("TerminalMemberVariable")]
    return [f"{file.name}: there is no variable '{name}'" for name in members if name not in variables]
