"""Table ``[expect]`` and the tables of assemblies: chain, bench, rig."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from fmus.vehicle import BadInput, Distance, Force, FrozenTable, In, ratio, value_text
from orchestrator.results import measures
from orchestrator.scene.gallery import hint
from orchestrator.scene.values import Time, TrackName

MeasureName = Annotated[str, Field(json_schema_extra={"enum": sorted(measures.NAMES)})]
Checked = Field(allow_inf_nan=False, json_schema_extra={"unit": "that of the signal or measure"})


class Check(FrozenTable):
    """Expected value of a signal reduced over a window, or of a named measure."""

    signal: str | None = None
    """signal, instance.variable, that is checked"""
    reduce: Literal["mean", "min", "max", "last", "drop", "ripple", "rms"] = "mean"
    """number that is made of the signal's records in the window, not smoothed; drop: first less last, ripple: range
    over mean; not beside measure"""
    measure: MeasureName | None = None
    """measure that is checked, instead of a signal"""
    of: str = ""
    """side ('left', 'right') or component of a measure"""
    start: Time = Field(0.0, alias="from")
    """begin of the window"""
    end: Time | None = Field(None, alias="to")
    """end of the window; without it the end of the run"""
    expected: Annotated[float, Checked]
    """expected value"""
    tolerance: Annotated[float, Field(ge=0), Checked]
    """largest difference from the expected value"""
    relative: bool = False
    """the tolerance is a fraction of the expected value"""
    track: TrackName | None = None
    """the check is for this track model only"""

    @model_serializer(mode="wrap")
    def _serialise(self, serialise: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {key: value for key, value in serialise(self).items() if key != "reduce" or self.measure is None}

    @model_validator(mode="after")
    def _check_source(self) -> Check:
        if (self.signal is None) == (self.measure is None):
            raise ValueError("needs either signal or measure")
        if self.measure is not None and self.measure not in measures.NAMES:
            raise ValueError(f"no measure '{self.measure}': {hint(self.measure, sorted(measures.NAMES), 'one of')}")
        return self


def refuse_reduced_measures(checks: object, where: str) -> None:
    """Raise BadInput if a check of a raw table reduces a measure; a log of an earlier version has such checks."""
    for name, check in checks.items() if isinstance(checks, Mapping) else ():
        if isinstance(check, Mapping) and check.get("measure") is not None and "reduce" in check:
            key = f"{where}: expect.{name}.reduce = {value_text(check['reduce'])}"
            raise BadInput(f"{key}: is for a signal; measure = {value_text(check['measure'])} is a number already")


class ChainTable(FrozenTable):
    """Open chain between two pins at equal height, fixed at the first pin only, or lying; or a free loop."""

    links: Annotated[int, Field(ge=2, le=4096)]
    """number of links"""
    ends: Literal["pinned", "held", "lying", "loop"] = "pinned"
    """chain between two pins, held at its first pin only, free on the ground, or closed and free without gravity"""
    span: Annotated[float, ratio(gt=0, lt=1)] | None = None
    """of a pinned chain, which needs it: distance of the pins over the length of the chain"""
    pull: Force = 0.0
    """of a lying chain: force ahead, half on each of its ends"""
    spin: Annotated[float, In("rad/s")] = 0.0
    """of a loop: initial speed about y"""
    ovalling: Annotated[float, In("rad/s")] = 0.0
    """of a loop: additional speed of its links, times cos(2 angle)"""

    @model_validator(mode="after")
    def _check_ends(self) -> ChainTable:
        if (self.span is None) == (self.ends == "pinned"):
            raise ValueError(f"ends = '{self.ends}' {'needs' if self.span is None else 'has no'} span")
        if self.pull and self.ends != "lying":
            raise ValueError(f"ends = '{self.ends}' has no pull")
        for key in ("spin", "ovalling"):
            if getattr(self, key) and self.ends != "loop":
                raise ValueError(f"ends = '{self.ends}' has no {key}")
        if self.ends == "loop" and self.links < 3:
            raise ValueError(f"a loop needs 3 links, not {self.links}")
        return self


class BenchTable(FrozenTable):
    """Open chain over one sprocket, its ends pulled by constant forces."""

    links: Annotated[int, Field(ge=8, le=4096)]
    """number of links"""
    upper: Force
    """pull at the end of the upper (incoming) span, towards -x"""
    lower: Force
    """pull at the end of the lower (outgoing) span, towards -x"""
    transverse_damping: Annotated[float, In("N s/m", ge=0)] = 0.0
    """damping of each pin's motion across the chain"""


class RigTable(FrozenTable):
    """Closed chain round a sprocket and a smooth idler with fixed axles."""

    links: Annotated[int, Field(ge=8, le=4096)]
    """number of links"""
    axle_distance: Distance
    """distance of the axles as drawn; the idler is moved until the chain carries the tension"""
    tension: Force
    """mean static tension of the chain"""
