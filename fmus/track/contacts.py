"""Contact partners of a chain from the tables of its vehicle.

Imported only where a chain has such a partner.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fmus.ground.contact import contact_law, ground_shape, is_hard, soil_law
from fmus.ground.refinement import sections
from fmus.interface.model import InvalidParameter
from fmus.physics.arrays import Vector
from fmus.physics.chain.contacts import DRIVING, LUGGED, RIM, TOOTHED, Contacts
from fmus.physics.contact.ground import GroundShape
from fmus.physics.contact.teeth import Teeth, teeth
from fmus.physics.elementary import cos, hypot, sin
from fmus.vehicles.sides import grousers, pins_a_turn, pitch_radius

WHEEL_CONTACTS = {"rim": RIM, "teeth": TOOTHED, "driving": DRIVING}  # of the wheels of a track's config
NO_TEETH = Teeth(1, *(0.0,) * 10)
STANDING = (0.0, 0.0, 0.0)
# Losses with which chains come to rest, those of the m113: damping over stiffness, s, friction, its velocity, m/s.
SETTLING, SETTLING_FRICTION, SETTLING_VELOCITY = 2.5e-3, 0.1, 0.05


def contacts(
    vehicle: Mapping[str, Any],
    wheels: Sequence[Mapping[str, Any]],
    ground: Mapping[str, Any] | None,
    parameters: Mapping[str, Any],
    soil: Mapping[str, Any] | None = None,
) -> Contacts:
    """Contact partners from the vehicle table, the wheels of a track's config and the FMI parameters.

    ``ground`` as in ``ground_shape``, with a "refinement" of its points (``ground.refinement``), None without one; it
    is hard, or the ``soil`` of these numbers (``physics.contact.soil.parameters``). Raises InvalidParameter with the
    key, the value and what is allowed.
    """
    laws = {pair: contact_law(pair, parameters, vehicle["contact"][pair]) for pair in ("sprocket", "wheel", "ground")}
    s, track = vehicle["sprocket"], vehicle["track"]
    profile, lugs, rim = NO_TEETH, s.get("pins_per_gap") or 1, 0.0
    if s.get("teeth"):
        shape = (s[key] for key in ("pin_radius", "outer_radius", "seat_clearance", "flank_angle", "tip_radius"))
        try:
            profile = teeth(s["teeth"], seated := pitch_radius(vehicle, sin), *shape)
        except ValueError as error:
            raise InvalidParameter(f"sprocket: {error}") from None
        touched = seated * cos(np.pi / pins_a_turn(vehicle)) - track["face"]  # by links whose pins are seated
        rim = touched if lugs > 1 else profile.top
    radius = np.array([rim if w["kind"] == "teeth" else w["radius"] for w in wheels], dtype=float)
    kinds = WHEEL_CONTACTS | {"teeth": LUGGED} if lugs > 1 else WHEEL_CONTACTS
    return Contacts(
        np.array([kinds[w["kind"]] for w in wheels], dtype=np.int64),
        radius,
        profile,
        lugs,
        vehicle["guide"]["clearance"],
        int(ground is not None),
        GroundShape(0.0) if ground is None else ground_shape(vehicle, ground, parameters),
        STANDING,
        laws["sprocket"],
        laws["wheel"],
        laws["ground"] if soil is None else soil_law(soil, track),
        sections(track, (ground or {}).get("refinement"), hard=soil is None),
        grousers(track)["height"],
    )


def settling(partners: Contacts, friction: float) -> Contacts:
    """Copy of the partners with which a chain comes to rest: that of the same losses for all vehicles.

    The equilibrium would depend on those of the vehicle a little (1 um): it depends on where the search begins. Soil
    has no friction before it was touched.
    """

    def with_losses(law: Any) -> Any:
        return law._replace(c=SETTLING * law.k, mu=friction, v_reg=SETTLING_VELOCITY)

    return partners._replace(
        sprocket=with_losses(partners.sprocket),
        wheel=with_losses(partners.wheel),
        soil=with_losses(partners.soil) if is_hard(partners.soil) else partners.soil,
        shape=partners.shape.without_friction(),
    )


def at_rest(partners: Contacts, gravity: Vector) -> Contacts:
    """Copy of the partners for the static equilibrium of a chain under ``gravity``, m/s2 in the track's frame.

    The ground is that in the plane of the chain, and its friction balances gravity along the slope. Regularised
    friction holds a vehicle only while it creeps, all its points at one velocity. Here the ground moves instead and
    friction is sharp: each point at rest carries its share, the slope times its normal force. Soil has no friction
    before it is touched; raises InvalidParameter for soil on a slope ahead.
    """
    partners = partners._replace(shape=partners.shape.section())
    ahead, across = (-g / gravity[2] if gravity[2] else 0.0 for g in gravity[:2])
    slope = hypot(ahead, across)
    if slope == 0.0:
        return partners
    if not is_hard(partners.soil):
        if ahead:
            raise InvalidParameter("ground.soil needs level ground under the tracks at the start")
        return partners
    belt = (0.0 - ahead / slope, 0.0 - across / slope, 0.0)
    soil, shape = partners.soil._replace(mu=slope, v_reg=0.0), partners.shape.without_friction()
    return partners._replace(belt=belt, soil=soil, shape=shape)
