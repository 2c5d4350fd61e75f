"""Position of a wheel at which a closed chain carries a wanted static tension (build side).

The links are so stiff that a millimetre changes the tension by a kilonewton: the position is solved from the static
equilibrium of the track, not taken from the drawing. At each place the chain is laid out anew, as a run's track is at
its start, so that the run has the tension that was found here.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import scipy  # loads its parts when they are used

from fmus.cache.files import cached_result
from fmus.cache.sources import source_hash
from fmus.chassis.tree import way
from fmus.components import model_of
from fmus.interface.model import InvalidParameter, StepFailed
from fmus.interface.numbers import packed
from fmus.physics.chain.layout import belt_length
from fmus.physics.chain.report import T_MEAN
from fmus.track.start import drawn
from fmus.vehicles.sides import smooth_wheels
from fmus.vehicles.tables import BadInput

REACH, PITCH = 0.06, 0.1524  # m: largest distance of the wheel from its drawn place, for links of this pitch
ACCEPTED = 1e-3  # relative difference of the tension from the wanted one
PARTS = 16  # of the largest distance, by which the range ends earlier where the chain cannot rest
SECANTS, BEYOND = 4, 1.2  # most steps towards the wanted tension, and how far they go past what a secant gives
Links = tuple[str, Mapping[str, Any]]  # kind of component of a track, and its parameters other than the defaults
CABLES: Links = ("TrackFlexible", {})


class WheelPlace(NamedTuple):
    """Place of a wheel of a chain at rest, and what it carries there."""

    x: float  # m
    z: float  # m
    pushes: Mapping[str, float]  # by wheel, away from the sprocket at the origin: they hold it against the chain, N
    tension: float  # mean of the chain, N
    missed: str  # why this is not the tension asked, in words; "" if it is


def tension_wheel(
    config: Mapping[str, Any], name: str, tension: float, keys: str = "vehicle.track", links: Links = CABLES
) -> WheelPlace:
    """Place of the wheel ``name`` at which a chain carries a mean static ``tension``, N, or the nearest to it.

    A tension of 0 is a slack track: the wheel is drawn in. ``config`` is that of a track, ``keys`` the table in which
    the user gave links and tension (for messages). The place is that of cables, unless ``links`` carry another tension
    there: rigid ones do not stretch. It is accepted to 0.1 %, within 60 mm of the drawn one (links of 152.4 mm; others
    in proportion). The result is cached for this build. Raises BadInput for a chain that cannot be laid round its
    wheels.
    """
    slides = ["tensioner.angle", *(f"wheel.{key}.tensioner.angle" for key in config["vehicle"].get("wheel") or ())]
    read = packed(config, [*model_of(CABLES[0]).reads(config), *slides])
    read["vehicle"] = without_motion(read["vehicle"])
    request = [source_hash(), read, name, tension, links]
    return WheelPlace(*cached_result("places", "place", request, lambda: search(read, name, tension, keys, links)))


def without_motion(vehicle: Mapping[str, Any]) -> dict[str, Any]:
    """Vehicle table without friction and damping of contacts, which nothing at rest has a use for.

    What is found is the same to the bit for all of them.
    """
    laws = {pair: {**law, "damping": 0.0, "friction": 0.0, "friction_velocity": 1.0}
            for pair, law in vehicle["contact"].items()}  # fmt: skip
    return {**vehicle, "contact": laws}


class Track:
    """A track whose wheel ``name`` is tried at several places."""

    def __init__(self, config: Mapping[str, Any], name: str, links: Links) -> None:
        self.config, self.links = config, links
        self.index = next(i for i, wheel in enumerate(config["track"]["wheels"]) if wheel["name"] == name)
        self.places = [wheel["position"] for wheel in drawn(config["vehicle"], config["track"]["wheels"])]
        self.drawn, self.height = self.places[self.index]
        self.outwards = 1.0 if self.drawn > 0.0 else -1.0  # away from the sprocket
        slides = {wheel["name"]: way(wheel) for wheel in smooth_wheels(config["vehicle"])}
        self.ways = np.array([slides.get(wheel["name"], (1.0, 0.0)) for wheel in config["track"]["wheels"]])
        self.ahead, self.up = self.ways[self.index].tolist()
        self.found: dict[float, tuple[float, dict[str, float]]] = {}  # by place: mean tension, pushes outwards, N

    def place_on_slide(self, x: float) -> tuple[float, float]:
        """Place x, z, m, of the wheel on its slide."""
        return x, self.height + (x - self.drawn) * self.up / self.ahead

    def tension(self, x: float) -> float:
        """Mean tension, N, of the chain laid out with the wheel at x; raises InvalidParameter, StepFailed."""
        if x not in self.found:
            track = self.config["track"]
            wheels = [dict(wheel) for wheel in track["wheels"]]
            wheels[self.index]["position"] = self.place_on_slide(x)
            kind, parameters = self.links
            model = model_of(kind)({**self.config, "track": {**track, "wheels": wheels}, "link_outputs": False})
            defaults = {port.name: port.start for port in model.ports if port.causality == "parameter"}
            model.initialise({**defaults, **parameters})
            along = (self.ways * model.s.mean[: len(wheels), [0, 2]]).sum(axis=1)
            pulls = zip(wheels, self.places, along.tolist(), strict=True)
            pushes = {wheel["name"]: round(-pull if at[0] > 0.0 else pull, 3) for wheel, at, pull in pulls}
            self.found[x] = float(model.report[T_MEAN]), pushes
        return self.found[x][0]

    def end(self, way: float) -> float:
        """Place at most ``way``, m, from the drawn one, as far as the chain comes to rest on its wheels."""
        for part in range(PARTS, 0, -1):
            x = self.drawn + part / PARTS * way
            with suppress(InvalidParameter, StepFailed):
                self.tension(x)
                return x
        return self.drawn

    def place(self, tension: float, reach: float) -> float:
        """Place of a tension, N, at most ``reach``, m, from the drawn one, or nearest to it; raises StepFailed."""
        if tension == 0.0:
            return self.end(-self.outwards * reach)
        for bracket in (self.near, self.far):
            low, high = bracket(tension, reach)
            if (self.tension(low) - tension) * (self.tension(high) - tension) < 0.0:
                x = float(scipy.optimize.brentq(lambda x: self.tension(x) - tension, low, high, xtol=1e-9))
                if self.carries(x := round(x, 8), tension):
                    return x
        return min(self.found, key=lambda x: abs(self.found[x][0] - tension))

    def far(self, tension: float, reach: float) -> tuple[float, float]:
        """Both ends of the range of places."""
        return self.end(-reach), self.end(reach)

    def near(self, tension: float, reach: float) -> tuple[float, float]:
        """Places with the tension between them, by a few secants from the drawn place; equal if they find none."""
        x, lacking = self.drawn, tension - self.tension(self.drawn)
        end = self.end(self.outwards * (reach if lacking > 0.0 else -reach))
        way = (end - x) / PARTS
        with suppress(InvalidParameter, StepFailed):
            for _ in range(SECANTS):
                if abs(x + way - self.drawn) > abs(end - self.drawn):
                    break
                x, before, left = x + way, x, tension - self.tension(x + way)
                if left * lacking < 0.0:
                    return min(x, before), max(x, before)
                way, lacking = way * BEYOND * left / (lacking - left or left), left
        return self.drawn, self.drawn

    def carries(self, x: float, tension: float) -> bool:
        """Whether the chain has that tension, N, with the wheel at x; 0 is slack."""
        return not tension or abs(self.tension(x) - tension) <= ACCEPTED * abs(tension)

    def advice(self, name: str, keys: str) -> str:
        """Number of links, or place of the wheel, with which they are as long as the belt, in words; "" for none."""
        model = model_of(self.links[0])(self.config)
        length, (centres, radii, _) = model.links_count * model.pitch, model.circles()
        try:
            links = round(belt_length(centres, radii) / model.pitch)
        except ValueError:  # none lies round the wheels
            return ""
        if links == model.links_count:
            return ""

        def excess(x: float) -> float:
            centres[self.index] = self.place_on_slide(x)
            return belt_length(centres, radii) - length

        try:
            x = float(scipy.optimize.brentq(excess, 0.0, self.outwards * length, xtol=1e-6))
        except ValueError:  # other wheels alone need a longer belt
            return f"; {links} links would fit"
        name = name if name == "idler" else f"wheel.{name}"
        key = f"rig.axle_distance = {-x:.4g}" if keys == "rig" else f"{keys.replace('track', name)}.x = {x:.4g}"
        return f"; {links} links or {key} m would fit"


def search(config: Mapping[str, Any], name: str, tension: float, keys: str, links: Links) -> WheelPlace:
    """Find the place of ``tension_wheel``, which is not kept; raises BadInput."""
    chain = Track(config, name, CABLES)
    reach = chain.ahead * REACH * (config["vehicle"]["track"]["pitch"] / PITCH)  # along x
    where = f"{keys}.tension = {tension:.6g} N"
    pitch = config["vehicle"]["track"]["pitch"]
    loop = f"{keys}.links = {config['track']['links']}, vehicle.track.pitch = {pitch:g} m"
    try:
        chain.tension(chain.drawn)
    except InvalidParameter as error:
        raise BadInput(f"{loop} and the wheels do not fit together: {error}{chain.advice(name, keys)}") from None
    except StepFailed as error:
        raise BadInput(f"the chain does not come to rest on its drawn wheels: {error}") from None
    try:
        x = chain.place(tension, reach)
        if links != CABLES and not (own := Track(config, name, links)).carries(x, tension):
            chain, x = own, own.place(tension, reach)
    except (InvalidParameter, StepFailed) as error:
        raise BadInput(f"{where}: with the {name} near its drawn x = {chain.drawn:.4g} m {error}") from None
    at = chain.tension(x)
    place = WheelPlace(*chain.place_on_slide(x), chain.found[x][1], at, "")
    if chain.carries(x, tension):
        return place
    tensions = [found for found, _ in chain.found.values()]
    low, high = min(tensions), max(tensions)
    jumps = " and jumps as a pin changes its seat" * (low < tension < high)
    return place._replace(
        missed=f"not reached with the {name} within {reach * 1e3:.3g} mm of x = {chain.drawn:.4g} m, where the track"
        f" carries {low:.6g} to {high:.6g} N{jumps}: {loop} and the places of the wheels decide it"
        f"{chain.advice(name, keys)}"
    )
