#!/usr/bin/env bash
# fmpy 0.3.32: read_csv does not read what write_csv wrote of matrices' elements and of Booleans.
#
# write_csv quotes the names of columns; read_csv splits them at every comma. FMI's structured names have one between
# the indices of a matrix: after "m[1,2]" each name stands over the column before its own, without an error (with two
# elements of a row, an error of duplicate names). A Boolean is written as True, which is no number to read_csv.
# Elements of arrays (FMI 3.0) are written with 16 digits, scalars with all.
# Users: read such files with the module csv or with pandas.
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet fmpy==0.3.32
"$folder/env/bin/python" - "$folder/result.csv" <<'PYTHON'
import sys

import numpy as np
from fmpy.util import read_csv, write_csv

file, third = sys.argv[1], 0.1 + 0.2


def after(names, row, kinds="fffff"):
    """Result with the names, written and read."""
    kind = [(name, {"f": float, "b": bool, "a": (float, (2,))}[of]) for name, of in zip(names, kinds)]
    write_csv(file, np.array([row], kind))
    return read_csv(file)


read = after(["time", "m[1,2]", "speed", "force"], (0.0, 12.0, 3.0, 400.0))
print({name: float(read[name][0]) for name in read.dtype.names})
assert read.dtype.names == ("time", "m[1", "2]", "speed"), "names with a comma are read"
assert read["speed"][0] == 400.0, "the column has its own values"
try:
    after(["time", "on"], (0.0, True), "fb")
    sys.exit("a Boolean is read")
except ValueError as error:
    print(error)
values = after(["time", "a", "x"], (0.0, (third, 1.0), third), "faf")
print(repr(float(values["a"][0][0])), repr(float(values["x"][0])))
assert values["a"][0][0] == 0.3 != values["x"][0] == third, "elements of arrays keep all digits"
PYTHON
echo "as described"
