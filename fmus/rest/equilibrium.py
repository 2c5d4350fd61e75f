"""Static equilibrium of a vehicle: hull, road arms, idlers, chains and ground at rest (build side).

The unknowns are height, roll and pitch of the hull and the coordinates of the leaves. They place the wheels; each chain
is brought to its own static equilibrium on these wheels (in which a track starts); with the wrenches of the chains the
chassis has accelerations, which must vanish. Friction has no influence: regularised friction is zero at rest.

The chains are of one kind for all kinds of links of steel, so that all kinds start in the same place: rigid links,
beams and cables of steel differ by 1.4 um in height and by 0.02 % in wheel loads. They are cables in an upright plane,
whose links resist a roll of the wheels as springs side by side (``_ChainOnWheels``). From the place that they give, a
hull that leans goes on with rigid links, which tilt between the wheels and the ground; so does every hull of a run with
rigid links if these carry another tension there, by more than ``STRETCHED``: a belt stretches, and they do not. If that
search fails, the place stays. Tension, sag and loads that are told are those of the run's links.
Friction of the ground and of the rims, which creeps, balances the lateral forces of tilted wheels and of a side slope;
the road wheels stand over the middle of the tracks, or on a side slope at their guides.

Method: Newton with an inertia term over the square of a pseudo step that grows as the accelerations fall
(pseudo-transient continuation: Kelley and Keyes, SIAM J. Numer. Anal. 35(2), 1998, doi 10.1137/S0036142996304796); the
Jacobian is computed by finite differences.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from fmus.cache.files import cached_result
from fmus.cache.sources import source_hash
from fmus.chassis.dynamics import rates
from fmus.chassis.leaf import ROOT, is_fixed
from fmus.chassis.model import Model as Chassis
from fmus.chassis.model import stations
from fmus.chassis.observe import put_sides
from fmus.driver.skid import skid_vehicle
from fmus.interface.model import InvalidParameter, StepFailed
from fmus.interface.numbers import packed
from fmus.interface.ports import STATE, WRENCH
from fmus.kernels.jit import plain
from fmus.physics.arrays import Floats, Vector
from fmus.physics.chain.layout import sag_of_longest_span
from fmus.physics.chain.report import T_MEAN
from fmus.physics.elementary import sin
from fmus.physics.elimination import solved
from fmus.physics.vector import scale
from fmus.physics.wheels import WIDTH, read_states
from fmus.rest.tensioning import without_motion
from fmus.start import LEVEL, Stance, StartPose, roll_pitch_quaternion, stance
from fmus.track_flexible.model import Model as Cables
from fmus.track_rigid.model import Model as RigidLinks
from fmus.vehicles.sides import (
    ground_level,
    ground_wheels,
    lopsided,
    lowest_wheel,
    pitch_radius,
    smooth_wheels,
    thickness,
)
from fmus.vehicles.tables import BadInput

FIRST_STEP, LAST_STEP = 0.05, 1e6  # pseudo steps, s
LARGEST_CHANGE = 0.05  # largest change of an unknown in a pseudo step, m or rad
DIFFERENCE = 1e-5  # finite difference for the Jacobian, m or rad: a chain's forces jump by some 5e-4 m/s2 at kinks
REST_ACCELERATION = 1e-4  # largest acceleration that counts as rest, m/s2 or rad/s2: 0.04 N on an idler
MAX_STEPS = 60  # pseudo steps
NEWTON = 10.0  # pseudo step, s, beyond which inertia is no part of a change
LEAST_SHARE = 1.0 / 16.0  # of a change, which is halved while the accelerations grow
LIFT = np.eye(WIDTH)[2] * 1e-5  # lift of all wheels, m: the loss of load gives the vertical stiffness
LEANS = 1e-7  # roll of a hull from which its chains tilt, rad: 0.3 um between the tracks
ACCEPTED = 1e-3  # relative difference of tensions of a chain that followed its wheels and of one laid out there
STRETCHED = 0.01  # relative difference of tensions of cables and rigid links beyond which each rests in its own place
MIRRORED = 1.0, -1.0, 1.0, -1.0, 1.0, -1.0  # signs of a wrench on the other side
HEIGHT, ROLL, PITCH, LEAVES = 0, 1, 2, 3  # indices of the unknowns


class TrackAtRest(NamedTuple):
    """Track on its wheels at rest."""

    tension: float  # mean over its links, N
    sag: float  # of its longest free span, m
    loads: Sequence[float]  # on the road wheels from the front, N
    others: Mapping[str, float]  # by name on the other wheels that stand on level ground as drawn, N


class VehicleEquilibrium(NamedTuple):
    """Coordinates of hull and leaves at rest, from the drawn position."""

    height: float  # of the hull's centre of mass, m
    roll: float  # rad
    pitch: float  # rad
    left: Sequence[float]  # arm angles from the front, rad, then the slides of idler and further wheels, m
    right: Sequence[float]  # likewise
    lateral: float = 0.0  # of the hull, m: on a side slope it has slid until guides touch
    # force, N, and torque, N m, of each track on its sprocket, left and right, in the vehicle; 0 without a track
    sprockets: Sequence[Sequence[float]] = ()
    tracks: Sequence[TrackAtRest] = ()  # left and right


class FlexibleTrack(NamedTuple):
    """Track of the vehicle, modelled with flexible links."""

    config: Mapping[str, Any]  # of a flexible track
    parameters: Mapping[str, Any]  # those that differ from the defaults: how the loop is closed, the pose on a slope


def equilibrium(
    chassis: Mapping[str, Any],
    tracks: Mapping[str, FlexibleTrack],
    slope: tuple[float, float] = (0.0, 0.0),
    rigid: bool = False,
) -> VehicleEquilibrium:
    """Static equilibrium of a chassis, given by its config, on tracks by side ("left", "right").

    ``slope``: pitch and roll of the ground under the vehicle, rad; the result is relative to it. With equal sides and a
    hull that does not lean sideways, only the left half is solved. ``rigid``: of rigid links, where they differ from
    cables. The result is cached for this build. Raises BadInput.
    """
    chassis, tracks = motionless(chassis, tracks)
    request = [*read_by_search(chassis, tracks), slope]

    def found(links: str) -> VehicleEquilibrium:
        """Equilibrium on ``links``: on rigid ones that of cables, unless the chain of cables stretches."""
        search = partial(_at_rest, chassis, tracks, slope, found("cables") if links == "rigid" else None)
        return read_equilibrium(cached_result("places", "equilibrium", [*request, links], search))

    try:
        return found("rigid" if rigid and tracks else "cables")
    except (InvalidParameter, StepFailed) as error:
        raise BadInput(f"the vehicle's equilibrium was not found, start.state = 'drawn' needs none: {error}") from None


def motionless(
    chassis: Mapping[str, Any], tracks: Mapping[str, FlexibleTrack]
) -> tuple[Mapping[str, Any], Mapping[str, FlexibleTrack]]:
    """Configs without friction and damping of contacts, see ``without_motion``."""
    return {**chassis, "vehicle": without_motion(chassis["vehicle"])}, {
        side: track._replace(config={**track.config, "vehicle": without_motion(track.config["vehicle"])})
        for side, track in tracks.items()
    }


def read_by_search(chassis: Mapping[str, Any], tracks: Mapping[str, FlexibleTrack]) -> list[Any]:
    """Numbers that a search for the equilibrium reads, of this build: the beginning of a request to the cache."""
    read = {
        side: (packed(track.config, Cables.reads(track.config)), track.parameters) for side, track in tracks.items()
    }
    return [source_hash(), packed(chassis, Chassis.reads(chassis)), read]


def read_equilibrium(solution: Sequence[Any]) -> VehicleEquilibrium:
    """Equilibrium from the lists that a cache has of it."""
    found = VehicleEquilibrium(*solution)
    return found._replace(tracks=[TrackAtRest(*track) for track in found.tracks])


def stances(chassis: Mapping[str, Any]) -> dict[str, Stance]:
    """Stances of the places of a chassis at the start, by name (``left.idler``), from its config.

    They are in the vehicle frame, but y counts from the plane of the track. Cached for this build, as compiling or
    loading a kernel takes a second.
    """
    request = [source_hash(), packed(chassis, Chassis.reads(chassis))]
    found = cached_result("places", "stances", request, lambda: _stances(chassis))
    return {name: stance(numbers) for name, numbers in found.items()}


def _stances(chassis: Mapping[str, Any]) -> dict[str, Stance]:
    vehicle = chassis["vehicle"]
    whole_config = {**chassis["chassis"], "sides": ["left", "right"]}
    model, lateral = Chassis({"vehicle": vehicle, "chassis": whole_config}), vehicle["track"]["lateral"]
    motions = _motions(model, model.start_state())
    names = stations(vehicle)
    return {
        f"{side}.{name}": stance((x, y - sign * lateral, *rest[:5]))
        for side, sign, side_motions in zip(("left", "right"), (1.0, -1.0), motions, strict=True)
        for name, (x, y, *rest) in zip(names, side_motions.tolist(), strict=True)
    }


def is_asymmetric(chassis: Mapping[str, Any], tracks: Sequence[str]) -> bool:
    """Whether the two sides carry different loads, so that the hull rolls; ``one_sided``: the ground under them."""
    ground = chassis["chassis"].get("ground") or {}
    # a table right is solved whole, also of equal sides
    one_sided = len(tracks) == 1 or bool(chassis["vehicle"].get("right")) or chassis["chassis"].get("one_sided")
    return bool(one_sided) or bool(lopsided(chassis["vehicle"], bool(ground.get("hull"))))


def _at_rest(
    chassis: Mapping[str, Any],
    tracks: Mapping[str, FlexibleTrack],
    slope: tuple[float, float],
    cables: VehicleEquilibrium | None,
) -> VehicleEquilibrium:
    """Equilibrium on cables, or from the place of ``cables`` on rigid links; raises StepFailed with a reason.

    The chains are compared with those of a run, which are laid out anew.
    """
    vehicle = VehicleOnChains(Cables if cables is None else RigidLinks, chassis, tracks, slope)
    if cables is not None:
        kept, stretch = in_place_of(cables, vehicle)
        if not stretch:
            return kept
        with suppress(StepFailed):
            return vehicle.rest(vehicle.come_to_rest(vehicle.guess_of(cables)))
        return kept
    guess = vehicle.come_to_rest(vehicle.start())
    if abs(guess[ROLL]) > LEANS or vehicle.gravity[1]:
        vehicle = VehicleOnChains(RigidLinks, chassis, tracks, slope)
        guess = vehicle.come_to_rest(guess)
    try:
        return vehicle.rest(guess)
    except StepFailed:
        with suppress(StepFailed):  # from chains laid out as in a run the search goes on
            return vehicle.rest(vehicle.come_to_rest(guess))
        raise


def in_place_of(cables: VehicleEquilibrium, vehicle: VehicleOnChains) -> tuple[VehicleEquilibrium, bool]:
    """The place of ``cables`` with the tracks of rigid links there, and whether these carry another tension.

    Raises StepFailed if the rigid links find no rest there.
    """
    vehicle.accelerations(vehicle.guess_of(cables))
    tracks = vehicle.tracks_at_rest()
    pairs = zip(tracks, cables.tracks, strict=True)
    differ = any(abs(track.tension - cable.tension) > STRETCHED * abs(cable.tension) for track, cable in pairs)
    return cables._replace(tracks=tracks), differ


def _reason(vehicle: Mapping[str, Any], height: float, pitch: float) -> str:
    """Why a vehicle does not come to rest, from its table and the hull's rise, m, and pitch, rad, at the end."""
    ahead, wheels, idler = skid_vehicle(vehicle)[1], vehicle["road_wheel"]["x"], vehicle["idler"]
    if not min(wheels) <= ahead <= max(wheels):
        which = "ahead of its foremost" if ahead > max(wheels) else "behind its hindmost"
        beyond = max(ahead - max(wheels), min(wheels) - ahead)
        return f"its centre of mass is {beyond:.2f} m {which} road wheel, so it tips over"
    text = f"it has sagged by {-1e3 * height:.0f} mm and pitched by {pitch * 180.0 / np.pi:.1f} degrees"
    radius = pitch_radius(vehicle, sin) - vehicle["track"]["face"]
    for name, x, bottom in ("sprocket", 0.0, -radius), ("idler", idler["x"], idler["z"] - idler["radius"]):
        room = bottom - thickness(vehicle["track"]) - ground_level(vehicle)
        if height - sin(pitch) * (x - vehicle["chassis"]["centre"][0]) < -room:
            return f"{text}: the {name}, whose track is {1e3 * room:.0f} mm above the ground as drawn, presses it in"
    return text


class VehicleOnChains:
    """Chassis and chains of a vehicle: its accelerations at given values of the unknowns."""

    def __init__(
        self, kind: Any, chassis: Mapping[str, Any], tracks: Mapping[str, FlexibleTrack], slope: tuple[float, float]
    ) -> None:
        pitch, roll = slope
        down = StartPose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, pitch, roll).down()
        self.gravity: Vector = scale(float(chassis["vehicle"]["gravity"]), down)
        across = self.gravity[1] / chassis["vehicle"]["gravity"] if chassis["vehicle"]["gravity"] else 0.0
        self.lateral = float(np.sign(across)) * chassis["vehicle"]["guide"]["clearance"]
        self.half = roll == 0.0 and not is_asymmetric(chassis, tuple(tracks))
        sides = ["left"] if self.half else ["left", "right"]
        self.chassis = Chassis({**chassis, "chassis": {**chassis["chassis"], "sides": sides}})
        self.chassis.initialise({})
        wheels = smooth_wheels(chassis["vehicle"])
        self.leaves = sum(wheel["kind"] != "return_roller" for wheel in wheels)  # that may move, of a side
        self._table = chassis["vehicle"]
        self.pose = 0.0, 0.0  # last height, m, and pitch, rad, of the hull
        self._plane = chassis["vehicle"]["track"]["lateral"]
        self._hang = lowest_wheel(chassis["vehicle"])["z"] - chassis["vehicle"]["chassis"]["centre"][2]
        self.chains = {
            sides.index(side): _ChainOnWheels(kind, track, self.gravity)
            for side, track in tracks.items()
            if side in sides
        }
        tree, leaves = self.chassis.tree, range(len(sides) * self.leaves)
        place = [k // self.leaves * (len(tree.is_arm) // 2) + k % self.leaves for k in leaves]  # in the tree
        self._joined = [k for k in leaves if tree.joined[place[k]]]  # second arms of bogies
        fixed = plain(is_fixed)
        moving = [k for k in leaves if not (fixed(tree, place[k]) or k in self._joined)]
        self.unknowns = [HEIGHT, *([] if self.half else [ROLL]), PITCH, *(LEAVES + k for k in moving)]

    def start(self) -> Floats:
        """First guess: the drawn position."""
        return np.zeros(LEAVES + (1 if self.half else 2) * self.leaves)

    def come_to_rest(self, guess: Floats) -> Floats:
        """Unknowns at rest by a search from ``guess``; raises StepFailed with a reason."""
        try:
            return _solve(self, guess)
        except StepFailed as error:
            raise StepFailed(f"{self._reason()} ({error})") from None

    def rest(self, guess: Floats) -> VehicleEquilibrium:
        """Equilibrium of a vehicle that came to rest at ``guess``.

        Raises StepFailed if a run lays out one of its chains otherwise.
        """
        if differ := self.lays_out_otherwise():
            raise StepFailed(f"{self._reason()} ({differ})")
        rest = self.as_equilibrium(guess)
        return rest._replace(sprockets=self.sprocket_wrenches(), tracks=self.tracks_at_rest())

    def lays_out_otherwise(self) -> str:
        """How a chain that is laid out at the last place, where it is now, differs from the one that came there."""
        differ = ""
        for chain in self.chains.values():
            followed, anew = chain.at_rest().tension, chain.tension_laid_out()
            if abs(anew - followed) > ACCEPTED * abs(followed):
                differ = f"a track that came there carries {followed:.6g} N, laid out there {anew:.6g} N"
        return differ

    def tracks_at_rest(self) -> list[TrackAtRest]:
        """Tracks at the last place, left and right."""
        found = [chain.at_rest() for _, chain in sorted(self.chains.items())]
        return found * 2 if self.half else found

    def _reason(self) -> str:
        return _reason(self._table, *self.pose)

    def guess_of(self, rest: VehicleEquilibrium) -> Floats:
        """Unknowns from an equilibrium, the inverse of ``as_equilibrium``."""
        return np.array([rest.height, rest.roll, rest.pitch, *rest.left, *(() if self.half else rest.right)])

    def as_equilibrium(self, guess: Floats) -> VehicleEquilibrium:
        """Equilibrium from the unknowns: height, roll, pitch of the hull, leaves left and right (half: left)."""
        height, roll, pitch, *leaves = guess.tolist()
        left = leaves[: self.leaves]
        right = left if self.half else leaves[self.leaves :]
        lateral = self.lateral + (self._hang - height) * sin(roll)  # road wheels keep their place across the tracks
        return VehicleEquilibrium(height, roll, pitch, left, right, lateral)

    def sprocket_wrenches(self) -> list[list[float]]:
        """Wrenches (left and right, 6) of the chains on the sprockets at the last place."""
        found = [chain.last_wrenches[-1] for _, chain in sorted(self.chains.items())]
        if self.half and found:
            return [found[0].tolist(), (found[0] * np.array(MIRRORED) + 0.0).tolist()]
        given = dict(zip(sorted(self.chains), found, strict=True))
        return [given[side].tolist() if side in given else [0.0] * WRENCH for side in range(2)]

    def accelerations(self, guess: Floats) -> Floats:
        """Accelerations of the free unknowns of a vehicle at rest at ``guess``, m/s2 and rad/s2.

        Raises StepFailed where a chain finds no equilibrium.
        """
        self.pose = float(guess[HEIGHT]), float(guess[PITCH])
        for k in self._joined:
            guess[LEAVES + k] = guess[LEAVES + k - 1]
        x = self.chassis.start_state(self.as_equilibrium(guess)._asdict())
        motions = _motions(self.chassis, x)
        wrenches = np.zeros((len(motions), len(motions[0]), WRENCH))
        for side, chain in self.chains.items():
            motions[side, :, 1] += (2.0 * side - 1.0) * self._plane
            wrenches[side] = chain.wheel_wrenches(motions[side], guess[ROLL], guess[PITCH])
        out = np.zeros_like(x)
        rates(self.chassis.tree, self.chassis.parts.contacts, None, x, wrenches.ravel(), out)
        n = len(self.chassis.tree.is_arm)
        out[9] += self.chassis.tree.gravity[0] + self.gravity[2]  # weight across the slope; that along it is balanced
        leaf_accelerations = out[ROOT + 2 * n : ROOT + 3 * n].reshape(2, -1)[:, : self.leaves].ravel()
        return np.array([out[9], out[10], out[11], *leaf_accelerations[: guess.size - LEAVES]])[self.unknowns]


class _ChainOnWheels:
    """A chain that is brought to rest on given wheels; the search begins at the last equilibrium.

    Cables stay upright; rigid links tilt, and begin where a run lays them out.
    """

    def __init__(self, kind: Any, track: FlexibleTrack, gravity: Vector) -> None:
        self._upright = kind is Cables
        self._model = kind({**track.config, "link_outputs": False})
        self._model.initialise(track.parameters)
        _, across, up = gravity
        self._lateral = across / up if up else 0.0  # lateral force on the wheels, over their vertical load
        wheels = self._model.wheel_list
        rims = (wheel for wheel in wheels if wheel["kind"] == "rim")
        radii = [wheel["radius"] if wheel["name"].startswith("road_wheel") else 0.0 for wheel in rims]
        self._grounded = {wheel["name"] for wheel in ground_wheels(track.config["vehicle"])}
        self._radius = np.array([*radii, 0.0])  # of road wheels, m; the sprocket is last here
        self._arm = 0.25 * self._model.vehicle["track"]["width"]  # lever of the two faces of a link, m
        self._last: tuple[Floats, Floats] = np.zeros((0, WIDTH)), np.zeros((0, WRENCH))  # rows, wrenches

    def wheel_wrenches(self, motions: Floats, roll: float, pitch: float) -> Floats:
        """Wrenches (wheels, 6) on the wheels and the sprocket with these motions (wheels, 13), y from the track."""
        rows = np.zeros((len(motions), WIDTH))
        if self._upright:
            motions = motions.copy()
            motions[:, 1], motions[:, 3:7] = 0.0, roll_pitch_quaternion(0.0, pitch)
        plain(read_states)(np.roll(motions, 1, axis=0).ravel(), LEVEL, rows)  # a track has its sprocket first
        rows[:, 3:9] = 0.0
        if not np.array_equal(rows, self._last[0]):
            if not (self._upright or len(self._last[0])):
                self._lay_out(rows)
            wrenches = self._rest_wrenches(rows)
            if self._upright and roll:  # each face has half of the stiffness
                lifted = self._rest_wrenches(rows + LIFT)
                wrenches[:, 3] = (lifted - wrenches)[:, 2] / LIFT[2] * self._arm**2 * roll
            if roll or self._lateral:
                self._add_lateral(wrenches)
            self._last = rows, wrenches
        return self._last[1]

    def _rest_wrenches(self, rows: Floats) -> Floats:
        self._model.find_equilibrium(rows)
        return np.roll(self._model.s.mean[: len(rows)], -1, axis=0)

    def _lay_out(self, rows: Floats) -> None:
        self._model.start_rows[:] = rows
        self._model.lay_out("rest", 0.0)

    @property
    def last_wrenches(self) -> Floats:
        """Wrenches (wheels, 6) at the last place, that on the sprocket last."""
        return self._last[1]

    def at_rest(self) -> TrackAtRest:
        """Tension, sag and wheel loads of the chain that followed its wheels to the last place."""
        model = self._model
        model.find_equilibrium(self._last[0])
        centres, (_, radii, _) = model.start_rows[:, [0, 2]], model.circles()
        borne = np.roll(self._radius, 1) > 0.0
        sag = sag_of_longest_span(centres, radii, borne, model.pins()[:, [0, 2]])
        loads = model.s.mean[: len(borne), 2]
        named = zip((wheel["name"] for wheel in model.wheel_list), loads.tolist(), borne, strict=True)
        others = {name: load for name, load, is_road in named if name in self._grounded and not is_road}
        return TrackAtRest(float(model.report[T_MEAN]), sag, loads[borne].tolist(), others)

    def tension_laid_out(self) -> float:
        """Mean tension, N, of the chain laid out at the last place as in a run."""
        self._lay_out(self._last[0])
        return float(self._model.report[T_MEAN])

    def _add_lateral(self, wrenches: Floats) -> None:
        """Add friction that makes up for lateral forces, at the rims of road wheels in proportion to their loads."""
        loads = np.where(self._radius > 0.0, wrenches[:, 2], 0.0)
        if loads.sum() <= 0.0:  # as drawn: the hull sinks first
            return
        lateral = (self._lateral * wrenches[:, 2].sum() - wrenches[:, 1].sum()) * loads / loads.sum()
        wrenches[:, 1] += lateral
        wrenches[:, 3] += self._radius * lateral


def _motions(chassis: Any, x: Floats) -> Floats:
    """Motions (sides, places, 13) of the places of a chassis in the state x."""
    sides, places = len(chassis.sides), len(chassis.tree.is_arm) // 2 + 1
    y = np.zeros(sides * places * STATE)
    put_sides(chassis.tree, x, sides, y, 0)
    return y.reshape(sides, places, STATE)


def _solve(vehicle: VehicleOnChains, guess: Floats) -> Floats:
    """Unknowns at rest by pseudo-transient continuation from ``guess``; raises StepFailed without convergence."""
    unknowns, size = vehicle.unknowns, len(vehicle.unknowns)
    residual, step = vehicle.accelerations(guess), FIRST_STEP
    for _ in range(MAX_STEPS):
        slopes = np.stack([_slope(vehicle, guess, residual, i) for i in unknowns], axis=1)
        change = solved(np.eye(size) / step**2 - slopes, residual)
        while abs(change).max() > LARGEST_CHANGE:
            step *= 0.5
            change = solved(np.eye(size) / step**2 - slopes, residual)
        before = _norm(residual)
        guess, residual = _moved(vehicle, guess, change, before if step > NEWTON else np.inf)
        if abs(residual).max() < REST_ACCELERATION:
            return guess
        step = min(step * np.clip(before / _norm(residual), 1.5, 10.0), LAST_STEP)
    raise StepFailed(f"accelerations of {abs(residual).max():.3g} m/s2 are left after {MAX_STEPS} steps")


def _slope(vehicle: VehicleOnChains, guess: Floats, residual: Floats, unknown: int) -> Floats:
    """Derivative of the accelerations by an unknown, to the other side where a chain finds no rest on the first one."""
    for difference in (DIFFERENCE, -DIFFERENCE):
        shifted = guess.copy()
        shifted[unknown] += difference
        with suppress(StepFailed):
            return (vehicle.accelerations(shifted) - residual) / difference
    return vehicle.accelerations(shifted)  # which raises


def _moved(vehicle: VehicleOnChains, guess: Floats, change: Floats, most: float) -> tuple[Floats, Floats]:
    """Guess and accelerations after a change, or after a share of it: chains rest, accelerations below ``most``."""
    share, found = 1.0, None
    while share >= LEAST_SHARE and (found is None or _norm(found[1]) > most):
        moved = guess.copy()
        moved[vehicle.unknowns] += share * change
        share *= 0.5
        with suppress(StepFailed):
            found = moved, vehicle.accelerations(moved)
    return found or (moved, vehicle.accelerations(moved))  # which raises


def _norm(values: Floats) -> float:
    return float(np.sqrt((values * values).sum()))
