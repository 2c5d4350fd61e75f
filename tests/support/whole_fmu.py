"""FMU of FMI 3.0 with the types of whole numbers, compiled from `foreign/whole3.c`: y.TYPE = u.TYPE + p.TYPE."""

import re
import subprocess
import zipfile
from pathlib import Path

import fmpy

from fmus.native.machine_code import FLAGS, HERE, compiler

SOURCE = Path(__file__).parents[1] / "foreign" / "whole3.c"
TYPES = [f"{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U")]
ITEMS = {"low": 1, "middle": 5, "high": 9}
DECLARED = re.compile(r"^FMI3_Export fmi3\w+TYPE\s+(fmi3\w+);", re.MULTILINE)
SLOTS = {"u": "input", "p": "parameter", "y": "output"}


def description(starts=(), limits="", more=""):
    """Model description; ``starts``: start values by name, ``limits``: attributes of p.UInt8, ``more``: variables."""
    given, variables = dict(starts), []
    for k, kind in enumerate(TYPES):
        for slot, (letter, causality) in enumerate(SLOTS.items()):
            name, reference = f"{letter}.{kind}", 10 * k + slot
            variables.append(_variable(kind, name, reference, causality, given, limits if name == "p.UInt8" else ""))
    for slot, (letter, causality) in enumerate(SLOTS.items()):
        place = 63 + slot
        variables.append(_variable("Enumeration", f"{letter}.e", place, causality, given, 'declaredType="Level"'))
    items = "".join(f'<Item name="{name}" value="{value}"/>' for name, value in ITEMS.items())
    return (
        '<fmiModelDescription fmiVersion="3.0" modelName="w" instantiationToken="w">'
        '<CoSimulation modelIdentifier="whole3"/><TypeDefinitions>'
        f'<EnumerationType name="Level">{items}</EnumerationType></TypeDefinitions>'
        f"<ModelVariables>{''.join(variables)}{more}</ModelVariables><ModelStructure/></fmiModelDescription>"
    )


def _variable(kind, name, reference, causality, starts, more):
    start = {"parameter": "0", "input": "1" if kind == "Enumeration" else "0"}.get(causality)
    start = "" if start is None else f'start="{starts.get(name, start)}"'
    fixed = "fixed" if causality == "parameter" else "discrete"
    return (
        f'<{kind} name="{name}" valueReference="{reference}" causality="{causality}" variability="{fixed}"'
        f" {start} {more}/>"
    )


def build(folder):
    """Compile the library; return a function that packs it with a description into a file."""
    header = (Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h").read_text(encoding="utf-8")
    refused = (
        f'__attribute__((weak, visibility("default"))) int {name}(void) {{ return 3; }}'
        for name in DECLARED.findall(header)
    )
    (folder / "refused.c").write_text("\n".join(refused), encoding="utf-8")  # functions that the model lacks
    library = folder / f"whole3{fmpy.sharedLibraryExtension}"
    command = [*compiler(), *FLAGS, f"-I{HERE}", "-o", str(library), str(SOURCE), str(folder / "refused.c")]
    subprocess.run(command, check=True)

    def pack(name="whole.fmu", **given):
        with zipfile.ZipFile(folder / name, "w") as archive:
            archive.writestr("modelDescription.xml", description(**given))
            archive.write(library, f"binaries/{fmpy.platform_tuple}/{library.name}")
        return folder / name

    return pack
