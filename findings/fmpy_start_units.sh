#!/usr/bin/env bash
# fmpy 0.3.32: start values given with a display unit are converted wrongly in two cases.
#
# simulate_fmu takes start values as (value, unit), the unit being one that the model description can show.
# - Of a variable with a declared type the offset is left out: 20 degC of a temperature in K become 20 K, not 293.15 K.
#   A type without relativeQuantity counts as one of differences.
# - FMI 3.0's inverse="true" (2.4.4.3: shown = factor / value) is not read: 10 km/l of a consumption in m3/m become
#   1e7, not 1e-7. Plots multiply there, too.
# Users: give start values in the unit of the variable.
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet fmpy==0.3.32
cat > "$folder/modelDescription.xml" <<'XML'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="g">
  <CoSimulation modelIdentifier="m"/>
  <UnitDefinitions>
    <Unit name="K"><BaseUnit K="1"/><DisplayUnit name="degC" offset="-273.15"/></Unit>
    <Unit name="m3/m"><BaseUnit m="2"/><DisplayUnit name="km/l" factor="1e-6" inverse="true"/></Unit>
  </UnitDefinitions>
  <TypeDefinitions><Float64Type name="Temperature" unit="K" displayUnit="degC"/></TypeDefinitions>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
    <Float64 name="typed" valueReference="1" causality="parameter" variability="fixed" declaredType="Temperature" start="300"/>
    <Float64 name="plain" valueReference="2" causality="parameter" variability="fixed" unit="K" start="300"/>
    <Float64 name="consumption" valueReference="3" causality="parameter" variability="fixed" unit="m3/m" start="1e-7"/>
  </ModelVariables>
  <ModelStructure/>
</fmiModelDescription>
XML
"$folder/env/bin/python" - "$folder/modelDescription.xml" <<'PYTHON'
import sys

import fmpy
from fmpy.simulation import apply_start_values


class Instance:
    """Stands for an FMU: notes the values that it is given."""

    def __init__(self):
        self.given = {}

    def setFloat64(self, references, values):
        self.given.update(zip(references, values))


read = fmpy.read_model_description(sys.argv[1], validate=True)
instance = Instance()
starts = {"typed": (20.0, "degC"), "plain": (20.0, "degC"), "consumption": (10.0, "km/l")}
apply_start_values(instance, read, starts, None)
typed, plain, consumption = (instance.given[k] for k in (1, 2, 3))
print(f"20 degC: {plain:g} K without, {typed:g} K with a declared type; 10 km/l: {consumption:g} m3/m")
assert abs(plain - 293.15) < 1e-9
assert typed == 20.0, "the offset of a declared type's display unit counts"
assert abs(consumption - 1e7) < 1.0, "inverse display units are read"
PYTHON
echo "as described"
