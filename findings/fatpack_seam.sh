#!/usr/bin/env bash
# fatpack 0.7.8: find_rainflow_ranges leaves out the largest peak of a record that ends with it and begins on the way down.
#
# It closes the residue by joining it to itself. At the seam concatenate_reversals takes out the point that is no
# reversal, but of the two it takes the wrong one: 4, 1, 3, 0, 9, repeated, goes 9, 4, 1, so 4 is no reversal; 9 is taken
# out. The cycles of the repeated record are 1 to 3 and 0 to 9, ranges 2 and 9; fatpack counts 2 and 4. In the force of a
# pin that grows from its begin to its end, this is nearly all of the damage. Users: begin and end the record with its
# least or largest value, as np.roll can do; then fatpack counts as ASTM E1049-85, 5.4.5.
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet fatpack==0.7.8 numpy==2.4.6
"$folder/env/bin/python" - <<'PYTHON'
import fatpack
import numpy as np

as_recorded = np.array([4.0, 1.0, 3.0, 0.0, 9.0])
from_the_least = np.array([0.0, 9.0, 1.0, 3.0, 0.0])  # the same record, repeated
wrong, right = (np.sort(fatpack.find_rainflow_ranges(x, k=1 << 20)).round(3) for x in (as_recorded, from_the_least))
print(f"as recorded: {wrong}; from its least value: {right}")
assert right.tolist() == [2.0, 9.0], "the count of the rolled record has changed"
assert wrong.tolist() != right.tolist(), "both are the same now"
PYTHON
echo "as described"
