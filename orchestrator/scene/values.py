"""Value types that several tables of a scene file share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from fmus.track_choices import TRACKS
from fmus.vehicle import In
from orchestrator.log.message_records import MOST_STEPS

Duration = Annotated[float, In("s", gt=0)]


Time = Annotated[float, In("s", ge=0)]


Place = Annotated[float, In("m", ge=-1e6, le=1e6)]  # beyond, a double cannot resolve contact penetrations


Every = Annotated[int, Field(ge=1, le=MOST_STEPS)]


if TYPE_CHECKING:
    TrackName = str
else:
    TrackName = Literal[tuple(TRACKS)]  # the track model


Side = Literal["left", "right"]


SIDES: tuple[Side, Side] = ("left", "right")


def false_as_none(value: object) -> object:
    """Read ``false`` as None, which TOML lacks."""
    return None if value is False else value
