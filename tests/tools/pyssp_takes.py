"""pyssp_standard tried: ``python -m tests.tools.pyssp_takes FOLDER``.

Needs cotrack[native] and pyssp-standard==0.9.1.
"""

from pyssp_standard.ssp import SSP

from tests.tools.made import attempt, folder, said

EXPECTED = {
    "archive": "2 components, 1 connections",
    "system connector": "2 components, 2 connections",
    "LinearTransformation": "2 components, 1 connections",
    "parameter set": "speed.end = 6.0",
}


def read(name: str) -> str:
    with SSP(place / f"{name}.ssp") as archive:
        system = archive.system_structure.system
        return f"{len(system.elements)} components, {len(system.connections)} connections"


def values() -> str:
    with SSP(place / "set.ssp") as archive:
        binding = archive.system_structure.system.elements[0].parameter_bindings[0]
        values = {each["name"]: each["type_value"] for each in binding.ssv.parameters}
        return f"speed.end = {values['speed.end'].parameter['value']}"


place = folder()
FOUND = {
    "archive": attempt(lambda: read("drives")),
    "system connector": attempt(lambda: read("system")),
    "LinearTransformation": attempt(lambda: read("scaled")),
    "parameter set": attempt(values),
}
said("pyssp_standard 0.9.1", FOUND, EXPECTED)
