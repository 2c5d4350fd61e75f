"""Soils by name, and the table of a soil in a scene; errors name the key and the value."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import model_validator

from fmus.vehicles.tables import Distance, FrozenTable, In, ratio

if TYPE_CHECKING:
    from fmus.physics.contact.soil.parameters import Soil

Slope = Annotated[float, In("Pa/m", ge=0)]


class SoilTable(FrozenTable):
    """Soil that gives way: Bekker's pressure, Wong's repeated loading, Janosi and Hanamoto's shear."""

    name: str | None = None
    """soil of fmus/ground/soils.toml whose numbers count where a key is not given"""
    n: Annotated[float, ratio(gt=0, le=5)]
    """exponent of the sinkage"""
    kc: Annotated[float, ratio(ge=0)]
    """Bekker's cohesive modulus, N/m^(n+1)"""
    kphi: Annotated[float, ratio(ge=0)]
    """Bekker's frictional modulus, N/m^(n+2)"""
    cohesion: Annotated[float, In("Pa", ge=0)]
    """shear strength without pressure"""
    friction_angle: Annotated[float, In("rad", ge=0, lt=1.5)]
    """angle of internal friction"""
    shear_deformation_modulus: Distance
    """way over which shear grows to 63 % of the strength"""
    k0: Slope = 0.0
    """slope of unloading from the surface"""
    Au: Annotated[float, In("Pa/m^2", ge=0)] = 0.0
    """growth of the slope of unloading with the deepest sinkage"""
    rebound: Annotated[float, ratio(gt=0, le=1)] | None = None
    """part of the sinkage that springs back, in place of k0 and Au"""
    elastic: Slope = 0.0
    """largest slope of the first loading, of soils with n < 1"""
    damping: Annotated[float, In("Pa s/m", ge=0)] = 0.0
    """normal damping"""
    width: Distance | None = None
    """width b of the pressed area in kc / b + kphi; that of the track by default"""

    @model_validator(mode="before")
    @classmethod
    def _named(cls, data: Any) -> Any:
        """Fill in the numbers of a named soil; a rebound replaces its slope of unloading."""
        if not isinstance(data, Mapping) or not isinstance(data.get("name"), str):
            return data
        if data["name"] not in named():
            near = get_close_matches(data["name"], named(), 1)
            known = f"did you mean '{near[0]}'?" if near else f"there are {', '.join(named())}"
            raise ValueError(f"no soil '{data['name']}': {known}")
        numbers = {key: value for key, value in named()[data["name"]].items() if key != "title"}
        if data.get("rebound") is not None:
            numbers = {key: value for key, value in numbers.items() if key not in ("k0", "Au")}
        return {**numbers, **data}

    @model_validator(mode="after")
    def _consistent(self) -> SoilTable:
        """Refuse numbers that exclude each other."""
        from fmus.physics.contact.soil.parameters import soil

        soil(self.model_dump(), 1.0, 1.0)
        return self


def law_of(name: str, pitch: float, track_width: float) -> Soil:
    """Law of a packaged soil under links of ``pitch`` and ``track_width``, m."""
    from fmus.physics.contact.soil.parameters import soil

    return soil(SoilTable(name=name).model_dump(), pitch, track_width)  # type: ignore[call-arg]


def work_of_pressure(soil: Soil, pressure: float) -> float:
    """Work of the first loading of a soil up to a ``pressure``, Pa, on an area of 1 m2, J."""
    from fmus.physics.contact.soil.pressure import first_work
    from fmus.physics.elementary import power

    return float(first_work(soil, power(pressure / soil.stiffness, 1.0 / soil.n)))


@cache
def named() -> dict[str, dict[str, Any]]:
    """Tables of the packaged soils, by name."""
    return tomllib.loads((resources.files("fmus.ground") / "soils.toml").read_text(encoding="utf-8"))
