#!/usr/bin/env bash
# scipy 1.17.1: least_squares (trf) ends at once, with success, if it starts at 0 on a bound.
#
# The best place of a line's two coefficients is (-3, -2), inside of the bounds -5 and 0, and the start is (0, 0). The
# start is moved inwards by 1e-10, and the first trust region is as large as the distance of the start from 0: 1e-10.
# The step is then below xtol, so the answer is status 2, "success", at (-2e-10, -2e-10) with the sum of squares of the
# start. The same problem with variables that are larger by 1 starts at (1, 1) and is solved; so is it with "dogbox".
# Users: let variables count from a number that is not 0, or look whether the cost fell.
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet scipy==1.17.1 numpy==2.4.6
"$folder/env/bin/python" - <<'PYTHON'
import numpy as np
from scipy.optimize import least_squares

t = np.linspace(0.0, 1.0, 101)
A = np.stack([np.ones_like(t), t], axis=1)
best = np.array([-3.0, -2.0])


def solve(offset, **how):
    found = least_squares(
        lambda x: A @ (x - offset - best), np.zeros(2) + offset, lambda x: A, (np.full(2, -5.0) + offset, np.zeros(2) + offset),
        xtol=1e-7, **how,
    )
    return found.status, found.success, found.x - offset


for name, (status, success, x) in {
    "start 0": solve(0.0), "start 1": solve(1.0), "dogbox, start 0": solve(0.0, method="dogbox"),
}.items():
    print(f"{name}: status {status}, success {success}, at {x}")
status, success, x = solve(0.0)
assert success and np.abs(x).max() < 1e-6, "it moves from the bound now"
for good in (solve(1.0), solve(0.0, method="dogbox")):
    assert np.abs(good[2] - best).max() < 1e-4, "the other ways fail too"
PYTHON
echo "as described"
