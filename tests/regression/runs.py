"""Short runs that together use all kernels: every scene, kind of link, integrator and coupling."""

from __future__ import annotations

from typing import NamedTuple

from fmus.track.choices import TRACKS
from orchestrator.cosim.coupling import COUPLINGS
from orchestrator.scene.scene import scene_names


class Run(NamedTuple):
    """Arguments of ``cotrack run``."""

    scene: str
    track: str = "flexible"
    settings: tuple[str, ...] = ()
    stop: float = 0.1  # s
    native: bool = False

    def __str__(self) -> str:
        return ", ".join((self.scene, self.track, *self.settings, *(["native"] if self.native else [])))

    def arguments(self) -> list[str]:
        """Arguments after ``cotrack run``."""
        settings = (part for one in (*self.settings, "expect={}", "run.links=1") for part in ("--set", one))
        native = ["--native"] if self.native else []
        return [self.scene, "--track", self.track, *settings, "--stop", f"{self.stop}", "--no-estimate", *native]


MOVING = ("drive.ramp_start=0", "drive.ramp_time=0.1", "start.height=-0.01")  # drops onto its suspension and drives off
SWAYING = ("track.start=displaced",)
OVAL = ("chain.links=16", "chain.ovalling=1")
RUNS = (
    *(Run(scene, track) for scene in scene_names() for track in TRACKS),
    *(Run("straight", track, MOVING, native=native) for track in TRACKS for native in (False, True)),
    Run("straight", "flexible", (*MOVING, "track.element=beam"), 0.05),
    Run("straight", "flexible", (*MOVING, "symmetric=true", "planar=true")),
    Run("straight", "rigid", (*MOVING, "track.start=polygon")),
    Run("turn", "flexible", ("drive.ramp_start=0", "drive.ramp_time=0.05")),
    Run("settle", "flexible", ("track.elasticity=general",), 0.02),
    Run("hard_stop", "flexible", ("run.variable.estimate=power", "run.variable.tolerance=1e-3")),
    *(Run("settle", "rigid", (f"run.coupling={scheme}",)) for scheme in COUPLINGS if scheme != "tracks_first"),
    *(Run("hanging_chain", "flexible", (*SWAYING, f"track.elasticity={elasticity}"))
      for elasticity in ("small_deformation", "general", "engineering")),
    Run("hanging_chain", "flexible", (*SWAYING, "track.element=beam")),
    Run("straight", "flexible", (*MOVING, "track.axes=free"), 0.05),
    Run("hanging_chain", "flexible", (*SWAYING, "track.joints=constrained")),
    Run("hanging_chain", "flexible", (*SWAYING, "track.integrator=hht")),
    *(Run("hanging_chain", "flexible", (*SWAYING, "chain.links=8", f"track.coordinates={coordinates}",
                                        f"track.integrator={integrator}"), 0.01)
      for coordinates in ("nodal", "cholesky") for integrator in ("runge_kutta", "adams")),
    Run("hanging_chain", "rigid", SWAYING),
    *(Run("hanging_chain", "rigid", (*SWAYING, f"track.formulation={formulation}", "track.integrator=runge_kutta"))
      for formulation in ("augmented", "recursive")),
    Run("hanging_chain", "rigid", (*SWAYING, "track.formulation=recursive", "track.integrator=dormand_prince")),
    *(Run("spinning_loop", track, (*OVAL, f"track.closure={closure}"))
      for track in TRACKS for closure in ("pin", "spring")),
)  # fmt: skip
