"""Chain in Exudyn: planar ANCF cables or rigid bodies, joined by pins of two equations each.

Generalised-alpha of index 3 with our spectral radius and its own default, a sparse matrix with a reused pattern, the
build without range checks, one thread. Newton's relative tolerance is 1e-6: the default, 1e-8, takes a tenth longer or
more at the same error. Modified Newton keeps its matrix over several steps.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np

from tests.benchmarks import motion
from tests.benchmarks.motion import Floats, Loop
from tests.benchmarks.timing import cpu, least

RADII = (0.4, 0.9)  # spectral radius at infinite frequency: as ours, and its default
STEPS = (2e-3, 1e-3, 5e-4)  # s
QUICK_STEPS = (1e-3,)
NEWTON = {"modified Newton": True, "full Newton": False}

Assembled = tuple[Any, Callable[[], Floats]]  # system, and function of the pin positions (n, 2)


def measure(case: str, quick: bool, repeats: int) -> list[dict[str, Any]]:
    """Runs of a case without ground."""
    wanted = motion.CASES[case]
    if wanted.ground:
        return []
    stop = wanted.quick if quick else wanted.stop
    runs = []
    for step, newton, radius in product(QUICK_STEPS if quick else STEPS, NEWTON, RADII):
        spent, pins = least(repeats, run, case, stop, step, newton, radius)
        code = f"{newton}, spectral radius {radius:g}"
        runs.append({"code": code, "step": step, "cpu": spent, "pins": pins.tolist()})
    return runs


def run(case: str, stop: float, step: float, newton: str, radius: float) -> tuple[float, Floats]:
    """CPU time, s, and pins at ``stop``."""
    loop = motion.loop(motion.CASES[case])
    mbs, places = cables(loop) if case == "flexible" else rods(loop)
    chosen = settings(stop, step, NEWTON[newton], radius)
    spent, ended = cpu(lambda: mbs.SolveDynamic(chosen))
    if not ended:
        raise RuntimeError(f"Exudyn did not reach {stop:g} s in steps of {step:g} s")
    return spent, places()


def settings(stop: float, step: float, modified: bool, radius: float) -> Any:
    """Settings of a run without output files."""
    exudyn, _ = _imported()
    chosen = exudyn.SimulationSettings()
    time = chosen.timeIntegration
    time.endTime, time.numberOfSteps = stop, round(stop / step)
    time.generalizedAlpha.spectralRadius = radius
    time.newton.useModifiedNewton = modified
    time.newton.relativeTolerance = 1e-6
    time.verboseMode = time.verboseModeFile = 0
    chosen.linearSolver.solverType = exudyn.LinearSolverType.EigenSparse
    chosen.linearSolver.reuseAnalyzedPattern = True
    chosen.solution.file.write = chosen.solution.sensors.active = False
    chosen.parallel.numberOfThreads = 1
    return chosen


def cables(loop: Loop) -> Assembled:
    """Chain of ANCF cables, each on two nodes of its own with position and slope."""
    exudyn, item = _imported()

    mbs, n, links = exudyn.SystemContainer().AddSystem(), len(loop.pins), []
    for k in range(n):
        slope = np.array([np.cos(loop.angle[k]), np.sin(loop.angle[k])])
        turning = loop.rate[k] * np.array([-slope[1], slope[0]])
        nodes = [
            mbs.AddNode(
                item.NodePoint2DSlope1(
                    referenceCoordinates=[*loop.pins[pin], *slope], initialVelocities=[*loop.velocity[pin], *turning]
                )
            )
            for pin in (k, (k + 1) % n)
        ]
        mbs.AddObject(
            item.ObjectANCFCable2D(
                length=loop.pitch,
                massPerLength=loop.mass / loop.pitch,
                axialStiffness=loop.axial,
                bendingStiffness=loop.bending,
                axialDamping=loop.relaxation * loop.axial,
                bendingDamping=loop.relaxation * loop.bending,
                nodeNumbers=nodes,
            )
        )
        links.append(nodes)
    for k in range(n):
        ends = (links[k - 1][1], links[k][0])
        _pin(mbs, [mbs.AddMarker(item.MarkerNodePosition(nodeNumber=node)) for node in ends])
    mbs.Assemble()
    place = exudyn.OutputVariableType.Position
    return mbs, lambda: np.array([mbs.GetNodeOutput(first, place)[:2] for first, _ in links])


def rods(loop: Loop) -> Assembled:
    """Chain of rigid bodies, thin rods."""
    exudyn, item = _imported()

    mbs, n, half, bodies = exudyn.SystemContainer().AddSystem(), len(loop.angle), 0.5 * loop.pitch, []
    for k in range(n):
        end = (k + 1) % len(loop.pins)
        middle, velocity = (0.5 * (each[k] + each[end]) for each in (loop.pins, loop.velocity))
        node = mbs.AddNode(
            item.NodeRigidBody2D(
                referenceCoordinates=[*middle, loop.angle[k]], initialVelocities=[*velocity, loop.rate[k]]
            )
        )
        inertia = loop.mass * loop.pitch**2 / 12.0
        bodies.append(mbs.AddObject(item.ObjectRigidBody2D(mass=loop.mass, inertia=inertia, nodeNumber=node)))
        if loop.gravity:
            weight = mbs.AddMarker(item.MarkerBodyMass(bodyNumber=bodies[-1]))
            mbs.AddLoad(item.LoadMassProportional(markerNumber=weight, loadVector=[0.0, -loop.gravity, 0.0]))
    before = (bodies[-1], half)
    if not loop.closed:
        before = mbs.AddObject(item.ObjectGround(referencePosition=[*loop.pins[0], 0.0])), 0.0
    for k in range(n):
        ends = (before if k == 0 else (bodies[k - 1], half), (bodies[k], -half))
        markers = [item.MarkerBodyPosition(bodyNumber=body, localPosition=[x, 0.0, 0.0]) for body, x in ends]
        _pin(mbs, [mbs.AddMarker(marker) for marker in markers])
    mbs.Assemble()
    place = exudyn.OutputVariableType.Position
    places = [(body, -half) for body in bodies] + [(bodies[-1], half)] * (not loop.closed)
    return mbs, lambda: np.array([mbs.GetObjectOutputBody(body, place, [x, 0.0, 0.0])[:2] for body, x in places])


def _pin(mbs: Any, markers: list[Any]) -> None:
    mbs.AddObject(_imported()[1].ObjectJointRevolute2D(markerNumbers=markers))


def _imported() -> tuple[Any, Any]:
    """Import Exudyn; return it and its items."""
    sys.exudynFast = True  # type: ignore[attr-defined]  # without range checks; read when it is first imported
    warnings.simplefilter("ignore", DeprecationWarning)
    import exudyn
    import exudyn.itemInterface

    return exudyn, exudyn.itemInterface
