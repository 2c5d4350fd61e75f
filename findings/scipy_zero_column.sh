#!/usr/bin/env bash
# scipy 1.17.1: least_squares (trf, exact) may move a variable on which nothing depends as far as its trust region goes.
#
# The residuals are linear in three variables, and the column of the second one in the Jacobian is exactly 0. In one of
# 40 random problems the second variable ends at -5.55 instead of its start, 0, and the answer is "success" with status
# 1: its singular value is some 1e-16 of the largest instead of 0, and the step divides it by its own size. The methods
# "dogbox" and "lm" and the solver "lsmr" leave it at 0. Users: give such a variable a row that holds it, or leave it out.
#
# Exit status 0: it still does so; 1: it behaves differently now. Which problem it is may depend on the processor.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet scipy==1.17.1 numpy==2.4.6
"$folder/env/bin/python" - <<'PYTHON'
import numpy as np
from scipy.optimize import least_squares

far = {}
for how in ({}, {"method": "dogbox"}, {"method": "lm"}, {"tr_solver": "lsmr"}):
    name = " ".join(how.values()) or "trf exact"
    far[name] = 0.0
    for seed in range(1000):
        chance = np.random.default_rng(seed)
        A = chance.standard_normal((20, 3))
        A[:, 1] = 0.0
        y = A @ [1.0, 0.0, 2.0] + 0.1 * chance.standard_normal(20)
        found = least_squares(lambda x: A @ x - y, np.zeros(3), lambda x: A, **how)
        assert found.success
        far[name] = max(far[name], abs(float(found.x[1])))
print({name: round(value, 6) for name, value in far.items()})
assert far.pop("trf exact") > 0.1, "the variable stays"
assert max(far.values()) < 1e-9, "others move it too"
PYTHON
echo "as described"
