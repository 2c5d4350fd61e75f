#!/usr/bin/env bash
# fmpy 0.3.32: min and max of unsigned variables of FMI 3.0, and the inverse of display units, are not read.
#
# read_model_description takes min, max and quantity of types whose name begins with "Float" or "Int", so those of
# UInt8 to UInt64 are None; and DisplayUnit.inverse (FMI 3.0, 2.4.3.4) has no place in its result: a unit whose display
# value is factor / value looks as one of factor * value. Users: read these attributes from the XML themselves.
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet fmpy==0.3.32
cat > "$folder/modelDescription.xml" <<'XML'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t">
  <CoSimulation modelIdentifier="m"/>
  <UnitDefinitions>
    <Unit name="m/s"><BaseUnit m="1" s="-1"/><DisplayUnit name="s/m" factor="1" inverse="true"/></Unit>
  </UnitDefinitions>
  <ModelVariables>
    <Int8 name="signed" valueReference="1" causality="parameter" variability="fixed" start="1" min="0" max="9"/>
    <UInt8 name="unsigned" valueReference="2" causality="parameter" variability="fixed" start="1" min="0" max="9"/>
  </ModelVariables>
  <ModelStructure/>
</fmiModelDescription>
XML
"$folder/env/bin/python" - "$folder/modelDescription.xml" <<'PYTHON'
import sys
import zipfile
from pathlib import Path

import fmpy

description = Path(sys.argv[1])
with zipfile.ZipFile(description.with_name("m.fmu"), "w") as archive:
    archive.write(description, "modelDescription.xml")
read = fmpy.read_model_description(str(description.with_name("m.fmu")), validate=False)
bounds = {variable.name: (variable.min, variable.max) for variable in read.modelVariables}
shown = read.unitDefinitions[0].displayUnits[0]
fields = [name for name in dir(shown) if not name.startswith("_")]
print(bounds, fields)
assert bounds["signed"] == ("0", "9")
assert bounds["unsigned"] == (None, None), "bounds of unsigned variables are read"
assert not any("inverse" in name for name in fields), "inverse is read"
PYTHON
echo "as described"
