"""Validated part of a logged scene that drawings need; logs of other versions may hold other keys."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, Field, ValidationError

from fmus.vehicle import BadInput, first_error
from orchestrator.results.run_data import RunData

Number = Annotated[float, Field(ge=-1e6, le=1e6)]
Size = Annotated[float, Field(gt=0, le=1e6)]
SizeOrNone = Annotated[float, Field(ge=0, le=1e6)]
Place = tuple[Number, Number, Number]


class DrawnStart(BaseModel):
    """Place and heading of a vehicle at the start, m, rad."""

    position: Place
    heading: Number


class DrawnModel(BaseModel):
    """Track model."""

    model: str


class DrawnLinks(BaseModel):
    """Dimensions of links, m."""

    pitch: Size
    width: Size
    face: SizeOrNone


class DrawnSprocket(BaseModel):
    """Dimensions of the sprocket, m."""

    teeth: Annotated[int, Field(ge=1, le=1000)]
    outer_radius: Size
    pin_radius: Size


class DrawnRim(BaseModel):
    """Dimensions of smooth wheels, m."""

    radius: Size
    width: Size


class DrawnRoadWheel(DrawnRim):
    """Dimensions of road wheels, m, and height of their axles over the origin of the vehicle."""

    z: Number


class DrawnGuide(BaseModel):
    """Lateral play of guide horns, m."""

    clearance: SizeOrNone


class DrawnHull(BaseModel):
    """Centre of mass and corners of the hull in the vehicle frame, m."""

    centre: Place
    hull: Annotated[list[Place], Field(max_length=1000)] = []


class DrawnVehicle(BaseModel):
    """Vehicle table."""

    track: DrawnLinks
    sprocket: DrawnSprocket
    road_wheel: DrawnRoadWheel
    idler: DrawnRim
    return_roller: DrawnRim | None = None
    chassis: DrawnHull | None = None
    guide: DrawnGuide | None = None


class DrawnBump(BaseModel):
    """Bump across the initial heading, m, rad."""

    rise: Size
    slope: Annotated[float, Field(gt=0, lt=1.5707)]
    radius: SizeOrNone
    length: SizeOrNone
    start: Number


class DrawnGround(BaseModel, extra="allow"):
    """Ground table; other keys make it a terrain."""

    bump: DrawnBump | None = None


class DrawnChain(BaseModel):
    """Chain without wheels."""

    ends: str | None = None


class DrawnScene(BaseModel):
    """Scene."""

    title: str
    assembly: str
    track: DrawnModel
    start: DrawnStart
    vehicle: DrawnVehicle
    ground: DrawnGround | None = None
    chain: DrawnChain | None = None


def drawn_scene(run: RunData) -> dict[str, Any]:
    """Return the part of a run's scene that is drawn; raises BadInput if it is missing or of another type."""
    if not run.scene:
        raise BadInput(f"{run.log.path} does not say of which scene it is: there is nothing to draw it by")
    try:
        return DrawnScene.model_validate(run.scene).model_dump()
    except ValidationError as error:
        raise BadInput(first_error(error, f"{run.log.path}: scene.json")) from None
