"""Position of a wheel at which a closed chain carries a wanted static tension (build side).

The links are so stiff that a millimetre changes the tension by a kilonewton: the position is solved from the static
equilibrium of the track, not taken from the drawing.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import scipy  # loads its parts when they are used

from fmus.cache import cached_result
from fmus.model import InvalidParameter, StepFailed
from fmus.physics.chain.report import T_MEAN
from fmus.sources import source_hash
from fmus.track_flexible.model import Model
from fmus.vehicle import BadInput

REACH = 0.06  # largest distance of the wheel from its drawn place, m


def tension_wheel(
    config: Mapping[str, Any], name: str, tension: float, keys: str = "vehicle.track"
) -> tuple[float, float]:
    """Position x of the wheel ``name``, m, for a mean static ``tension``, N, and the push on it.

    The push, N, away from the sprocket at the origin, holds the wheel there against the chain.

    ``config`` is the config of a track, ``keys`` the table in which the user gave links and tension (for messages). The
    result is cached for this build. Raises BadInput when the chain cannot carry that tension with the wheel within
    60 mm of its drawn place.
    """
    request = [source_hash(), config, name, tension]
    x, push = cached_result("places", "place", request, lambda: _search(config, name, tension, keys))
    return x, push


def _search(config: Mapping[str, Any], name: str, tension: float, keys: str) -> tuple[float, float]:
    track = config["track"]
    index = next(i for i, wheel in enumerate(track["wheels"]) if wheel["name"] == name)
    drawn = float(track["wheels"][index]["position"][0])
    outwards = 1.0 if drawn > 0.0 else -1.0  # away from the sprocket

    def settled(x: float) -> Model:
        wheels = [dict(wheel) for wheel in track["wheels"]]
        wheels[index]["position"] = [x, wheels[index]["position"][1]]
        model = Model({**config, "track": {**track, "wheels": wheels}, "link_outputs": False})
        model.initialise({port.name: port.start for port in model.ports if port.causality == "parameter"})
        return model

    def excess(x: float) -> float:
        try:
            return float(settled(x).report[T_MEAN]) - tension
        except (InvalidParameter, StepFailed):
            # cannot be laid out: the chain hangs slack round too short a path, and does not close round too long a one
            return -tension if outwards * (x - drawn) < 0.0 else 1e6

    try:
        settled(drawn)
    except InvalidParameter as error:
        raise BadInput(f"{keys}.links = {track['links']}: {error}") from None
    except StepFailed as error:
        raise BadInput(f"the chain does not come to rest on its drawn wheels: {error}") from None
    low, high = drawn - REACH, drawn + REACH
    tight, slack = (excess(drawn + sense * REACH) for sense in (outwards, -outwards))
    if not tight > 0.0 > slack:
        raise BadInput(
            f"{keys}.tension = {tension:.6g} N: not reached with the {name} within {REACH * 1e3:.0f} mm of "
            f"x = {drawn:.4g} m ({track['links']} links of {config['vehicle']['track']['pitch']} m)"
        )
    x = round(float(scipy.optimize.brentq(excess, low, high, xtol=1e-8)), 8)
    try:
        return x, round(-outwards * float(settled(x).s.mean[index, 0]), 3)
    except StepFailed as error:
        raise BadInput(f"vehicle.track.tension = {tension:.6g} N: {error}") from None
