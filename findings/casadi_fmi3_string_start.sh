#!/usr/bin/env bash
# CasADi 3.8.2: DaeBuilder cannot read an FMI 3.0 description with a String that has a start value.
#
# FMI 3.0 (2.4.7) gives the start value of a String as an element, <Start value="..."/>, and requires it of a parameter.
# DaeBuilder reads the same description with an Enumeration (attribute start) or without the String, and stops at the element
# with "Cannot handle: Start". So no FMU of FMI 3.0 that has a String parameter can be imported, whether that matters to the
# model or not. Makers of FMUs: give choices as Enumerations; users: keep a copy of the description without Strings.
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet casadi==3.8.2
"$folder/env/bin/python" - "$folder" <<'PYTHON'
import sys
from pathlib import Path

import casadi

HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="spring" instantiationToken="{spring}">
<ModelExchange modelIdentifier="spring"/>
<TypeDefinitions><EnumerationType name="kind of spring"><Item name="soft" value="1"/><Item name="stiff" value="2"/>
</EnumerationType></TypeDefinitions>
<ModelVariables>
<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
<Float64 name="x" valueReference="1" causality="output" variability="continuous" initial="exact" start="1"/>
<Float64 name="v" valueReference="2" causality="local" variability="continuous" derivative="1" initial="calculated"/>
<Enumeration name="kind" valueReference="3" causality="parameter" variability="fixed" declaredType="kind of spring" start="1"/>
"""
TEXT = """<String name="label" valueReference="4" causality="parameter" variability="fixed"><Start value="front"/></String>
"""
TAIL = """</ModelVariables>
<ModelStructure><Output valueReference="1" dependencies=""/>
<ContinuousStateDerivative valueReference="2" dependencies="1"/></ModelStructure>
</fmiModelDescription>
"""


def read(name: str, description: str) -> str:
    place = Path(sys.argv[1]) / name
    place.mkdir()
    (place / "modelDescription.xml").write_text(description)
    try:
        return f"read: outputs {casadi.DaeBuilder('spring', str(place)).y()}"
    except RuntimeError as error:
        return "refused: " + str(error).splitlines()[-1]


without, with_text = read("without", HEAD + TAIL), read("with", HEAD + TEXT + TAIL)
print(f"without the String {without}")
print(f"with it            {with_text}")
sys.exit(not (without.startswith("read") and with_text.startswith("refused") and "Start" in with_text))
PYTHON
