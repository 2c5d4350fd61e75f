#!/usr/bin/env bash
# asammdf 8.8.28: conversions of integers in MDF 4 give wrong values without a word.
#
# "Value range to value" (ASAM MDF 4: for integers both borders belong to a range) with 0..9 -> 1, 10..19 -> 2, else -1
# gives -1 -1 1 -1 -1 2 2 for 0 5 9 10 15 19 40: of a range of integers only the upper border is found, and values above
# all ranges get the last one. For floats the ranges [0, 9) and [10, 19) are right. An algebraic formula, X1 * X1, is
# computed in the type of the integers: 60001 squared is -694847295. Users: read raw values and convert them yourself.
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet asammdf==8.8.28 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" - <<'PYTHON'
import numpy as np
from asammdf import MDF, Signal
from asammdf.blocks.conversion_utils import from_dict

ranges = {"lower_0": 0, "upper_0": 9, "phys_0": 1.0, "lower_1": 10, "upper_1": 19, "phys_1": 2.0, "default": -1.0}


def read(raw, conversion):
    file = MDF(version="4.10")
    file.append([Signal(raw, np.arange(len(raw)) * 0.1, name="v", conversion=from_dict(conversion))])
    file.save("v.mf4", overwrite=True)
    file.close()
    with MDF("v.mf4") as file:
        return [float(value) for value in file.get("v").samples]


values = [0, 5, 9, 10, 15, 19, 40]
integers, floats = read(np.array(values, np.uint8), ranges), read(np.array(values, float), ranges)
squares = read(np.array([3, 60001], np.int32), {"formula": "X1 * X1"})
print("integers", integers, "floats", floats, "squares", squares)
assert integers != [1, 1, 1, 2, 2, 2, -1], "ranges of integers are right"
assert integers == [-1, -1, 1, -1, -1, 2, 2]
assert floats == [1, 1, -1, 2, 2, -1, -1]
assert squares == [9, -694847295]
PYTHON
echo "as described"
