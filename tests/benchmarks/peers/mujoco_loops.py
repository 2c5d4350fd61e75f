"""Loop in MuJoCo: a tree of hinges from a planar free body, closed by a soft constraint.

``connect`` closes it over two steps (``solref``), at 0.9999 of full stiffness (``solimp``): a softer one is less
accurate, not faster. On the ground contact points and friction are ours, with points as spheres of 1 mm. MuJoCo
relates stiffness and damping of a contact to the mass that it moves; it gets those of the soil over the mass of one
link. This is another law, so the distance from our reference is no integration error.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.benchmarks import motion
from tests.benchmarks.motion import GRAVITY, Case, Floats, Loop
from tests.benchmarks.timing import cpu, least

STEPS = {  # s, by integrator; the second is of first order and recommended for contact
    "RK4": (10e-3, 5e-3, 1e-3),
    "implicitfast": (1e-3, 2.5e-4),
}
GROUND_STEPS = {"RK4": (1e-3, 2.5e-4), "implicitfast": (1e-3, 2.5e-4)}
QUICK_STEPS = {"RK4": (1e-3,), "implicitfast": (1e-3,)}
STIFF = "0.9999 0.9999 0.001"
POINT = 1e-3  # m, radius of a contact point
GAUSS = 1.0 / np.sqrt(12.0)  # of the pitch: distance of Gauss points from the middle of a link


def measure(case: str, quick: bool, repeats: int) -> list[dict[str, Any]]:
    """Runs of a case of rigid links."""
    wanted = motion.CASES[case]
    if wanted.track != "rigid":
        return []
    stop = wanted.quick if quick else wanted.stop
    runs = []
    for integrator, steps in (QUICK_STEPS if quick else GROUND_STEPS if wanted.ground else STEPS).items():
        for step in steps:
            spent, (pins, _) = least(repeats, run, wanted, stop, step, integrator)
            runs.append({"code": integrator, "step": step, "cpu": spent, "pins": pins.tolist()})
    return runs


def run(case: Case, stop: float, step: float, integrator: str) -> tuple[float, tuple[Floats, float]]:
    """CPU time, s; pins and energy, J, at ``stop``. Raises RuntimeError with MuJoCo's warning."""
    import mujoco

    loop = motion.loop(case)
    model = mujoco.MjModel.from_xml_string(xml(loop, case.ground, step, integrator))
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


def xml(loop: Loop, ground: bool, step: float, integrator: str) -> str:
    """XML model; hinges turn from x towards z."""
    n, p, inertia = len(loop.pins), loop.pitch, loop.mass * loop.pitch**2 / 12.0
    soil = loop.soil
    touch = (
        f'condim="3" friction="{soil["friction"]} 0 0" solimp="{STIFF}"'
        f' solref="{-soil["stiffness"] / loop.mass} {-soil["damping"] / loop.mass}"'
    )
    lines = [
        f'<mujoco><option timestep="{step}" integrator="{integrator}" cone="elliptic"'
        f' gravity="0 0 {-GRAVITY if ground else 0.0}"/>',
        '<compiler angle="radian" inertiafromgeom="false"/><worldbody>',
    ]
    if ground:
        lines.append(f'<geom type="plane" size="50 50 1" pos="0 0 {loop.level:.17g}" {touch}/>')
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
        if ground:
            for side in (-GAUSS, GAUSS):
                place = f"{(0.5 + side) * p:.17g} 0 {loop.face - POINT:.17g}"
                lines.append(f'<geom type="sphere" size="{POINT}" pos="{place}" conaffinity="0" {touch}/>')
    closure = f'site1="last{n - 1}" site2="first0" solref="{2.0 * step} 1" solimp="{STIFF}"'
    lines.append("</body>" * n + f"</worldbody><equality><connect {closure}/></equality></mujoco>")
    return "\n".join(lines)
