#!/usr/bin/env bash
# fmpy 0.3.32: relativeQuantity of a variable is not read, and a comment hides the type in a SimpleType.
#
# read_model_description asks the XML element of a variable with `in`, which looks at its children, so relativeQuantity
# is None whatever the variable says (that of a declared type is read): 10 K as a difference in degC become -263.15.
# Of a SimpleType (FMI 2.0) it takes the first child, also if that is a comment: unit and bounds of the type are lost.
# Users: read these from the XML themselves, without comments.
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet fmpy==0.3.32
cat > "$folder/modelDescription.xml" <<'XML'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="m" guid="g">
  <CoSimulation modelIdentifier="m"/>
  <UnitDefinitions><Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit></UnitDefinitions>
  <TypeDefinitions>
    <SimpleType name="plain"><Real unit="degC" relativeQuantity="true"/></SimpleType>
    <SimpleType name="commented"><!-- a difference --><Real unit="degC" relativeQuantity="true"/></SimpleType>
  </TypeDefinitions>
  <ModelVariables>
    <ScalarVariable name="k" valueReference="0" causality="parameter" variability="fixed">
      <Real start="10" unit="degC" relativeQuantity="true"/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure/>
</fmiModelDescription>
XML
"$folder/env/bin/python" - "$folder/modelDescription.xml" <<'PYTHON'
import sys

import fmpy

read = fmpy.read_model_description(sys.argv[1], validate=True)
types = {each.name: (each.unit, each.relativeQuantity) for each in read.typeDefinitions}
said = read.modelVariables[0].relativeQuantity
print(said, types)
assert said is None, "relativeQuantity of a variable is read"
assert types["plain"] == ("degC", True)
assert types["commented"] == (None, False), "a comment hides the type no longer"
PYTHON
echo "as described"
