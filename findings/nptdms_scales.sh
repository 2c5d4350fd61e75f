#!/usr/bin/env bash
# npTDMS 1.13.0: samples get a scale that is not theirs, without an error.
#
# A channel whose linear slope changes from 0.5 to 2 between two segments, as after a calibration, is scaled with the last
# one throughout: 0 20 40 0 20 40 for the counts 0 10 20 0 10 20, where the first three should be 0 5 10. A scale of a
# type that npTDMS does not know (NI's Reciprocal) gives raw counts and a line in the log of the module only. Users: look at
# the properties of all segments, and at the scale types, before the data.
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet npTDMS==1.13.0 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" - <<'PYTHON'
import numpy as np
from nptdms import ChannelObject, TdmsFile, TdmsWriter

scale = {
    "NI_Scaling_Status": "unscaled", "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear",
    "NI_Scale[0]_Linear_Slope": 0.5, "NI_Scale[0]_Linear_Y_Intercept": 0.0,
    "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
}
counts = np.array([0, 10, 20], np.int16)


def read(*segments):
    with TdmsWriter("v.tdms") as file:
        for changed in segments:
            file.write_segment([ChannelObject("g", "v", counts, scale | changed)])
    return [float(value) for value in TdmsFile.read("v.tdms")["g"]["v"][:]]


one, changed = read({}), read({}, {"NI_Scale[0]_Linear_Slope": 2.0})
unknown = read({"NI_Scale[0]_Scale_Type": "Reciprocal"})
print(one, changed, unknown)
assert one == [0, 5, 10]
assert changed == [0, 20, 40, 0, 20, 40], "each segment has its scale"
assert unknown == [0, 10, 20], "an unknown scale is told"
PYTHON
echo "as described"
