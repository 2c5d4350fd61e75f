"""Chain in MuJoCo: a tree of hinges, that of a loop from a planar free body and closed by a soft constraint.

As its makers would set it: the free body is the middle link, from which two branches hang, so that the tree is half as
deep; PGS, cheapest for one constraint, beside the default, Newton; a dense Jacobian, which takes 0.8 of the time of a
sparse one. ``connect`` closes the loop over two steps (``solref``), at 0.9999 of full stiffness (``solimp``): a softer
one is less accurate, not faster. There is no case on the
ground: MuJoCo relates stiffness and damping of a contact to the mass that it moves, so its loop bounced, and touched
the ground in 32 of 300 steps where ours is carried in all.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.benchmarks import motion
from tests.benchmarks.motion import Case, Floats, Loop
from tests.benchmarks.timing import cpu, least

STEPS = {  # s, by integrator and solver; the second integrator is of first order and recommended for contact
    ("RK4", "PGS"): (14e-3, 12.5e-3, 10e-3, 5e-3, 2e-3, 1e-3),
    ("RK4", "Newton"): (12.5e-3, 5e-3, 1e-3),
    ("implicitfast", "Newton"): (1e-3, 2.5e-4),
}
QUICK_STEPS = dict.fromkeys(STEPS, (1e-3,))
STIFF = "0.9999 0.9999 0.001"


def measure(case: str, quick: bool, repeats: int) -> list[dict[str, Any]]:
    """Runs of the case of rigid links without ground."""
    wanted = motion.CASES[case]
    if wanted.track != "rigid" or wanted.ground:
        return []
    stop = wanted.quick if quick else wanted.stop
    runs = []
    for method, steps in (QUICK_STEPS if quick else STEPS).items():
        for step in wanted.steps(steps):
            spent, (pins, _) = least(repeats, run, wanted, stop, step, *method)
            runs.append({"code": ", ".join(method), "step": step, "cpu": spent, "pins": pins.tolist()})
    return runs


def run(
    case: Case, stop: float, step: float, integrator: str, solver: str = "PGS"
) -> tuple[float, tuple[Floats, float]]:
    """CPU time, s; pins and energy, J, at ``stop``. Raises RuntimeError with MuJoCo's warning."""
    import mujoco

    loop = motion.loop(case)
    model = mujoco.MjModel.from_xml_string(xml(loop, step, integrator, solver))
    data = mujoco.MjData(model)
    if loop.closed:
        root = len(loop.pins) // 2
        c, s = np.cos(loop.angle[root]), np.sin(loop.angle[root])  # of the root: longitudinal and transverse slide
        vx, vz = loop.velocity[root]
        data.qvel[:3] = c * vx + s * vz, c * vz - s * vx, loop.rate[root]
        data.qvel[3:] = np.concatenate([np.diff(loop.rate[root:]), np.diff(loop.rate[root::-1])])
    warned: list[str] = []
    mujoco.set_mju_user_warning(warned.append)  # default: a file in the current folder
    spent, _ = cpu(lambda: mujoco.mj_step(model, data, nstep=round(stop / step)))
    mujoco.mj_kinematics(model, data)
    if warned:  # MuJoCo resets an unstable run
        raise RuntimeError(f"steps of {step:g} s: {warned[0]}")
    mujoco.mj_energyPos(model, data)
    mujoco.mj_energyVel(model, data)
    names = [f"first{k}" for k in range(len(loop.angle))] + [f"last{len(loop.angle) - 1}"] * (not loop.closed)
    pins = np.array(data.site_xpos[[model.site(name).id for name in names]][:, [0, 2]])
    return spent, (pins, float(data.energy.sum()))


def xml(loop: Loop, step: float, integrator: str, solver: str) -> str:
    """XML model; hinges turn from x towards z. Frames are at the pin towards the root, x along the link."""
    n, p, inertia = len(loop.angle), loop.pitch, " ".join([f"{loop.mass * loop.pitch**2 / 12.0:.17g}"] * 3)
    root = n // 2 if loop.closed else 0

    def body(k: int, before: int | None) -> str:
        """Link ``k`` without its end, on the link ``before``."""
        turn = 0.5 * (loop.angle[k] - (0.0 if before is None else loop.angle[before]))
        first, last = (-p, 0.0) if k < root else (0.0, p)  # pins of the link
        x, z = loop.pins[k] if before is None else (p if k > root else -p if k < root - 1 else 0.0, 0.0)
        moves = before is None and loop.closed
        slides = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>' if moves else ""
        return (
            f'<body pos="{x:.17g} 0 {z:.17g}" quat="{np.cos(turn):.17g} 0 {-np.sin(turn):.17g} 0">'
            f'<inertial pos="{0.5 * (first + last)} 0 0" mass="{loop.mass}" diaginertia="{inertia}"/>{slides}'
            f'<joint type="hinge" axis="0 -1 0"/><site name="first{k}" pos="{first} 0 0"/>'
            f'<site name="last{k}" pos="{last} 0 0"/>'
        )

    ahead = [body(k, k - 1) for k in range(root + 1, n)]
    behind = [body(k, k + 1) for k in range(root - 1, -1, -1)]
    branches = "".join("".join(branch) + "</body>" * len(branch) for branch in (ahead, behind))
    closure = f'<connect site1="last{n - 1}" site2="first0" solref="{2.0 * step} 1" solimp="{STIFF}"/>'
    return (
        f'<mujoco><option timestep="{step}" integrator="{integrator}" solver="{solver}" jacobian="dense"'
        f' gravity="0 0 {-loop.gravity}"/>'
        f'<compiler angle="radian" inertiafromgeom="false"/><worldbody>{body(root, None)}{branches}</body></worldbody>'
        f"<equality>{closure if loop.closed else ''}</equality></mujoco>"
    )
