"""Figures of a vehicle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fmus.ground.tables import is_plane
from fmus.vehicles.sides import SIDES, of_side, way_a_turn
from fmus.vehicles.tables import LOGGED
from fmus.vehicles.vehicle import VehicleTable
from orchestrator.log.reader import Missing
from orchestrator.results.analyses import hull
from orchestrator.results.analyses import slip as slips
from orchestrator.results.figures import SIDE, Shown, figure
from orchestrator.results.ground_under_vehicle import component, ground_axes, pose_signals, pressed_by
from orchestrator.results.run_data import BLOCK, EVER, RunData, Window, drive_of, mean, sprocket_end, track_of, vectors

RUN_REACH = 0.2  # m: half length of the sample in the middle between two wheels, or two pitches of short links
LOWER = -0.1  # m over the sprocket axle: the lower run is below it, or below half the height of small road wheels


@figure("m", Shown("distance along the start heading", "m", 5, on="vehicle", whole=True), whole=True)
def distance(run: RunData, of: str, window: Window) -> float:
    """Distance along the heading of the start, m."""
    return run.ends("chassis.distance")[1]


@figure("m/s", Shown("speed", "m/s", on="moving"))
def speed(run: RunData, of: str, window: Window) -> float:
    """Mean speed of the vehicle, or of the chain of a bench or rig, m/s."""
    return run.mean("chassis.speed" if run.has("chassis.speed") else f"{run.tracks[0]}.speed", window)


@figure("m", Shown("settlement", "mm", on="vehicle"), none="on uneven ground, as it counts from the first")
def settlement(run: RunData, of: str, window: Window) -> float:
    """How far the hull is below its drawn place, m."""
    if not is_plane(run.scene.get("ground") or {}):
        raise Missing("settlement is not known on uneven ground: it counts from that of the start")
    return run.mean("chassis.settlement", window)


@figure("m")
def settlement_of_springs(run: RunData, of: str, window: Window) -> float:
    """Share of the springs in the settlement: mean rise of the road wheels in the hull, m.

    The rise counts from the drawn position, along the normal of the ground under the vehicle.
    """
    vehicle, drawn = run.scene["vehicle"], run.scene["vehicle"]["road_wheel"]
    wheels = [f"{side}.road_wheel[{i + 1}].position" for side in run.sides for i in range(len(drawn["x"]))]
    t, _ = run.signal("chassis.yaw", window)
    place, *above = (run.vectors("chassis", "out", name, window=window)[1] for name in ("chassis.position", *wheels))
    up = ground_axes(run, np.stack([run.signal(name, window)[1] for name in pose_signals(run)], axis=1)).up
    rise = np.mean([component(wheel - place, up) for wheel in above], axis=0)
    return mean(t, rise) - (float(np.mean(drawn["z"])) - vehicle["chassis"]["centre"][2])


@figure("m", none="on uneven ground")
def settlement_of_contacts(run: RunData, of: str, window: Window) -> float:
    """Share of the contacts in the settlement: wheels into the chain, chain into the ground, m."""
    return settlement(run, of, window) - settlement_of_springs(run, of, window)


@figure("N", Shown("ground carries", "kN", 5, on="vehicle"))
def ground_force(run: RunData, of: str, window: Window) -> float:
    """Mean vertical ground reaction of all tracks, and of the chassis where it has ground contact, N."""
    touching = [name for name in (*run.tracks, "chassis") if run.has(f"{name}.ground.force.z")]
    return sum(run.copies(name) * run.mean(f"{name}.ground.force.z", window) for name in touching)


@figure("N", none="on level ground")
def uphill_force(run: RunData, of: str, window: Window) -> float:
    """Mean force of the ground on all tracks up the slope of ``ground.grade`` and ``ground.bank``, N.

    At constant speed it is the weight's component along the slope.
    """
    table = run.scene.get("ground") or {}
    grade, bank = table.get("grade") or 0.0, table.get("bank") or 0.0
    steepness = float(np.hypot(grade, bank))
    if steepness == 0.0:
        raise Missing("the ground is not inclined: it has neither grade nor bank")
    uphill = np.array([grade, bank, steepness**2]) / (steepness * np.hypot(1.0, steepness))
    force = np.zeros(3)
    for name in run.tracks:
        force += run.copies(name) * np.array([run.mean(f"{name}.ground.force.{axis}", window) for axis in "xyz"])
    return float(force @ uphill)


@figure("N", Shown("weight", "kN", 5, on="vehicle", whole=True), whole=True)
def weight(run: RunData, of: str, window: Window) -> float:
    """Weight of all bodies, N."""
    sides, table = run.scene["tracks"], VehicleTable.model_validate(run.scene["vehicle"], context=LOGGED)
    return table.gravity * table.total_mass(sides)


@figure("m", of=SIDE, none="on hard ground")
def rut_depth(run: RunData, of: str, window: Window) -> float:
    """Depth of the deepest link of a track, or of all, in the soil, m."""
    return max(float(pressed_by(run, track, window).depth.max(initial=0.0)) for track in hull.tracks(run, of))


class StopForce(NamedTuple):
    """Largest force of a stop of the suspension."""

    most: float  # N, 0 where no stop is hit
    stop: str  # name, ``left.bump_stop[1]``
    t: float  # s

    @property
    def place(self) -> str:
        """Words for where and when."""
        return f"at {self.stop} at {self.t:.4g} s" if self.most else "(none is hit)"


def stop_forces(run: RunData, of: str = "", window: Window = EVER) -> StopForce:
    """Largest force of a bump or rebound stop of a side or of both; raises Missing for a vehicle without stops."""
    found = [
        StopForce(float(values.max()), name, float(t[values.argmax()]))
        for side in ([of] if of else SIDES)
        for kind in ("bump_stop", "rebound_stop")
        for k in range(1, len(run.scene["vehicle"]["road_wheel"]["x"]) + 1)
        if run.has(f"chassis.{(name := f'{side}.{kind}[{k}]')}.force")
        for t, values in [run.signal(f"chassis.{name}.force", window)]
        if values.size
    ]
    if not found:
        raise Missing("the vehicle has no stops")
    return max(found, key=lambda each: each.most)


@figure(
    "N",
    Shown("largest force of a stop", "kN", on="stops", whole=True, place=lambda run: stop_forces(run).place),
    of=SIDE,
    none="for a vehicle without stops",
)
def stop_force(run: RunData, of: str, window: Window) -> float:
    """Largest force of a bump or rebound stop, N."""
    return stop_forces(run, of, window).most


@figure("m", Shown("largest recoil stroke", "mm", on="recoil", whole=True), of=SIDE, none="for a vehicle without one")
def recoil_stroke(run: RunData, of: str, window: Window) -> float:
    """Largest way that a recoil spring gives, m."""
    owners = ("", *(f"{name}." for name in run.entry("vehicle", "wheel", default=())))
    names = [f"chassis.{side}.{owner}recoil.stroke" for side in ([of] if of else SIDES) for owner in owners]
    strokes = [float(run.signal(name, window)[1].max()) for name in names if run.has(name)]
    if not strokes:
        raise Missing("the vehicle has no recoil")
    return max(strokes)


@figure("1", Shown("slip", "%", 2, on="straight"), of=SIDE, none="where they stand")
def slip(run: RunData, of: str, window: Window) -> float:
    """Slip 1 - v/V, V a pitch a pin; positive where tracks drive, either way."""
    found = slips.of(run, window, of)
    return _share(slips.ratio(found.t, found.pitched, found.lag))


@figure("1", Shown("slip of the pads", "%", 2, on="straight"), of=SIDE)
def pad_slip(run: RunData, of: str, window: Window) -> float:
    """Velocity of the pads on the ground, weighted by load, over the chain speed; the rest as ``slip``."""
    found = slips.of(run, window, of)
    return _share(slips.ratio(found.t, found.chain, found.pads))


@figure("1")
def speed_excess(run: RunData, of: str, window: Window) -> float:
    """Mean vehicle speed over pins a turn x pitch x omega / 2 pi, less 1: minus ``slip``, without yaw or pose.

    The sprocket is a polygon: its chain's speed rises and falls by some 2 % as each pin enters, but the mean stays
    one pitch a pin. With pads on the line of the pins the hull runs at that mean less the slip, at -0.2 %. Pads lie
    29 mm below the pins, though, and road wheels rock each loaded link forward about its pad: the hull runs ahead, by
    1.4 % with contact spread along the link, by 2.4 % where two points bear it. So 0 to 5 % is that band and as much
    again: a vehicle below it spins its tracks, one beyond it is not driven by its teeth. It cannot tell contact models
    apart.
    """
    vehicle = run.scene["vehicle"]
    omega = np.mean([run.mean(f"{drive_of(run, side)}.speed", window) for side in run.sides])
    kinematic = way_a_turn(vehicle) * omega / (2 * np.pi)
    if abs(kinematic) < slips.SLOWEST:
        raise Missing("the sprockets stand")
    return run.mean("chassis.speed", window) / float(kinematic) - 1.0


@figure("N", of=SIDE, none="with further wheels in them")
def tension_top(run: RunData, of: str, window: Window) -> float:
    """Mean tension of the upper run, N; of one side or of all tracks."""
    return _run_tension(run, of, window, "top")


@figure("N", of=SIDE)
def tension_rear(run: RunData, of: str, window: Window) -> float:
    """Mean tension between the last road wheel and the wheel behind it, N: with the sprocket in front, the idler."""
    return _run_tension(run, of, window, "rear")


@figure("N", of=SIDE)
def tension_front(run: RunData, of: str, window: Window) -> float:
    """Mean tension between the first road wheel and the wheel ahead of it, N: the sprocket, or the idler."""
    return _run_tension(run, of, window, "front")


@figure("1", every_step=True)
def third_law(run: RunData, of: str, window: Window) -> float:
    """Impulse of the tracks on their wheels less that received by the chassis, over the sum of magnitudes.

    It needs every step. The sprockets' share passes through the drives, which transmit the whole force.
    """
    given, received, size = np.zeros(3), np.zeros(3), 0.0
    track_outputs = [(port.giver, f"{port.giver_connector}.force") for port in run.ports if port.giver in run.tracks]
    chassis_inputs = [("chassis", f"{port.taker_connector}.force") for port in run.ports if port.taker == "chassis"]
    topics = sorted({f"/{name}/out" for name, _ in track_outputs} | {f"/{name}/in" for name, _ in chassis_inputs})
    for block in run.log.blocks(topics, BLOCK):
        for name, connector in track_outputs:
            series = block[f"/{name}/out"]
            inside = (series.t > window.start + 1e-9) & (series.t <= window.end + 1e-9)
            force = vectors(series, name, connector)[inside]
            given += force.sum(axis=0)
            size += float(np.abs(force).sum())
        for name, connector in chassis_inputs:
            series = block[f"/{name}/in"]
            inside = (series.t >= window.start - 1e-9) & (series.t < window.end - 1e-9)
            received += vectors(series, name, connector)[inside].sum(axis=0)
    return float(np.linalg.norm(given - received) / size)


def _run_tension(run: RunData, of: str, window: Window, where: str) -> float:
    means = []
    for track in (track_of(run, of),) if of else run.tracks:
        vehicle = of_side(run.scene["vehicle"], track.removesuffix("_track"))
        if vehicle.get("wheel") or not sprocket_end(run.scene):
            raise Missing(
                "the parts of this circuit have other names: the analysis links by place has the tension in each"
            )
        first, last, idler = vehicle["road_wheel"]["x"][0], vehicle["road_wheel"]["x"][-1], vehicle["idler"]["x"]
        sample, height = min(RUN_REACH, 2.0 * vehicle["track"]["pitch"]), np.max(vehicle["road_wheel"]["z"])
        middle, reach = {
            "top": (idler / 2, abs(idler) / 2 - 2 * sample),
            "rear": ((last + min(idler, 0.0)) / 2, sample),
            "front": ((first + max(idler, 0.0)) / 2, sample),
        }[where]
        links = run.links(track, window)
        forward, up = links.middles()
        split = height if where == "top" else max(LOWER, 0.5 * height)
        inside = (np.abs(forward - middle) < reach) & ((up > split) if where == "top" else (up < split))
        means.append(mean(links.t, links.tension, inside))
    return float(np.mean(means))


def _share(slip: float) -> float:
    """A slip; raises Missing if it is none."""
    if np.isnan(slip):
        raise Missing("the chain stands: there is no share of its speed; track_slip is the pads' velocity")
    return slip
