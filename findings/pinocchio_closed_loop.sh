#!/usr/bin/env bash
# Pinocchio 4.1.0: constraintDynamics with its default ProximalSettings returns NaN for a closed planar chain.
#
# Four rods on hinges form a square at rest; a point constraint (CONTACT_3D) closes it. Its three equations are of rank
# two, because hinges cannot move a point along their axes. The default (mu = 0, one iteration) gives accelerations of
# NaN, without an exception, a warning or a status; mu = 1e-8 gives the right ones, all 0. The documentation of lcaba says
# that mu must be positive, that of constraintDynamics does not. Users of closed chains: pass ProximalSettings, and look
# whether the accelerations are finite.
#
# Exit status 0: it still does so; 1: it behaves differently now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet pin==4.1.0 numpy==2.4.6
"$folder/env/bin/python" - <<'PYTHON'
import warnings

import numpy as np
import pinocchio as pin

warnings.simplefilter("error")
model, link = pin.Model(), 0
rod = pin.Inertia(1.0, np.array([0.5, 0.0, 0.0]), np.diag([0.0, 1.0, 1.0]) / 12.0)
ahead = np.array([1.0, 0.0, 0.0])
for k in range(4):
    corner = pin.SE3(pin.utils.rotate("z", 0.5 * np.pi), ahead)
    joint, place = (pin.JointModelRZ(), corner) if k else (pin.JointModelPlanar(), pin.SE3.Identity())
    link = model.addJoint(link, joint, place, f"joint {k}")
    model.appendBodyToJoint(link, rod, pin.SE3.Identity())
data = model.createData()
constraints, memory = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
constraints.append(pin.RigidConstraintModel(
    pin.ContactType.CONTACT_3D, model, link, pin.SE3(np.eye(3), ahead), 1, pin.SE3.Identity(), pin.ReferenceFrame.LOCAL
))
memory.append(constraints[0].createData())
pin.initConstraintDynamics(model, data, constraints, memory)
state = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
model.gravity.linear = np.zeros(3)


def accelerations(*settings):
    return pin.constraintDynamics(model, data, *state, constraints, memory, *settings).copy()


default, proximal = accelerations(), accelerations(pin.ProximalSettings(1e-12, 1e-8, 10))
print(f"pinocchio {pin.__version__}, mu = {pin.ProximalSettings().mu:g}: {default}")
print(f"mu = 1e-8: {proximal}")
assert np.isnan(default).all(), "the default gives numbers now"
assert abs(proximal).max() < 1e-12, "the proximal solution has changed"
PYTHON
echo "as described"
