"""Measures of a run that combine several signals; the checks of scenes refer to them by name.

A measure is a function ``measure(run, of, window) -> float``; ``of`` is a side ("left", "right"), a span, or empty.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fmus.ground.keys import is_plane
from fmus.vehicles.sides import of_side
from orchestrator.results import turning
from orchestrator.results.analyses import hull
from orchestrator.results.analyses import slip as slips
from orchestrator.results.energy import drift, ledger, ports
from orchestrator.results.ground_under_vehicle import component, ground_axes, pose_signals, pressed_by
from orchestrator.results.run_data import (
    BLOCK,
    EVER,
    Floats,
    Links,
    Missing,
    RunData,
    Window,
    mean,
    pitch_radius,
    sprocket_end,
    vectors,
)

Measure = Callable[[RunData, str, Window], float]

SPAN_MARGIN = 0.25  # of the axle distance: links of a span keep this distance from both axles
RUN_REACH = 0.2  # m: half length of the sample in the middle between two wheels, or two pitches of short links
LOWER = -0.1  # m over the sprocket axle: the lower run is below it, or below half the height of small road wheels


REDUCTIONS: dict[str, Callable[[Floats, Floats], float]] = {
    "mean": mean,
    "min": lambda t, values: values.min(),
    "max": lambda t, values: values.max(),
    "last": lambda t, values: values[-1],
    "drop": lambda t, values: values[0] - values[-1],
    "ripple": lambda t, values: np.ptp(values) / abs(mean(t, values)),  # peak to peak over the mean
    "rms": lambda t, values: mean(t, values**2) ** 0.5,
}


def reduce(t: Floats, values: Floats, how: str) -> float:
    """Reduce the samples of a window to one number; a mean weights each by the time since the last one."""
    return float(REDUCTIONS[how](t, values))


# --- chain between pins ----------------------------------------------------------------------------


def sag(run: RunData, of: str, window: Window) -> float:
    """Depth of the lowest pin below the highest, m."""
    links = run.links(of or run.tracks[0], window)
    return mean(links.t, links.up.max(axis=1) - links.up.min(axis=1))


def end_tension(run: RunData, of: str, window: Window) -> float:
    """Force in the pin at the end of a hanging chain (the largest of all pins), N."""
    t, forces = _joint_forces(run, of, window)
    return mean(t, forces.max(axis=1))


# --- free chains -----------------------------------------------------------------------------------


def joint_force(run: RunData, of: str, window: Window) -> float:
    """Mean force in the pins, N."""
    return mean(*_joint_forces(run, of, window))


def joint_force_spread(run: RunData, of: str, window: Window) -> float:
    """Largest difference between the force in a pin, at any instant, and the mean, over the mean."""
    t, forces = _joint_forces(run, of, window)
    return float(np.abs(forces / mean(t, forces) - 1.0).max())


def hoop_strain(run: RunData, of: str, window: Window) -> float:
    """Mean strain of the chords between the pins of a loop."""
    links = run.links(of or run.tracks[0], window)
    chords = np.hypot(*(np.roll(x, -1, axis=1) - x for x in (links.forward, links.up)))
    return mean(links.t, chords / run.scene["vehicle"]["track"]["pitch"] - 1.0)


def fall_time(run: RunData, of: str, window: Window) -> float:
    """Time of the largest drop of a free end over sqrt(2 L/g), L chain length; NaN if it falls on."""
    t, drop, length, gravity = _fall(run, of, window)
    k = int(drop.argmax())
    if not 0 < k < len(t) - 1:
        return float("nan")
    top = np.polynomial.Polynomial.fit(t[k - 1 : k + 2], drop[k - 1 : k + 2], 2).deriv().roots()[0]
    return float(top / np.sqrt(2.0 * length / gravity))


def half_fall_time(run: RunData, of: str, window: Window) -> float:
    """Time at which a free end has dropped by L/2, over sqrt(L/g), L chain length."""
    t, drop, length, gravity = _fall(run, of, window)
    k = int(drop.argmax()) + 1
    half = np.interp(0.5 * length, drop[:k], t[:k], right=np.nan)
    return float(half / np.sqrt(length / gravity))


def behind_free_fall(run: RunData, of: str, window: Window) -> float:
    """Largest height of the free end above a free fall, until its largest drop, m; 0 if always below."""
    t, drop, _, gravity = _fall(run, of, window)
    k = int(drop.argmax()) + 1
    return float(max(0.0, (0.5 * gravity * t[1:k] ** 2 - drop[1:k]).max()))


# --- chain over a sprocket -------------------------------------------------------------------------


def pins_passed(run: RunData, of: str, window: Window) -> float:
    """Pins that pass the outer end of the sprocket, forward positive, counted with the fraction of a pitch."""
    links, end = run.links(_track(run, of), window), sprocket_end(run.scene)
    outwards = end * links.forward
    angle = np.arctan2(links.up, outwards)
    radius = np.hypot(links.up, outwards)
    near = (outwards > 0) & (radius < 1.5 * pitch_radius(run.scene["vehicle"]))
    above = np.where(near & (angle >= 0), angle, np.inf).argmin(axis=1)  # next pin
    below = np.where(near & (angle < 0), angle, -np.inf).argmax(axis=1)  # last pin
    rows = np.arange(len(above))
    a, b = angle[rows, above], angle[rows, below]
    pins = angle.shape[1]
    towards = np.where((below - above) % pins == 1, 1.0, -1.0)  # links numbered along or against forward motion
    place = above + towards * a / (a - b)
    path = np.unwrap(place, period=pins)
    return float(-end * towards[0] * (path[-1] - path[0]))


def pins_per_revolution(run: RunData, of: str, window: Window) -> float:
    """Pins passed per revolution of the sprocket against its mount; raises Missing if it turns by less than a tooth."""
    t = run.links(_track(run, of), window).t
    times, angle = run.signal(f"{_drive(run, of)}.angle", EVER)
    turned = np.interp(t[[0, -1]], times, angle)
    revolutions = float((turned[1] - turned[0]) / (2 * np.pi))
    if abs(revolutions) * run.scene["vehicle"]["sprocket"]["teeth"] < 1.0:
        raise Missing("the sprocket turns by less than a tooth")
    return pins_passed(run, of, window) / revolutions


def chain_speed_ratio(run: RunData, of: str, window: Window) -> float:
    """Mean chain speed over pins passed times pitch over time; raises Missing if less than a pin passes."""
    track = _track(run, of)
    t = run.links(track, window).t
    if abs(pins := pins_passed(run, of, window)) < 1.0:
        raise Missing("less than a pin passes the sprocket")
    by_pins = pins * run.scene["vehicle"]["track"]["pitch"] / (t[-1] - t[0])
    return run.mean(f"{track}.speed", window) / float(by_pins)


def polygon_ripple(run: RunData, of: str, window: Window) -> float:
    """First tooth harmonic of the speed of a chain end over its mean, by least squares.

    The fit covers whole tooth periods. ``of`` is the end: "upper" (default) or "lower". Fitted to the position of the
    end pin, x(t) = a + v t + sum of c_k cos(k w t) + s_k sin(k w t), k = 1..3; the amplitude of the speed is w |(c_1,
    s_1)|.
    """
    track = run.tracks[0]
    w = run.scene["vehicle"]["sprocket"]["teeth"] * run.mean(f"{_drive(run, '')}.speed", window)
    period = 2 * np.pi / abs(w)
    whole = np.floor((window.end - window.start) / period + 1e-9)
    links = run.links(track, window)
    inside = links.t < links.t[0] + whole * period - 1e-9
    t, ends = links.t[inside], links.up[0, [0, -1]]
    end = [0, -1][int(ends.argmin() if of == "lower" else ends.argmax())]
    x = links.forward[inside, end]
    waves = [f(k * w * t) for k in (1, 2, 3) for f in (np.cos, np.sin)]
    basis = np.stack([np.ones_like(t), t - t.mean(), *waves], axis=1)
    fit = np.linalg.lstsq(basis, x, rcond=None)[0]
    return float(abs(w) * np.hypot(fit[2], fit[3]) / abs(fit[1]))


def span_tension(run: RunData, of: str, window: Window) -> float:
    """Mean tension of the "upper" or "lower" span between sprocket and idler of a rig, N."""
    links = run.links(run.tracks[0], window)
    distance = run.scene["rig"]["axle_distance"]
    forward, up = _middles(links)
    free = (forward < -SPAN_MARGIN * distance) & (forward > -(1 - SPAN_MARGIN) * distance)
    return mean(links.t, links.tension, free & ((up > 0) if of == "upper" else (up < 0)))


def span_moment_ratio(run: RunData, of: str, window: Window) -> float:
    """(T_upper - T_lower) x teeth x pitch / 2 pi over the mean torque of the drive on the sprocket."""
    vehicle = run.scene["vehicle"]
    arm = vehicle["sprocket"]["teeth"] * vehicle["track"]["pitch"] / (2 * np.pi)
    difference = span_tension(run, "upper", window) - span_tension(run, "lower", window)
    return difference * arm / run.mean(f"{_drive(run, of)}.torque", window)


def tight_span_enters(run: RunData, of: str, window: Window) -> float:
    """1 if the tighter span runs into the sprocket, -1 if it leaves it."""
    difference = span_tension(run, "upper", window) - span_tension(run, "lower", window)
    return float(np.sign(difference * run.mean(f"{_drive(run, of)}.speed", window)))  # the upper span enters if forward


# --- vehicle ---------------------------------------------------------------------------------------


def ground_force(run: RunData, of: str, window: Window) -> float:
    """Mean vertical ground reaction of all tracks, and of the chassis where it has ground contact, N."""
    touching = [name for name in (*run.tracks, "chassis") if run.has(f"{name}.ground.force.z")]
    return sum(run.copies(name) * run.mean(f"{name}.ground.force.z", window) for name in touching)


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


def slip(run: RunData, of: str, window: Window) -> float:
    """Slip 1 - v/V, V a pitch a tooth; positive where tracks drive, either way; raises Missing where they stand."""
    found = slips.of(run, window, of)
    return _share(slips.ratio(found.t, found.pitched, found.lag))


def pad_slip(run: RunData, of: str, window: Window) -> float:
    """Velocity of the pads on the ground, weighted by load, over the chain speed; the rest as ``slip``."""
    found = slips.of(run, window, of)
    return _share(slips.ratio(found.t, found.chain, found.pads))


def speed_excess(run: RunData, of: str, window: Window) -> float:
    """Mean vehicle speed over teeth x pitch x omega / 2 pi, less 1: the other sign of ``slip``; needs no yaw or pose.

    The sprocket is a polygon: its chain's speed rises and falls by some 2 % as each tooth passes, but the mean stays
    one pitch a tooth. With pads on the line of the pins the hull runs at that mean less the slip, at -0.2 %. Pads lie
    29 mm below the pins, though, and road wheels rock each loaded link forward about its pad: the hull runs ahead, by
    1.4 % with contact spread along the link, by 2.4 % where two points bear it. So 0 to 5 % is that band and as much
    again: a vehicle below it spins its tracks, one beyond it is not driven by its teeth. It cannot tell contact models
    apart.
    """
    vehicle = run.scene["vehicle"]
    omega = np.mean([run.mean(f"{_drive(run, side)}.speed", window) for side in run.sides])
    kinematic = vehicle["sprocket"]["teeth"] * vehicle["track"]["pitch"] * omega / (2 * np.pi)
    if abs(kinematic) < slips.SLOWEST:
        raise Missing("the sprockets stand")
    return run.mean("chassis.speed", window) / float(kinematic) - 1.0


def settlement(run: RunData, of: str, window: Window) -> float:
    """How far the hull is below its drawn place, m; raises Missing on uneven ground, as it counts from the first."""
    if not is_plane(run.scene.get("ground") or {}):
        raise Missing("settlement is not known on uneven ground: it counts from that of the start")
    return run.mean("chassis.settlement", window)


def settlement_of_springs(run: RunData, of: str, window: Window) -> float:
    """Share of the springs in the settlement: mean rise of the road wheels in the hull, m.

    The rise counts from the drawn position, along the normal of the ground under the vehicle.
    """
    wheels = [
        f"{side}.road_wheel[{i}].position"
        for side in run.sides
        for i in range(1, len(run.scene["vehicle"]["road_wheel"]["x"]) + 1)
    ]
    t, _ = run.signal("chassis.yaw", window)
    place, *above = (run.vectors("chassis", "out", name, window=window)[1] for name in ("chassis.position", *wheels))
    up = ground_axes(run, np.stack([run.signal(name, window)[1] for name in pose_signals(run)], axis=1)).up
    rise = np.mean([component(wheel - place, up) for wheel in above], axis=0)
    vehicle = run.scene["vehicle"]
    return mean(t, rise) - (vehicle["road_wheel"]["z"] - vehicle["chassis"]["centre"][2])


def settlement_of_contacts(run: RunData, of: str, window: Window) -> float:
    """Share of the contacts in the settlement: wheels into the chain, chain into the ground, m.

    Raises Missing on uneven ground.
    """
    return settlement(run, of, window) - settlement_of_springs(run, of, window)


def rut_depth(run: RunData, of: str, window: Window) -> float:
    """Depth of the deepest link of a track, or of all, in the soil, m; raises Missing on hard ground."""
    return max(float(pressed_by(run, track, window).depth.max(initial=0.0)) for track in hull.tracks(run, of))


def tension_top(run: RunData, of: str, window: Window) -> float:
    """Mean tension of the upper run, N; of one side or of all tracks."""
    return _run_tension(run, of, window, "top")


def tension_rear(run: RunData, of: str, window: Window) -> float:
    """Mean tension between the last road wheel and the wheel behind it, N: with the sprocket in front, the idler."""
    return _run_tension(run, of, window, "rear")


def tension_front(run: RunData, of: str, window: Window) -> float:
    """Mean tension between the first road wheel and the wheel ahead of it, N: the sprocket, or the idler."""
    return _run_tension(run, of, window, "front")


def third_law(run: RunData, of: str, window: Window) -> float:
    """Impulse of the tracks on their wheels less that received by the chassis, over the sum of magnitudes.

    The sprockets' share passes through the drives, which transmit the whole force.
    """
    given, received, size = np.zeros(3), np.zeros(3), 0.0
    track_outputs = [(port.giver, f"{port.giver_connector}.force") for port in ports(run) if port.giver in run.tracks]
    chassis_inputs = [("chassis", f"{port.taker_connector}.force") for port in ports(run) if port.taker == "chassis"]
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


# --- energy, over the whole run --------------------------------------------------------------------


def energy_residual(run: RunData, of: str, window: Window) -> float:
    """Residual of the energy ledger over the largest of work, change and dissipation."""
    return ledger(run).residual_relative


def port_residual(run: RunData, of: str, window: Window) -> float:
    """Ports' part of the energy residual, over the work of the drives."""
    energies = ledger(run)
    return energies.port / energies.work


def energy_drift(run: RunData, of: str, window: Window) -> float:
    """Largest change of stored and lost energy less work, at any instant, over the largest kinetic energy."""
    return drift(run, window)


# --- helpers ---------------------------------------------------------------------------------------


def _run_tension(run: RunData, of: str, window: Window, where: str) -> float:
    means = []
    for track in (_track(run, of),) if of else run.tracks:
        vehicle = of_side(run.scene["vehicle"], track.removesuffix("_track"))
        first, last, idler = vehicle["road_wheel"]["x"][0], vehicle["road_wheel"]["x"][-1], vehicle["idler"]["x"]
        sample, height = min(RUN_REACH, 2.0 * vehicle["track"]["pitch"]), vehicle["road_wheel"]["z"]
        middle, reach = {
            "top": (idler / 2, abs(idler) / 2 - 2 * sample),
            "rear": ((last + min(idler, 0.0)) / 2, sample),
            "front": ((first + max(idler, 0.0)) / 2, sample),
        }[where]
        links = run.links(track, window)
        forward, up = _middles(links)
        split = height if where == "top" else max(LOWER, 0.5 * height)
        inside = (np.abs(forward - middle) < reach) & ((up > split) if where == "top" else (up < split))
        means.append(mean(links.t, links.tension, inside))
    return float(np.mean(means))


def _middles(links: Links) -> tuple[Floats, Floats]:
    """Middles of the links (forward, up); link i lies between pins i and i + 1."""
    count = links.tension.shape[1]
    following = (np.arange(count) + 1) % links.forward.shape[1]
    here = np.arange(count)
    return (
        (links.forward[:, here] + links.forward[:, following]) / 2,
        (links.up[:, here] + links.up[:, following]) / 2,
    )


def _joint_forces(run: RunData, of: str, window: Window) -> tuple[Floats, Floats]:
    """Times (m,), and the force in every pin (m, pins), N."""
    topic = run.log.known_topic(f"/{of or run.tracks[0]}/links")
    names = run.log.topics[topic].names
    columns = [[i for i, name in enumerate(names) if name.endswith(f"].force.{axis}")] for axis in "xyz"]
    series = run.log.select({topic: [*columns[0], *columns[1], *columns[2]]}, window)[topic]
    forces = np.split(series.values, 3, axis=1)
    return series.t, np.asarray(np.sqrt(sum(force**2 for force in forces)))


def _fall(run: RunData, of: str, window: Window) -> tuple[Floats, Floats, float, float]:
    """Times, s, drop of the last pin, m, length of the chain, m, and gravity, m/s2."""
    links = run.links(of or run.tracks[0], window)
    vehicle = run.scene["vehicle"]
    length = links.tension.shape[1] * vehicle["track"]["pitch"]
    return links.t, links.up[0, -1] - links.up[:, -1], length, vehicle["gravity"]


def _share(slip: float) -> float:
    """A slip; raises Missing if it is none."""
    if np.isnan(slip):
        raise Missing("the chain stands: there is no share of its speed; track_slip is the pads' velocity")
    return slip


def _track(run: RunData, of: str) -> str:
    return f"{of}_track" if f"{of}_track" in run.tracks else run.tracks[0]


def _drive(run: RunData, of: str) -> str:
    """Prefix of the drive of a side; a mirrored side has that of the other, a rig its own."""
    return run.drive(of) or (run.drive(run.sides[0]) if run.sides else "drive")


UNITS: dict[Measure, str] = {
    sag: "m",
    end_tension: "N",
    joint_force: "N",
    joint_force_spread: "1",
    hoop_strain: "1",
    fall_time: "1",
    half_fall_time: "1",
    behind_free_fall: "m",
    pins_passed: "1",
    pins_per_revolution: "1",
    chain_speed_ratio: "1",
    polygon_ripple: "1",
    span_tension: "N",
    span_moment_ratio: "1",
    tight_span_enters: "1",
    ground_force: "N",
    uphill_force: "N",
    slip: "1",
    pad_slip: "1",
    speed_excess: "1",
    settlement: "m",
    settlement_of_springs: "m",
    settlement_of_contacts: "m",
    rut_depth: "m",
    tension_top: "N",
    tension_rear: "N",
    tension_front: "N",
    third_law: "1",
    energy_residual: "1",
    port_residual: "1",
    energy_drift: "1",
    turning.yaw_rate: "rad/s",
    turning.turn_radius: "m",
    turning.lateral_speed: "m/s",
    turning.rotation_centre: "m",
    turning.track_slip: "m/s",
    turning.propulsion: "N",
    turning.steering_moment: "N m",
    turning.drive_power: "W",
    turning.regenerated_power: "W",
    turning.path_error: "m",
}
NAMES: dict[str, Measure] = {measure.__name__: measure for measure in UNITS}
