"""Small FMUs in C that are no FMUs of cotrack: models in `foreign`, compiled with the compiler of native FMUs."""

import json
import subprocess
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement, tostring

import fmpy

from fmus.interface.ports import UNITS, motion_ports, wrench_ports
from fmus.native.machine_code import FLAGS, HERE, compiler

SOURCES = Path(__file__).parents[1] / "foreign"
Base = Mapping[str, float]  # attributes of a BaseUnit
IN_C = str.maketrans(".[]", "___")


class Variable(NamedTuple):
    """Variable of a model, called in C like here with underscores for dots and brackets."""

    name: str
    causality: str
    start: float | int | bool | str = 0.0
    kind: str = "Real"
    unit: str = ""
    items: tuple[str, ...] = ()  # of an Enumeration, counted from 1


def ports(name: str, causality: str, of: str) -> list[Variable]:
    """Variables of a motion or a wrench as ``fmus.interface.ports`` names them."""
    made = motion_ports(name, causality) if of == "motion" else wrench_ports(name, causality)
    return [Variable(port.name, causality, port.start, unit="" if port.unit == "1" else port.unit) for port in made]


DRIVE = (
    *ports("mount", "input", "motion"),
    *ports("sprocket", "input", "wrench"),
    *ports("sprocket", "output", "motion"),
    *ports("mount", "output", "wrench"),
    Variable("speed", "output", unit="rad/s"),
    Variable("angle", "output", unit="rad"),
    Variable("rate", "local", unit="rad/s"),
    Variable("torque", "parameter", 300.0, unit="N.m"),
    Variable("inertia", "parameter", 10.0),
    Variable("end", "parameter", 1e9, unit="s"),
    Variable("manner", "parameter", 0, "Integer"),
    Variable("steps", "output", 0, "Integer"),
    Variable("fast", "output", False, "Boolean"),
)

PLACES = [
    f"{side}.{place}"
    for side in ("left", "right")
    for place in (*(f"road_wheel[{k}]" for k in range(1, 6)), "idler", "sprocket")
]
CHASSIS = (
    *(variable for place in PLACES for variable in ports(place, "input", "wrench")),
    *(variable for place in PLACES for variable in ports(place, "output", "motion")),
    *ports("chassis", "output", "motion"),
    Variable("speed", "output", unit="m/s"),
    Variable("distance", "output", unit="m"),
    Variable("energy.kinetic", "output", unit="J"),
    Variable("energy.gravity", "output", unit="J"),
    *(Variable(f"state[{k}]", "local") for k in range(1, 36)),
    *(Variable(f"{place}.start.{axis}", "parameter", unit="m") for place in (*PLACES, "centre") for axis in "xyz"),
    Variable("pitch", "parameter", unit="rad"),
    Variable("gravity", "parameter", 9.81, unit="m/s2"),
    Variable("mass", "parameter", 1.0, unit="kg"),
    *(Variable(f"inertia.{axes}", "parameter", float(axes[0] == axes[1])) for axes in ("xx", "yy", "zz", "xz")),
    Variable("wheel.inertia", "parameter", 1.0),
    Variable("idler.inertia", "parameter", 1.0),
    Variable("substeps", "parameter", 4, "Integer"),
)


def build(
    file: Path,
    model: str,
    variables: Sequence[Variable],
    units: Mapping[str, Base] = UNITS,
    library: bytes | None = None,
    states: bool = False,
    once: bool = False,
) -> Path:
    """Build the FMU of a model in `foreign`.

    ``library``: take this one, of the same variables in other units, instead. ``states``: it says that it saves states.
    ``once``: that it can be instantiated once per process.
    """
    guid = str(uuid.uuid5(uuid.NAMESPACE_OID, repr([each._replace(unit="", items=()) for each in variables])))
    rows: dict[str, list[Variable]] = {"Real": [], "Integer": [], "String": []}
    for variable in variables:
        rows[variable.kind if variable.kind in rows else "Integer"].append(variable)
    root = _description(model, guid, variables, units)
    says = {"canGetAndSetFMUstate": states, "canBeInstantiatedOnlyOncePerProcess": once}
    for element in root.iter("CoSimulation"):
        element.attrib |= {name: "true" for name, is_so in says.items() if is_so}
    for element, variable in zip(root.iter("ScalarVariable"), variables, strict=True):
        row = rows[variable.kind if variable.kind in rows else "Integer"]
        element.set("valueReference", str(row.index(variable)))
    content = library or _compiled(file.with_suffix(".so"), model, _header(guid, rows))
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", tostring(root))
        archive.writestr(f"binaries/{fmpy.platform}/{model}{fmpy.sharedLibraryExtension}", content)
    return file


def library_of(fmu: Path) -> bytes:
    """Library in an FMU."""
    with zipfile.ZipFile(fmu) as archive:
        return archive.read(next(name for name in archive.namelist() if name.startswith("binaries/")))


def _compiled(library: Path, model: str, header: str) -> bytes:
    folder = library.parent
    (folder / "model.h").write_text(header)
    includes = [f"-I{place}" for place in (folder, SOURCES, HERE)]
    command = [*compiler(), *FLAGS, "-ffp-contract=off", *includes, "-o", str(library), SOURCES / f"{model}.c", "-lm"]
    subprocess.run(command, check=True)
    return library.read_bytes()


def _header(guid: str, rows: Mapping[str, Sequence[Variable]]) -> str:
    """Places and start values of the variables, for the model in C."""
    lines = [f'#define GUID "{guid}"']
    formats = {"Real": ("double", lambda x: repr(float(x)), "0"), "Integer": ("int", lambda x: str(int(x)), "0")}
    formats["String"] = ("char *const", lambda x: json.dumps(x or ""), '""')
    for kind, (c_type, text, last) in formats.items():
        array = f"{kind.upper()}_START"
        names = [variable.name.translate(IN_C) for variable in rows[kind]]
        lines.append(f"#define {kind.upper()}S {len(names) + 1}")
        lines.append(f"enum {{ {', '.join([*names, f'{array}_END'])} }};")
        starts = [text(each.start) for each in rows[kind]]
        lines.append(f"static const {c_type} {array}[] = {{{', '.join([*starts, last])}}};")
    return "\n".join([*lines, ""])


def _description(model: str, guid: str, variables: Sequence[Variable], units: Mapping[str, Base]) -> Element:
    root = Element("fmiModelDescription", fmiVersion="2.0", modelName=f"Foreign {model}", guid=guid)
    capabilities = {"canHandleVariableCommunicationStepSize": "true"}
    SubElement(root, "CoSimulation", {"modelIdentifier": model, **capabilities})
    definitions = SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(variable.unit for variable in variables if variable.unit in units):
        base = {name: str(value) for name, value in units[unit].items()}
        SubElement(SubElement(definitions, "Unit", name=unit), "BaseUnit", base)
    types = SubElement(root, "TypeDefinitions") if any(variable.items for variable in variables) else root
    for variable in (variable for variable in variables if variable.items):
        enumeration = SubElement(SubElement(types, "SimpleType", name=f"{variable.name} type"), "Enumeration")
        for number, item in enumerate(variable.items, 1):
            SubElement(enumeration, "Item", name=item, value=str(number))
    element = SubElement(root, "ModelVariables")
    for variable in variables:
        fixed = variable.causality == "parameter"
        variability = "fixed" if fixed else "continuous" if variable.kind == "Real" else "discrete"
        about = {"name": variable.name, "causality": variable.causality, "variability": variability}
        scalar = SubElement(element, "ScalarVariable", about)
        attributes = {"unit": variable.unit} if variable.unit else {}
        if variable.causality in ("input", "parameter"):
            attributes["start"] = variable.start if variable.kind == "String" else repr(variable.start).lower()
        if variable.items:
            attributes["declaredType"] = f"{variable.name} type"
        SubElement(scalar, variable.kind, attributes)
    SubElement(root, "ModelStructure")
    return root
