"""Loading of a scene's components: place it, build its FMUs, compile what is missing, initialise."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from contextlib import ExitStack

from fmus.precompile import start_compilation
from fmus.track.choices import TRACKS
from orchestrator.cosim.component import Component
from orchestrator.cosim.graph import System
from orchestrator.cosim.initialisation import load_components
from orchestrator.cosim.processes.supervisor import ProcessPool
from orchestrator.files.messages import PROGRESS
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.kinds import Scene, VehicleScene
from orchestrator.scene.parts import Assembly, Part
from orchestrator.scene.placing import placed
from orchestrator.scene.system_scene import SystemScene

OTHER_KERNELS = "cables have turning axes, whose kernels are others and compile for minutes the first time"
LOW_PRIORITY = 10  # niceness of compiling processes other than the longest one


def load_scene(
    scene: SystemScene,
    assembly: Assembly,
    stack: ExitStack,
    native: bool = False,
    pool: ProcessPool | None = None,
) -> tuple[SystemScene, System, dict[str, Component]]:
    """Place an assembled scene, build its graph, load its components; raises BadInput, BuildFailed, ComponentFailed.

    ``pool``: where FMUs of the user get their processes; they are closed with the stack.
    """
    if given := [part.name for part in assembly.parts if part.fmu is not None]:
        PROGRESS.info(f"{scene.name}: FMUs of yours run as {', '.join(given)}: an FMU runs code with your rights")
    if isinstance(scene, VehicleScene) and scene.track.axes == "free" and scene.leaves_plane:
        PROGRESS.info(f"{scene.name}: {scene.leaves_plane}: {OTHER_KERNELS}")
    PROGRESS.info(f"{scene.name}: components are built and initialised")
    processes: list[subprocess.Popen[str]] = []
    try:
        if isinstance(scene, Scene) and not scene.placed:
            processes = _compile_in_processes(assembly.parts, native)
            PROGRESS.debug("the places of idlers and hull are solved from static equilibrium")
            scene = placed(scene)
            assembly = assemble(scene)
        PROGRESS.debug(f"FMUs are built or found: {len(assembly.parts)}")
        graph = system(assembly, native)
        PROGRESS.debug("kernels are compiled in processes of their own")
        for process in processes:
            process.wait()
    except BaseException:  # bad input, or a signal, which the processes need not have received
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait()
        raise
    PROGRESS.debug("components are initialised")
    return scene, graph, load_components(graph, scene.run.times, stack, pool)


def _compile_in_processes(parts: Sequence[Part], native: bool) -> list[subprocess.Popen[str]]:
    """Start processes that compile kernels while the search for the idler position compiles the start of cables."""
    # The first part of each kind; its start does not depend on inputs.
    kinds = {part.kind: (part.kind, part.config, part.parameters) for part in reversed(parts) if part.fmu is None}
    rigid, cables = (kinds.pop(TRACKS[name].fmu, None) for name in ("rigid", "flexible"))
    tracks, others = [rigid] if rigid else [], [*kinds.values()]
    # A step of cables last, when the start has compiled what they share; alone, both would compile it at once.
    others += [cables] if cables and others else []
    # Rigid links take longest: on two cores the others get their share when the search is done.
    processes = [start_compilation(tracks, 0, native), start_compilation(others, LOW_PRIORITY if tracks else 0, native)]
    return [process for process in processes if process is not None]
