"""Contact with the ground and with wheels: shape of the ground in the frame of the start, and laws.

Imported only where something touches them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fmus.interface.model import InvalidParameter
from fmus.physics.contact.ground import GroundShape, bumpy_ground
from fmus.physics.contact.laws import LAWS
from fmus.start import start_pose
from fmus.vehicles.sides import ground_level


def ground_shape(vehicle: Mapping[str, Any], ground: Mapping[str, Any], parameters: Mapping[str, Any]) -> Any:
    """Shape of the ground, of a class of ``physics.contact.grounds``, in the frame of the start.

    ``ground`` may have "bump", the arguments of ``bumpy_ground``, on a ground that the pads of the drawn vehicle just
    touch under its road wheels, or "terrain", a ground of ``ground.terrain`` with the world's height of its level part,
    "level", m. Raises InvalidParameter.
    """
    if terrain := ground.get("terrain"):
        from fmus.ground.terrain import terrain_at  # only where the ground is one

        try:
            return terrain_at(terrain, start_pose(parameters), float(parameters.get("start.lateral", 0.0)))
        except ValueError as error:
            raise InvalidParameter(f"ground: {error}") from None
    level, bump = ground_level(vehicle) - float(parameters["start.height"]), ground.get("bump")
    try:
        return bumpy_ground(level, **bump) if bump else GroundShape(level)
    except ValueError as error:
        raise InvalidParameter(f"ground.bump: {error}") from None


def contact_law(pair: str, parameters: Mapping[str, Any], table: Mapping[str, Any]) -> Any:
    """Contact law of a pair from its FMI parameters, or from the table where there is no such partner."""

    def value(key: str) -> Any:
        return parameters.get(f"contact.{pair}.{key}", table[key])

    return LAWS[value("law")](*map(value, ("stiffness", "damping", "friction", "friction_velocity")))


def soil_law(numbers: Mapping[str, Any], track: Mapping[str, Any]) -> Any:
    """Law of a soil under the links of a vehicle's ``track`` table; raises InvalidParameter."""
    from fmus.physics.contact.soil.parameters import soil

    try:
        return soil(numbers, track["pitch"], track["width"])
    except ValueError as error:
        raise InvalidParameter(f"ground.soil.{error}") from None


def is_hard(law: Any) -> bool:
    """Whether the ground has a contact law with friction, and is not soil."""
    return type(law) in LAWS.values()
