"""Loop in MuJoCo: a tree of hinges from a planar free body, closed by a soft constraint.

``connect`` closes it over two steps (``solref``), at 0.9999 of full stiffness (``solimp``): a softer one is less
accurate, not faster. The Jacobian is dense, which takes 0.8 of the time of a sparse one. There is no case on the
ground: MuJoCo relates stiffness and damping of a contact to the mass that it moves, so its loop bounced, and touched
the ground in 32 of 300 steps where ours is carried in all.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.benchmarks import motion
from tests.benchmarks.motion import Case, Floats, Loop
from tests.benchmarks.timing import cpu, least

STEPS = {  # s, by integrator; the second is of first order and recommended for contact
    "RK4": (12.5e-3, 10e-3, 5e-3, 1e-3),
    "implicitfast": (1e-3, 2.5e-4),
}
QUICK_STEPS = {"RK4": (1e-3,), "implicitfast": (1e-3,)}
STIFF = "0.9999 0.9999 0.001"


def measure(case: str, quick: bool, repeats: int) -> list[dict[str, Any]]:
    """Runs of the case of rigid links without ground."""
    wanted = motion.CASES[case]
    if wanted.track != "rigid" or wanted.ground:
        return []
    stop = wanted.quick if quick else wanted.stop
    runs = []
    for integrator, steps in (QUICK_STEPS if quick else STEPS).items():
        for step in steps:
            spent, (pins, _) = least(repeats, run, wanted, stop, step, integrator)
            runs.append({"code": integrator, "step": step, "cpu": spent, "pins": pins.tolist()})
    return runs


def run(case: Case, stop: float, step: float, integrator: str) -> tuple[float, tuple[Floats, float]]:
    """CPU time, s; pins and energy, J, at ``stop``. Raises RuntimeError with MuJoCo's warning."""
    import mujoco

    loop = motion.loop(case)
    model = mujoco.MjModel.from_xml_string(xml(loop, step, integrator))
    data = mujoco.MjData(model)
    c, s = np.cos(loop.angle[0]), np.sin(loop.angle[0])  # of the first link: longitudinal and transverse slide
    vx, vz = loop.velocity[0]
    data.qvel[:2] = c * vx + s * vz, c * vz - s * vx
    data.qvel[2:] = np.diff(loop.rate, prepend=0.0)
    warned: list[str] = []
    mujoco.set_mju_user_warning(warned.append)  # default: a file in the current folder
    spent, _ = cpu(lambda: mujoco.mj_step(model, data, nstep=round(stop / step)))
    mujoco.mj_kinematics(model, data)
    if warned:  # MuJoCo resets an unstable run
        raise RuntimeError(f"steps of {step:g} s: {warned[0]}")
    mujoco.mj_energyPos(model, data)
    mujoco.mj_energyVel(model, data)
    first = [model.site(f"first{k}").id for k in range(len(loop.pins))]
    return spent, (np.array(data.site_xpos[first][:, [0, 2]]), float(data.energy.sum()))


def xml(loop: Loop, step: float, integrator: str) -> str:
    """XML model; hinges turn from x towards z."""
    n, p, inertia = len(loop.pins), loop.pitch, loop.mass * loop.pitch**2 / 12.0
    lines = [
        f'<mujoco><option timestep="{step}" integrator="{integrator}" jacobian="dense" gravity="0 0 0"/>',
        '<compiler angle="radian" inertiafromgeom="false"/><worldbody>',
    ]
    for k in range(n):
        turn = 0.5 * (loop.angle[k] - (loop.angle[k - 1] if k else 0.0))
        x, z = (p, 0.0) if k else loop.pins[0]
        lines.append(
            f'<body pos="{x:.17g} 0 {z:.17g}" quat="{np.cos(turn):.17g} 0 {-np.sin(turn):.17g} 0">'
            f'<inertial pos="{0.5 * p} 0 0" mass="{loop.mass}" diaginertia="{" ".join([f"{inertia:.17g}"] * 3)}"/>'
        )
        if not k:
            lines.append('<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>')
        lines.append(f'<joint type="hinge" axis="0 -1 0"/><site name="first{k}"/><site name="last{k}" pos="{p} 0 0"/>')
    closure = f'site1="last{n - 1}" site2="first0" solref="{2.0 * step} 1" solimp="{STIFF}"'
    lines.append("</body>" * n + f"</worldbody><equality><connect {closure}/></equality></mujoco>")
    return "\n".join(lines)
