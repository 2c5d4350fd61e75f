"""Table ``[track]``: link model and numerical method."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, model_validator

from fmus.interface.ports import TOLERANCES
from fmus.track.choices import BY_ERROR, ELEMENTS, TRACKS, TrackKind, models_with
from fmus.track.link_outputs import GROUPS, STANDARD
from fmus.vehicles.tables import In, When, ratio
from orchestrator.scene.values import Duration, ParameterTable, Sets, TrackName

Tolerance = Annotated[float, ratio(ge=TOLERANCES.least, le=TOLERANCES.most)]
AbsoluteTolerance = Annotated[float, In("m, rad, m/s, rad/s", plain=True, ge=TOLERANCES.least, le=TOLERANCES.most)]
Elasticity = Literal["small_deformation", "general", "engineering"]


def _output_groups(value: object) -> object:
    """Groups of link outputs: all, the standard ones (true), none (false), or a list of names."""
    if value == "all":
        return tuple(GROUPS)
    if isinstance(value, bool):
        return STANDARD if value else ()
    if isinstance(value, list | tuple) and all(isinstance(name, str) and name in GROUPS for name in value):
        return tuple(name for name in GROUPS if name in value)
    raise ValueError(f"must be true, false, 'all' or a list of {', '.join(GROUPS)}")


if TYPE_CHECKING:
    ElementName = str
    GroupName = str
else:
    ElementName = Literal[tuple(name for name, element in ELEMENTS.items() if len(element.axes) == 3)]  # planar: a key
    GroupName = Literal[tuple(GROUPS)]


LinkOutputs = Annotated[tuple[str, ...], BeforeValidator(_output_groups, bool | Literal["all"] | tuple[GroupName, ...])]


METHOD = Sets(method=True)
BY_SPRING = When(closure=("spring",))


class TrackModelTable(ParameterTable):
    """Track model and its parameters; the model's defaults apply to the rest.

    A key is allowed if the model's FMU has its parameter (``models_with``).
    """

    model: TrackName
    """track model: the kind of links"""
    element: Annotated[ElementName | None, Sets()] = None
    """finite element of flexible links"""
    elasticity: Annotated[Elasticity | None, Sets()] = None
    """strain energy of cables"""
    axes: Annotated[Literal["fixed", "free"] | None, Sets(default=False)] = None
    """fixed axes keep cables in the plane of their track, free ones turn with it; a vehicle that turns has free ones"""
    formulation: Annotated[Literal["augmented", "recursive"] | None, METHOD] = None
    """coordinates of rigid links: of bodies with constraints, or of joints"""
    joints: Annotated[Literal["eliminated", "constrained"] | None, METHOD] = None
    """pins of cables by elimination, or as constraints with multipliers"""
    coordinates: Annotated[Literal["nodal", "cholesky"] | None, METHOD] = None
    """coordinates of cables for an explicit integrator"""
    closure: Annotated[Literal["pin", "spring"] | None, Sets()] = None
    """how the last link of a loop joins the first"""
    closure_stiffness: Annotated[Annotated[float, In("N/m", gt=0)] | None, Sets("closure.stiffness"), BY_SPRING] = None
    """stiffness of a closing spring"""
    closure_damping: Annotated[Annotated[float, In("N s/m", ge=0)] | None, Sets("closure.damping"), BY_SPRING] = None
    """damping of a closing spring"""
    integrator: Annotated[
        Literal["generalized_alpha", "hht", "runge_kutta", "adams", "dormand_prince"] | None, METHOD
    ] = None
    """time integration of the links"""
    step: Annotated[Duration | None, METHOD] = None
    """largest internal step"""
    spectral_radius: Annotated[Annotated[float, ratio(ge=0, le=1)] | None, METHOD] = None
    """spectral radius of an implicit integrator at high frequencies; of hht at least 0.5, its default"""
    rtol: Annotated[Tolerance | None, Sets("adams.rtol", method=True), When(integrator=BY_ERROR)] = None
    """relative error of an internal step"""
    atol: Annotated[AbsoluteTolerance | None, Sets("adams.atol", method=True), When(integrator=BY_ERROR)] = None
    """absolute error of an internal step"""
    start: Annotated[Literal["rest", "displaced", "polygon", "straight", "folded"] | None, Sets()] = None
    """layout at the start: static equilibrium, displaced from it, or a polygon of links without load; a held chain:
    straight or folded"""
    link_outputs: LinkOutputs = STANDARD
    """groups of outputs per link; true: the standard groups, false: none"""

    @property
    def kind(self) -> TrackKind:
        """Kind of track."""
        return TRACKS[self.model]

    def choices(self) -> dict[str, Any]:
        """Given parameters, and the defaults of those that may exclude each other."""
        return {**self.kind.defaults, **self.parameters()}

    def of_model(self, model: str) -> TrackModelTable:
        """The same track of another model, with the defaults of all parameters that ``TRACKS`` lists defaults of."""
        listed = {parameter for kind in TRACKS.values() for parameter in kind.defaults}
        own = {key: None for key, one in self.fmu_parameters().items() if one.name in listed}
        return self.model_copy(update={**own, "model": model})

    @model_validator(mode="after")
    def _check_parameters(self) -> TrackModelTable:
        for key, one in self.fmu_parameters().items():
            value, models = getattr(self, key), models_with(one.name)
            if value is not None and self.model not in models:
                needed = " or ".join(map(repr, models))
                raise ValueError(f"{key} = '{value}' needs model = {needed}: {self.kind.links} have none")
        if conflict := self.kind.conflict(self.choices()):
            raise ValueError(conflict)
        return self


def short_track(value: object) -> object:
    """Accept the name of a model in place of its table."""
    return {"model": value} if isinstance(value, str) else value
