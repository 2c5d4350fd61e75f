"""What is drawn of a scene, checked: a log of another version may hold more, or other things."""

from __future__ import annotations

from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, Field, ValidationError

from fmus.vehicle import BadInput, sentence
from orchestrator.results.run_data import RunData

Number = Annotated[float, Field(ge=-1e6, le=1e6)]
Size = Annotated[float, Field(gt=0, le=1e6)]
Place = tuple[Number, Number, Number]


class Start(BaseModel):
    """Where a vehicle stands at the start, m, rad."""

    position: Place
    heading: Number


class Model(BaseModel):
    """The track model."""

    model: str


class Chain(BaseModel):
    """Links, m."""

    pitch: Size
    face: Annotated[float, Field(ge=0, le=1e6)]


class WideChain(Chain):
    """Links with their width, m."""

    width: Size


class Sprocket(BaseModel):
    """Sprocket, m."""

    teeth: Annotated[int, Field(ge=1, le=1000)]
    outer_radius: Size
    pin_radius: Size


class RoadWheel(BaseModel):
    """Road wheels, m; height of their axles over the origin of the vehicle."""

    radius: Size
    z: Number


class WideRoadWheel(RoadWheel):
    """Road wheels with their width, m."""

    width: Size


class Idler(BaseModel):
    """Idler, m."""

    radius: Size


class WideIdler(Idler):
    """Idler with its width, m."""

    width: Size


class Hull(BaseModel):
    """Centre of mass and corners of the hull in the vehicle frame, m."""

    centre: Place
    hull: Annotated[list[Place], Field(max_length=1000)] = []


class Vehicle(BaseModel):
    """What a side view needs of the vehicle table."""

    track: Chain
    sprocket: Sprocket
    road_wheel: RoadWheel
    idler: Idler


class SolidVehicle(Vehicle):
    """What bodies in space need."""

    track: WideChain
    road_wheel: WideRoadWheel
    idler: WideIdler
    chassis: Hull | None = None


class Bump(BaseModel):
    """A bump across the way, m, rad."""

    rise: Size
    slope: Annotated[float, Field(gt=0, lt=1.5707)]
    radius: Annotated[float, Field(ge=0, le=1e6)]
    length: Annotated[float, Field(ge=0, le=1e6)]
    start: Number


class GroundTable(BaseModel):
    """What lies on the level."""

    bump: Bump | None = None


class Scene(BaseModel):
    """What a side view needs of a scene."""

    title: str
    assembly: str
    track: Model
    start: Start
    vehicle: Vehicle
    ground: GroundTable | None = None


class SolidScene(Scene):
    """What bodies in space need."""

    vehicle: SolidVehicle


Kind = TypeVar("Kind", bound=Scene)


def checked(run: RunData, kind: type[Kind]) -> dict[str, Any]:
    """What is drawn of the scene of a run; raises BadInput for one that is missing or of another kind."""
    if not run.scene:
        raise BadInput(f"{run.log.path} does not say of which scene it is: there is nothing to draw it by")
    try:
        return kind.model_validate(run.scene).model_dump()
    except ValidationError as error:
        raise BadInput(sentence(error, f"{run.log.path}: scene.json")) from None
