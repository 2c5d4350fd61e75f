"""Table ``[expect]`` and the tables of assemblies: chain, bench, rig."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from fmus.vehicle import Distance, Force, FrozenTable, In
from orchestrator.results import measures
from orchestrator.scene.gallery import hint
from orchestrator.scene.values import Time, TrackName


class Check(FrozenTable):
    """Expected value of a signal reduced over a window, or of a named measure."""

    signal: str | None = None  # instance.variable
    reduce: Literal["mean", "min", "max", "last", "drop", "ripple", "rms"] = "mean"
    measure: str | None = None
    of: str = ""  # side ("left", "right") or component of a measure
    start: Time = Field(0.0, alias="from")
    end: Time | None = Field(None, alias="to")  # default: the end of the run
    expected: Annotated[float, Field(allow_inf_nan=False)]
    tolerance: Annotated[float, Field(ge=0, allow_inf_nan=False)]
    relative: bool = False  # the tolerance is a fraction of the expected value
    track: TrackName | None = None  # only for this track model

    @model_validator(mode="after")
    def _check_source(self) -> Check:
        if (self.signal is None) == (self.measure is None):
            raise ValueError("needs either signal or measure")
        if self.measure is not None and self.measure not in measures.NAMES:
            raise ValueError(f"no measure '{self.measure}': {hint(self.measure, sorted(measures.NAMES), 'one of')}")
        return self


class ChainTable(FrozenTable):
    """Open chain between two pins at equal height, or fixed at the first pin only, or a free loop."""

    links: Annotated[int, Field(ge=2, le=4096)]
    ends: Literal["pinned", "held", "loop"] = "pinned"
    span: Annotated[float, Field(gt=0, lt=1)] | None = None  # pinned: distance of the pins over the length of the chain
    spin: Annotated[float, In("rad/s")] = 0.0  # loop without gravity: initial speed about y
    ovalling: Annotated[float, In("rad/s")] = 0.0  # additional speed of its links, times cos(2 angle)

    @model_validator(mode="after")
    def _check_ends(self) -> ChainTable:
        if (self.span is None) == (self.ends == "pinned"):
            raise ValueError(f"ends = '{self.ends}' {'needs' if self.span is None else 'has no'} span")
        for key in ("spin", "ovalling"):
            if getattr(self, key) and self.ends != "loop":
                raise ValueError(f"ends = '{self.ends}' has no {key}")
        if self.ends == "loop" and self.links < 3:
            raise ValueError(f"a loop needs 3 links, not {self.links}")
        return self


class BenchTable(FrozenTable):
    """Open chain over one sprocket, its ends pulled by constant forces."""

    links: Annotated[int, Field(ge=8, le=4096)]
    upper: Force  # pull at the end of the upper (incoming) span, towards -x
    lower: Force  # pull at the end of the lower (outgoing) span, towards -x
    transverse_damping: Annotated[float, In("N s/m", ge=0)] = 0.0


class RigTable(FrozenTable):
    """Closed chain round a sprocket and a smooth idler with fixed axles."""

    links: Annotated[int, Field(ge=8, le=4096)]
    axle_distance: Distance  # as drawn; the idler is moved until the chain carries the tension
    tension: Force
