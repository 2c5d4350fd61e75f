"""Idlers of a vehicle whose tracks carry a wanted tension as it stands on level, hard ground (build side).

Operator's manuals give the tension of the standing vehicle, and so do models of terramechanics (Wong, Terramechanics
and Off-Road Vehicle Engineering, 2010, chapter 7). Laid round the wheels as drawn, a chain carries another tension:
arms give way under the weight, and idlers on their springs. That tension as drawn, by which ``rest.tensioning`` places
an idler, is found by secants over static equilibria, each of which begins at the last one.

The links are cables, or rigid links where these carry another tension, see ``rest.equilibrium``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from fmus.cache.files import cached_result
from fmus.interface.model import InvalidParameter, StepFailed
from fmus.physics.arrays import Floats
from fmus.rest.equilibrium import (
    FlexibleTrack,
    VehicleEquilibrium,
    VehicleOnChains,
    in_place_of,
    motionless,
    read_by_search,
    read_equilibrium,
)
from fmus.rest.tensioning import ACCEPTED, CABLES, Links, tension_wheel
from fmus.track_flexible.model import Model as Cables
from fmus.track_rigid.model import Model as RigidLinks
from fmus.vehicles.sides import SIDES, of_side
from fmus.vehicles.tables import BadInput

CLOSE = 1e-5  # relative difference of the tension from the wanted one at which the search ends
MAX_EQUILIBRIA = 20  # further equilibria
JUMP = 20.0  # slope of the tension over that as drawn beyond which the vehicle rests in another way
FARTHEST = 2.0  # largest change of the tension as drawn from one to the next, as a factor


Places = Sequence[Sequence[float]]
JUMPS = ", and it jumps: the vehicle rests in two ways"


class DoesNotStand(BadInput):
    """A vehicle that finds no equilibrium on level, hard ground; the message says why."""


class StandingVehicle(NamedTuple):
    """Idlers of the sides that have tables of their own, left first, and the equilibrium on level, hard ground."""

    places: Places  # x, z of the wheel that is moved, m
    pushes: Sequence[Mapping[str, float]]  # on the wheels, by name, that balance the tracks as drawn, N
    drawn: Sequence[float]  # mean tension of the tracks as drawn, N
    rest: VehicleEquilibrium

    def tensions(self) -> Floats:
        """Mean tensions, N, of the tracks of each table: of both sides, if they share one."""
        tensions = np.array([track.tension for track in self.rest.tracks])
        return tensions if len(self.places) > 1 else tensions.mean(keepdims=True)


def standing_vehicle(
    chassis: Mapping[str, Any], tracks: Mapping[str, FlexibleTrack], tension: float, rigid: bool = False
) -> StandingVehicle:
    """Idlers with which the tracks of the standing vehicle carry a mean ``tension``, N; 0 draws them in.

    ``chassis`` is the config of a chassis that touches nothing, ``tracks`` are both tracks on level, hard ground, with
    their idlers as drawn. ``rigid``: on rigid links, where they differ from cables. The result is cached for this
    build. Raises DoesNotStand, and BadInput where the tension is not reached to 0.1 %.
    """
    chassis, tracks = motionless(chassis, tracks)
    request = [*read_by_search(chassis, tracks), tension, chassis["vehicle"]["tensioner"]["wheel"]]

    def found(links: str) -> StandingVehicle:
        """On rigid links what it is on cables, unless these stretch."""
        search = _Search(chassis, tracks, tension, found("cables") if links == "rigid" else None)
        try:
            places, pushes, drawn, rest = cached_result("places", "standing", [*request, links], search.run)
        except (InvalidParameter, StepFailed) as error:
            if search.missed and search.guess is None:  # wheels too far out or in may be the cause of what fails
                raise BadInput(
                    f"vehicle.track.tension = {tension:.6g} N: {search.missed}; at the nearest as drawn: {error}"
                ) from None
            raise
        return StandingVehicle(places, pushes, drawn, read_equilibrium(rest))

    try:
        return found("rigid" if rigid else "cables")
    except (InvalidParameter, StepFailed) as error:
        raise DoesNotStand(str(error)) from None


class _Search:
    """Search for the tension as drawn of each side that has a table of its own."""

    def __init__(
        self,
        chassis: Mapping[str, Any],
        tracks: Mapping[str, FlexibleTrack],
        tension: float,
        cables: StandingVehicle | None,
    ) -> None:
        self.chassis, self.tracks, self.tension, self.cables = chassis, tracks, tension, cables
        self.sides = SIDES if chassis["vehicle"].get("right") else SIDES[:1]
        self.missed = ""  # why the last trial did not reach its tension as drawn
        self.guess: Floats | None = None  # last equilibrium
        self.nearest: StandingVehicle | None = None  # that lacks least

    def run(self) -> StandingVehicle:
        """See ``standing_vehicle``; rigid links whose search fails take the nearest place, at first that of cables."""
        if self.cables is not None:
            rest, stretch = in_place_of(self.cables.rest, self._vehicle(self.cables.places, self.cables.pushes))
            self.nearest = self.cables._replace(rest=rest)
            with suppress(InvalidParameter, StepFailed, BadInput):
                return self._found(np.array(self.cables.drawn)) if stretch else self.nearest
            return self.nearest
        return self._found(np.full(len(self.sides), self.tension))

    def _found(self, drawn: Floats) -> StandingVehicle:
        """Standing vehicle by secants from the tensions as drawn, N; raises as ``standing_vehicle``."""
        best, jumps = self._standing(drawn), False
        last, self.nearest = best, min(self.nearest or best, best, key=self._lack)
        slope = np.ones_like(drawn)  # of the tension over that as drawn
        for _ in range(MAX_EQUILIBRIA):
            if self._lack(best) <= CLOSE:
                return best
            now = np.array(last.drawn)
            wanted = now + (self.tension - last.tensions()) / slope
            standing = self._standing(np.clip(wanted, now / FARTHEST, now * FARTHEST))
            moved, gained = standing.drawn - now, standing.tensions() - last.tensions()
            slope = np.divide(gained, moved, out=np.ones_like(moved), where=moved != 0.0)
            slope[slope <= 0.0] = 1.0
            last, best = standing, min(best, standing, key=self._lack)
            self.nearest = min(self.nearest, best, key=self._lack)
            jumps = bool((abs(gained) > JUMP * abs(moved)).any())
            if jumps or not moved.any():  # the idlers have no more way
                break
        if self._lack(best) <= ACCEPTED:
            return best
        nearest = " and ".join(f"{tension:.6g} N" for tension in best.tensions())
        why = f"; as drawn {self.missed}" if self.missed else JUMPS * jumps
        raise BadInput(
            f"vehicle.track.tension = {self.tension:.6g} N: no place of the idler was found where the vehicle standing"
            f" on level, hard ground has it; the nearest tension found is {nearest}{why}"
        )

    def _lack(self, standing: StandingVehicle) -> float:
        """Largest relative difference of a tension from the wanted one; a slack track has any."""
        return float(abs(standing.tensions() / self.tension - 1.0).max()) if self.tension else 0.0

    def _standing(self, drawn: Floats) -> StandingVehicle:
        links: Links = CABLES if self.cables is None else ("TrackRigid", self.tracks["left"].parameters)
        self.missed = ""
        found, moved = [], self.chassis["vehicle"]["tensioner"]["wheel"]
        for side, tension in zip(self.sides, drawn.tolist(), strict=True):
            keys = "vehicle.track" if side == "left" else "vehicle.right.track"
            found.append(tension_wheel(self.tracks[side].config, moved, tension, keys, links))
            self.missed = found[-1].missed or self.missed
        places, pushes, tensions = zip(*((place[:2], place.pushes, place.tension) for place in found), strict=True)
        vehicle = self._vehicle(places, pushes)
        try:
            self.guess = vehicle.come_to_rest(vehicle.start() if self.guess is None else self.guess)
        except StepFailed:  # the way from the last place may be too far for a chain
            vehicle = self._vehicle(places, pushes)
            self.guess = vehicle.come_to_rest(vehicle.start())
        if self.cables is not None and vehicle.lays_out_otherwise():  # as a run does: so the search goes on from there
            vehicle = self._vehicle(places, pushes)
            self.guess = vehicle.come_to_rest(self.guess)
            if differ := vehicle.lays_out_otherwise():  # no run starts from there
                raise StepFailed(differ)
        rest = vehicle.as_equilibrium(self.guess)._replace(tracks=vehicle.tracks_at_rest())
        return StandingVehicle(places, pushes, tensions, rest)

    def _vehicle(self, places: Places, pushes: Sequence[Mapping[str, float]]) -> VehicleOnChains:
        moved = with_idlers(self.chassis["vehicle"], places, pushes)
        tracks = {}
        for side, track in self.tracks.items():
            table = track.config["vehicle"] | {key: of_side(moved, side)[key] for key in ("idler", "wheel")}
            tracks[side] = track._replace(config={**track.config, "vehicle": table})
        kind = Cables if self.cables is None else RigidLinks
        return VehicleOnChains(kind, {**self.chassis, "vehicle": moved}, tracks, (0.0, 0.0))


def with_idlers(
    vehicle: Mapping[str, Any], places: Places, pushes: Sequence[Mapping[str, float]], bare: Sequence[str] = ()
) -> dict[str, Any]:
    """Vehicle table with the wheels that are moved at ``places`` x, z, m, and further ``pushes`` of its tensioners, N.

    One of each for both sides, or left and right those of a vehicle with a table ``right``. ``bare``: sides without a
    track, whose further wheels lack the push; a chassis takes it from their idlers.
    """
    moved, right, name = dict(vehicle), dict(vehicle.get("right") or {}), vehicle["tensioner"]["wheel"]
    for k, (side, table) in enumerate(zip(SIDES, (moved, right), strict=True)):
        own, at, wheels = of_side(vehicle, side), min(k, len(places) - 1), {}
        found = {key: {"x": it["x"], "z": it["z"]} for key, it in {**own["wheel"], "idler": own["idler"]}.items()}
        found[name] = dict(zip("xz", places[at], strict=True))
        for key, wheel in own["wheel"].items():
            if slide := wheel["tensioner"]:
                slide = {**slide, "preload": slide["preload"] + (0.0 if side in bare else pushes[at][key])}
            place = {**found[key], "tensioner": slide}
            wheels[key] = place if table is right else {**wheel, **place}
        if wheels and (k == at or bare):
            table["wheel"] = wheels
        if k == at:
            preload = own["tensioner"]["preload"] + pushes[at]["idler"]
            table["tensioner"] = {**(table.get("tensioner") or {}), "preload": preload}
            table["idler"] = {**(table.get("idler") or {}), **found["idler"]}
    return {**moved, "right": right} if right else moved
