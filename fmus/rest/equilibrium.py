"""Static equilibrium of a vehicle: hull, road arms, idlers, chains and ground at rest (build side).

The unknowns are height, roll and pitch of the hull and the coordinates of the leaves. They place the wheels; each chain
is brought to its own static equilibrium on these wheels (in which a track starts); with the wrenches of the chains the
chassis has accelerations, which must vanish. Friction has no influence: regularised friction is zero at rest.

The chains are of one kind for all kinds of links of the scene, so that all kinds start in the same place: rigid links,
beams and cables of steel differ by 1.4 um in height and by 0.02 % in wheel loads. They are cables in an upright plane,
whose links resist a roll of the wheels as springs side by side (``_ChainOnWheels``). From the place that they give, a
hull that leans goes on with rigid links, which tilt between the wheels and the ground. Friction of the ground and of
the rims, which creeps, balances the lateral forces of tilted wheels and of a side slope; the road wheels stand over the
middle of the tracks, or on a side slope at their guides.

Method: Newton with an inertia term over the square of a pseudo step that grows as the accelerations fall
(pseudo-transient continuation: Kelley and Keyes, SIAM J. Numer. Anal. 35(2), 1998, doi 10.1137/S0036142996304796); the
Jacobian is computed by finite differences.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fmus.cache.files import cached_result
from fmus.cache.sources import source_hash
from fmus.chassis.dynamics import ROOT, is_fixed, rates
from fmus.chassis.model import Model as Chassis
from fmus.chassis.model import stations
from fmus.chassis.observe import put_sides
from fmus.driver.skid import footing
from fmus.interface.model import InvalidParameter, StepFailed
from fmus.interface.numbers import packed
from fmus.interface.ports import STATE, WRENCH
from fmus.kernels.jit import plain
from fmus.physics.arrays import Floats, Vector
from fmus.physics.chain.report import T_MEAN
from fmus.physics.elementary import sin
from fmus.physics.elimination import solved
from fmus.physics.vector import scale
from fmus.physics.wheels import WIDTH, read_states
from fmus.rest.tensioning import without_motion
from fmus.start import LEVEL, Stance, StartPose, ground_level, roll_pitch_quaternion, stance
from fmus.track_flexible.model import Model as Cables
from fmus.track_rigid.model import Model as RigidLinks
from fmus.vehicles.tables import BadInput

FIRST_STEP, LAST_STEP = 0.05, 1e6  # pseudo steps, s
LARGEST_CHANGE = 0.05  # largest change of an unknown in a pseudo step, m or rad
DIFFERENCE = 1e-6  # finite difference for the Jacobian, m or rad
REST_ACCELERATION = 1e-4  # largest acceleration that counts as rest, m/s2 or rad/s2: 0.04 N on an idler
MOST_STEPS = 60  # pseudo steps
LIFT = np.eye(WIDTH)[2] * 1e-5  # lift of all wheels, m: the loss of load gives the vertical stiffness
LEANS = 1e-7  # roll of a hull from which its chains tilt, rad: 0.3 um between the tracks
ACCEPTED = 1e-3  # relative difference of tensions of a chain that followed its wheels and of one laid out there
MIRRORED = 1.0, -1.0, 1.0, -1.0, 1.0, -1.0  # signs of a wrench on the other side
HEIGHT, ROLL, PITCH, LEAVES = 0, 1, 2, 3  # indices of the unknowns


class VehicleEquilibrium(NamedTuple):
    """Coordinates of hull and leaves at rest, from the drawn position."""

    height: float  # of the hull's centre of mass, m
    roll: float  # rad
    pitch: float  # rad
    left: Sequence[float]  # arm angles from the front, rad, then the idler's slide, m
    right: Sequence[float]  # likewise
    lateral: float = 0.0  # of the hull, m: on a side slope it has slid until guides touch
    # force, N, and torque, N m, of each track on its sprocket, left and right, in the vehicle; 0 without a track
    sprockets: Sequence[Sequence[float]] = ()


class FlexibleTrack(NamedTuple):
    """Track of the vehicle, modelled with flexible links."""

    config: Mapping[str, Any]  # of a flexible track
    parameters: Mapping[str, Any]  # those that differ from the defaults: how the loop is closed, the pose on a slope


def equilibrium(
    chassis: Mapping[str, Any], tracks: Mapping[str, FlexibleTrack], slope: tuple[float, float] = (0.0, 0.0)
) -> VehicleEquilibrium:
    """Static equilibrium of a chassis, given by its config, on tracks by side ("left", "right").

    ``slope``: pitch and roll of the ground under the vehicle, rad; the result is relative to it. With equal sides and a
    hull that does not lean sideways, only the left half is solved. The result is cached for this build. Raises
    BadInput.
    """
    # what the search reads: of rigid links, on which a hull may lean, also friction
    leans = slope[1] != 0.0 or is_asymmetric(chassis, tuple(tracks))
    uneven = any("terrain" in track.config["track"] for track in tracks.values())
    if not (leans or uneven or chassis["chassis"].get("ground")):
        chassis = {**chassis, "vehicle": without_motion(chassis["vehicle"])}
        tracks = {
            side: track._replace(config={**track.config, "vehicle": without_motion(track.config["vehicle"])})
            for side, track in tracks.items()
        }
    read = {
        side: (packed(track.config, Cables.reads(track.config)), track.parameters) for side, track in tracks.items()
    }
    request = [source_hash(), packed(chassis, Chassis.reads(chassis)), read, slope]
    try:
        solution = cached_result("places", "equilibrium", request, lambda: _at_rest(chassis, tracks, slope))
    except (InvalidParameter, StepFailed) as error:
        raise BadInput(f"the vehicle's equilibrium was not found, start.state = 'drawn' needs none: {error}") from None
    return VehicleEquilibrium(*solution)


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
    """Whether the two sides carry different loads, so that the hull rolls."""
    vehicle = chassis["vehicle"]
    return len(tracks) == 1 or vehicle["chassis"]["centre"][1] != 0.0 or bool(vehicle.get("right"))


def _at_rest(
    chassis: Mapping[str, Any], tracks: Mapping[str, FlexibleTrack], slope: tuple[float, float]
) -> VehicleEquilibrium:
    """Solve, and compare the chains with those of a run, which are laid out anew; raises StepFailed with a reason."""
    vehicle = _Vehicle(Cables, chassis, tracks, slope)
    try:
        guess = _solve(vehicle, vehicle.start())
        if abs(guess[ROLL]) > LEANS or vehicle.gravity[1]:
            vehicle = _Vehicle(RigidLinks, chassis, tracks, slope)
            guess = _solve(vehicle, guess)
        for chain in vehicle.chains.values():
            followed, anew = chain.tensions()
            if abs(anew - followed) > ACCEPTED * abs(followed):
                raise StepFailed(f"a track that came there carries {followed:.6g} N, laid out there {anew:.6g} N")
    except StepFailed as error:
        raise StepFailed(f"{_reason(chassis['vehicle'], *vehicle.pose)} ({error})") from None
    return vehicle.as_equilibrium(guess)._replace(sprockets=vehicle.sprocket_wrenches())


def _reason(vehicle: Mapping[str, Any], height: float, pitch: float) -> str:
    """Why a vehicle does not come to rest, from its table and the hull's rise, m, and pitch, rad, at the end."""
    ahead, wheels, idler = footing(vehicle)[1], vehicle["road_wheel"]["x"], vehicle["idler"]
    if not min(wheels) <= ahead <= max(wheels):
        which = "ahead of its foremost" if ahead > max(wheels) else "behind its hindmost"
        beyond = max(ahead - max(wheels), min(wheels) - ahead)
        return f"its centre of mass is {beyond:.2f} m {which} road wheel, so it tips over"
    text = f"it has sagged by {-1e3 * height:.0f} mm and pitched by {pitch * 180.0 / np.pi:.1f} degrees"
    made_for = vehicle["sprocket"].get("pitch") or vehicle["track"]["pitch"]
    radius = 0.5 * made_for / sin(np.pi / vehicle["sprocket"]["teeth"]) - vehicle["track"]["face"]
    for name, x, bottom in ("sprocket", 0.0, -radius), ("idler", idler["x"], idler["z"] - idler["radius"]):
        room = bottom - 2.0 * vehicle["track"]["face"] - ground_level(vehicle)
        if height - sin(pitch) * (x - vehicle["chassis"]["centre"][0]) < -room:
            return f"{text}: the {name}, whose track is {1e3 * room:.0f} mm above the ground as drawn, presses it in"
    return text


class _Vehicle:
    """Chassis and chains of a vehicle: its accelerations at given values of the unknowns."""

    def __init__(
        self, kind: Any, chassis: Mapping[str, Any], tracks: Mapping[str, FlexibleTrack], slope: tuple[float, float]
    ) -> None:
        pitch, roll = slope
        down = StartPose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, pitch, roll).down()
        self.gravity: Vector = scale(float(chassis["vehicle"]["gravity"]), down)
        across = self.gravity[1] / chassis["vehicle"]["gravity"] if chassis["vehicle"]["gravity"] else 0.0
        self.lateral = float(np.sign(across)) * chassis["vehicle"]["guide"]["clearance"]
        uneven = any("terrain" in track.config["track"] for track in tracks.values())
        self.half = roll == 0.0 and not uneven and not is_asymmetric(chassis, tuple(tracks))
        sides = ["left"] if self.half else ["left", "right"]
        self.chassis = Chassis({**chassis, "chassis": {**chassis["chassis"], "sides": sides}})
        self.chassis.initialise({})
        self.leaves = len(chassis["vehicle"]["road_wheel"]["x"]) + 1  # with a coordinate, on a side
        self.pose = 0.0, 0.0  # last height, m, and pitch, rad, of the hull
        self._plane = chassis["vehicle"]["track"]["lateral"]
        self._hang = chassis["vehicle"]["road_wheel"]["z"] - chassis["vehicle"]["chassis"]["centre"][2]
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

    def tensions(self) -> tuple[float, float]:
        """Mean tension, N, on the last wheels, of the chain that followed them and laid out there as in a run."""
        self._model.find_equilibrium(self._last[0])
        followed = float(self._model.report[T_MEAN])
        self._lay_out(self._last[0])
        return followed, float(self._model.report[T_MEAN])

    def _add_lateral(self, wrenches: Floats) -> None:
        """Add friction that makes up for lateral forces, at the rims of road wheels in proportion to their loads."""
        loads = np.where(self._radius > 0.0, wrenches[:, 2], 0.0)
        lateral = (self._lateral * wrenches[:, 2].sum() - wrenches[:, 1].sum()) * loads / loads.sum()
        wrenches[:, 1] += lateral
        wrenches[:, 3] += self._radius * lateral


def _motions(chassis: Any, x: Floats) -> Floats:
    """Motions (sides, places, 13) of the places of a chassis in the state x."""
    sides, places = len(chassis.sides), len(chassis.tree.is_arm) // 2 + 1
    y = np.zeros(sides * places * STATE)
    put_sides(chassis.tree, x, sides, y, 0)
    return y.reshape(sides, places, STATE)


def _solve(vehicle: _Vehicle, guess: Floats) -> Floats:
    """Unknowns at rest by pseudo-transient continuation from ``guess``; raises StepFailed without convergence."""
    unknowns, size = vehicle.unknowns, len(vehicle.unknowns)
    residual, step = vehicle.accelerations(guess), FIRST_STEP
    for _ in range(MOST_STEPS):
        slopes = np.empty((size, size))
        for k, i in enumerate(unknowns):
            shifted = guess.copy()
            shifted[i] += DIFFERENCE
            slopes[:, k] = (vehicle.accelerations(shifted) - residual) / DIFFERENCE
        change = solved(np.eye(size) / step**2 - slopes, residual)
        while abs(change).max() > LARGEST_CHANGE:
            step *= 0.5
            change = solved(np.eye(size) / step**2 - slopes, residual)
        guess[unknowns] += change
        before, residual = np.sqrt((residual * residual).sum()), vehicle.accelerations(guess)
        if abs(residual).max() < REST_ACCELERATION:
            return guess
        step = min(step * np.clip(before / np.sqrt((residual * residual).sum()), 1.5, 10.0), LAST_STEP)
    raise StepFailed(f"accelerations of {abs(residual).max():.3g} m/s2 are left after {MOST_STEPS} steps")
