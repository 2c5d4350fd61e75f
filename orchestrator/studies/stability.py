"""Stiff and extreme cases: what becomes of each, the margin to the predicted limit, and the limit that is observed.

A case runs a scene of the gallery with settings and asks for two things: that the energy ledger closes to 5 % (as
``summary.doubt`` wants it), and one physical expectation, named in the table. The verdict is one of ``VERDICTS``. The
predicted limit is the longest communication step of the linearised coupling, or internal step of an explicit
integrator (``limits``); an observed limit is bisected in the same way of asking.
"""

from __future__ import annotations

import csv
import io
import math
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import brentq

from fmus.build import BuildFailed
from fmus.physics.ancf import cable
from fmus.vehicle import BadInput
from orchestrator import measures, summary
from orchestrator.component import ComponentFailed
from orchestrator.evidence import Evidence, Missing, Window
from orchestrator.reader import Log
from orchestrator.scene import ChainScene, RigScene, TrackScene, VehicleScene, load
from orchestrator.simulate import simulate
from orchestrator.studies import Case
from orchestrator.studies.files import save
from orchestrator.studies.limits import Pair, coupling_limit, explicit_limit

TITLE = "Stability: stiff and extreme cases"
RIGHT, WRONG, CLEAN, BLOWN, MUTE = VERDICTS = (
    "stable and right", "stable and wrong", "failed cleanly", "blown up", "no sentence"
)  # fmt: skip
COLOURS = {RIGHT: "#4c9f50", WRONG: "#f0c040", CLEAN: "#5b8fd0", BLOWN: "#d04040", MUTE: "#000000"}
REFUSED = (BadInput, BuildFailed, ComponentFailed)
LIMIT = 600.0  # s of a case: longer is a case that hangs
BISECTIONS = 5

Answer = tuple[float, float, float]  # value, expected, tolerance


class Row(NamedTuple):
    """What became of a case."""

    item: str  # family
    case: str
    value: float  # of the family's parameter
    verdict: str
    sensible: bool  # whether somebody could mean it
    asked: str  # expectation
    found: float = math.nan
    expected: float = math.nan
    tolerance: float = math.nan
    open: float = math.nan  # energy that the ledger leaves open, of the largest of work, change and dissipated
    step: float = math.nan  # used, s: communication step, or internal step of an explicit integrator
    predicted: float = math.nan  # longest step, s
    cause: str = ""  # what limits it
    observed: float = math.nan  # longest step that was right, s
    seconds: float = 0.0
    note: str = ""  # what happened where

    @property
    def margin(self) -> float:
        """Predicted limit over used step."""
        return self.predicted / self.step


# --- expectations: what a run must show, each (value, expected, tolerance) --------------------------


def _last(run: Evidence, seconds: float = 1.0) -> Window:
    end = min(float(run.log.read(f"/{name}/out").t[-1]) for name in run.instances)
    return Window(max(0.0, end - seconds), end)


def weight(run: Evidence, scene: TrackScene, within: float = 0.03) -> Answer:
    """The mean ground reaction of the last second is the weight."""
    assert isinstance(scene, VehicleScene)
    heavy = summary.weight(scene)
    return measures.ground_force(run, "", _last(run)), heavy, within * heavy


def afloat(run: Evidence, scene: TrackScene) -> Answer:
    """Without gravity it drifts off as slowly as its tracks push it away when they settle on their wheels."""
    return float(abs(run.signal("chassis.settlement")[1]).max()), 0.0, 0.05


def speed(run: Evidence, scene: TrackScene) -> Answer:
    """Vehicle speed over teeth x pitch x omega / 2 pi of the last half second, less 1."""
    return measures.speed_excess(run, "", _last(run, 0.5)), 0.02, 0.04


def stays(run: Evidence, scene: TrackScene) -> Answer:
    """Without friction on the ground the vehicle stays where it is, but for its rocking."""
    return run.mean("chassis.speed", _last(run)), 0.0, 0.03


def sliding(run: Evidence, scene: TrackScene) -> Answer:
    """With locked sprockets the vehicle slides: its deceleration is friction times gravity."""
    assert isinstance(scene, VehicleScene)
    t, v = run.signal("chassis.speed", Window(float(scene.drive.stop or 0.0) + 0.3, scene.run.stop))
    moving = v > 0.3
    wanted = scene.vehicle.contact.ground.friction * scene.vehicle.gravity
    return float(-np.polyfit(t[moving], v[moving], 1)[0]), wanted, 0.1 * wanted


def climbs(run: Evidence, scene: TrackScene) -> Answer:
    """The centre of mass rises by most of the obstacle's height, or more where the nose rears up, and gets across."""
    assert isinstance(scene, VehicleScene)
    assert scene.ground.bump
    rise = scene.ground.bump.rise
    across = float(run.signal("chassis.distance")[1][-1]) > scene.ground.bump.start + 2.0
    return (float(-run.signal("chassis.settlement")[1].min()) if across else 0.0), rise, 0.35 * rise


def at_rest(run: Evidence, scene: TrackScene) -> Answer:
    """It ends lying still, but for the contacts' last swings."""
    return weight(run, scene, 0.06)


def sag(run: Evidence, scene: TrackScene) -> Answer:
    """Sag of the discrete catenary of rigid links: tan(angle) = weight from the middle on over the pull."""
    assert isinstance(scene, ChainScene)
    n, pitch = scene.chain.links, scene.vehicle.track.pitch
    from_middle = np.arange(n) - 0.5 * (n - 1)
    pull = brentq(
        lambda w: np.cos(np.arctan(from_middle / w)).mean() - scene.chain.span, 1e-3 * n, 10.0 * n
    )  # of weights of a link
    depth = pitch * np.sin(np.arctan(from_middle / pull))[from_middle > 0].sum()
    return measures.sag(run, "", _last(run)), float(depth), 2e-3 * float(depth)


def hoop(run: Evidence, scene: TrackScene) -> Answer:
    """Force in the pins of a free loop of rigid links: m omega^2 Rc / (2 sin(pi/N)), Rc = p / (2 tan(pi/N))."""
    assert isinstance(scene, ChainScene)
    track, half = scene.vehicle.track, math.pi / scene.chain.links
    force = track.mass * scene.chain.spin**2 * track.pitch / (4.0 * math.tan(half) * math.sin(half))
    return measures.joint_force(run, "", _last(run)), force, 1e-3 * force


def rides(run: Evidence, scene: TrackScene) -> Answer:
    """Chain speed over teeth x pitch x omega / 2 pi of the last ten teeth that pass."""
    assert isinstance(scene, RigScene)
    pace = scene.vehicle.sprocket.teeth * scene.vehicle.track.pitch / (2.0 * math.pi)
    window = _last(run, 2.0 * math.pi / scene.drive.speed)
    return run.mean("track.speed", window) / (pace * run.mean("drive.speed", window)), 1.0, 0.005


def ledger(run: Evidence, scene: TrackScene) -> Answer:
    """The energy ledger closes to 5 %, and that is all that is asked."""
    return 0.0, 0.0, 0.0


ASKED: dict[str, tuple[Callable[[Evidence, TrackScene], Answer], str]] = {
    "weight": (weight, "ground reaction, last second, N: the weight, 3 %"),
    "afloat": (afloat, "largest way up or down, m: 0 to 0.05"),
    "speed": (speed, "speed over that of the sprocket, less 1, last 0.5 s"),
    "stays": (stays, "mean speed of the last second, m/s: 0"),
    "sliding": (sliding, "deceleration of the locked vehicle, m/s2: friction x gravity, 10 %"),
    "climbs": (climbs, "rise of the centre of mass, m: that of the obstacle, 35 %"),
    "at_rest": (at_rest, "ground reaction, last second, N: the weight, 6 %"),
    "sag": (sag, "sag, m: that of the discrete catenary, 0.2 %"),
    "hoop": (hoop, "force in the pins, N: m omega^2 Rc / (2 sin(pi/N)), 0.1 %"),
    "rides": (rides, "chain speed over teeth x pitch x omega / 2 pi, last turn: 1, 0.5 %"),
    "ledger": (ledger, "the energy ledger closes"),
}


def _load(scene: str, track: str | None = None, settings: Sequence[str] = ()) -> TrackScene:
    found = load(scene, track, settings)
    assert isinstance(found, TrackScene)
    return found


# --- one run ------------------------------------------------------------------------------------------


def judged(scene: TrackScene, asked: str) -> Row:
    """Run a scene and judge it; nothing but the row is kept."""
    began = time.perf_counter()
    row = Row("", "", math.nan, MUTE, True, ASKED[asked][1], step=scene.run.step)
    with tempfile.TemporaryDirectory(prefix="cotrack-") as folder:
        path = Path(folder) / "run.mcap"
        try:
            told = simulate(scene.model_copy(update={"expect": {}}), path)
        except REFUSED as refusal:
            return _ended(row, CLEAN, str(refusal), began)
        if told["communication_steps"]:
            with Log(path) as log:
                run = Evidence(log)
                if not _finite(run):
                    return _ended(row, BLOWN, told["message"] or "a recorded output is not finite", began)
                row = row._replace(open=(told["energy"] or {}).get("residual_relative", math.nan))
                if told["status"] == "ok":
                    try:
                        value, expected, tolerance = ASKED[asked][0](run, scene)
                    except Missing as missing:
                        return _ended(row, WRONG, str(missing), began)
                    row = row._replace(found=value, expected=expected, tolerance=tolerance)
    if told["status"] != "ok":
        return _ended(row, CLEAN, told["message"], began)
    if abs(row.open) > 1.0:
        return _ended(row, BLOWN, told["message"], began)
    if abs(row.open) > summary.OPEN:
        return _ended(row, WRONG, told["message"], began)
    if not abs(row.found - row.expected) <= row.tolerance:
        apart = f"{row.found:.4g} instead of {row.expected:.4g} +- {row.tolerance:.2g}"
        return _ended(row, WRONG, f"{ASKED[asked][1].split(':')[0]}: {apart}", began)
    return _ended(row, RIGHT, told["message"], began)


def _ended(row: Row, verdict: str, note: str, began: float) -> Row:
    if not note and verdict != RIGHT:
        verdict = MUTE
    return row._replace(verdict=verdict, note=" ".join(note.split()), seconds=time.perf_counter() - began)


def _finite(run: Evidence) -> bool:
    return all(bool(np.isfinite(run.log.read(f"/{name}/out").values).all()) for name in run.instances)


# --- predicted limits ---------------------------------------------------------------------------------


def pairs(scene: VehicleScene) -> dict[str, Pair]:
    """The places where a vehicle is cut, as two masses on a contact; loads are those of the vehicle at rest."""
    v = scene.vehicle
    contact, ground, link = v.contact.wheel, v.contact.ground, v.track.mass
    wrapped = math.pi * v.idler.radius / v.track.pitch  # links on half of the idler
    load = summary.weight(scene) / (2.0 * len(v.road_wheel.x))
    spin = v.road_wheel.spin_inertia / v.road_wheel.radius**2
    return {
        "road wheel on its link": Pair(
            contact.stiffness, contact.damping, link, v.road_wheel.mass + 0.5 * v.road_arm.mass,
            ground.stiffness, ground.damping, v.suspension.stiffness, v.suspension.damping,
        ),
        "idler in its bend": Pair(
            0.5 * wrapped * contact.stiffness, 0.5 * wrapped * contact.damping, wrapped * link, v.idler.mass,
            2.0 * v.material.youngs_modulus * v.section.area / abs(v.idler.x),  # both runs to the sprocket
            spring=v.tensioner.stiffness, spring_damping=v.tensioner.damping,
        ),
        "friction that spins a road wheel": Pair(
            0.0, contact.friction * load / contact.friction_velocity, link, spin,
            bed_damping=ground.friction * load / ground.friction_velocity,
        ),
    }  # fmt: skip


def link_frequency(scene: TrackScene) -> float:
    """Highest frequency of one free straight link, rad/s: no mode of its chain is higher."""
    v = scene.vehicle
    E, A, I, rho = v.material.youngs_modulus, v.section.area, v.section.bending, v.material.density
    one = cable.Cable(v.track.pitch, rho * A, E * A, E * I, 0.0, 0.0)
    e = np.array([[0.0, 0, 0], [1, 0, 0], [one.l, 0, 0], [1, 0, 0]])
    K, M, none = np.zeros((12, 12)), np.zeros((4, 4)), np.zeros((4, 3))
    cable.stiffness(one, e, none, 0.0, 0.0, K, np.zeros((4, 3)), np.zeros((4, 3)))
    cable.mass(one, M)
    return float(np.sqrt(eigh(K, np.kron(M, np.eye(3)), eigvals_only=True)[-1]))


def predicted(scene: TrackScene) -> tuple[float, str]:
    """Longest step, s, and what limits it; NaN where nothing does (implicit links alone)."""
    if scene.track.integrator == "runge_kutta" and scene.track.model == "flexible":
        return explicit_limit(link_frequency(scene), scene.vehicle.material.relaxation_time), "highest mode of a link"
    if not isinstance(scene, VehicleScene):
        return math.nan, ""
    return min((coupling_limit(pair), name) for name, pair in pairs(scene).items())


# --- cases --------------------------------------------------------------------------------------------


class Family(NamedTuple):
    """One parameter and the values it takes."""

    name: str
    scene: str
    track: str
    values: tuple[float, ...]
    settings: Callable[[float], Sequence[str]]
    asked: str | Callable[[float], str] = "weight"
    sensible: tuple[float, float] = (-math.inf, math.inf)  # values that somebody could mean
    quick: tuple[float, ...] | None = None  # values of the quick form; all of them when not given
    seconds: float = 15.0


HALF = ("symmetric=true", "track.link_outputs=false")  # of the vehicle; a record per link is not needed
SHORT = (*HALF, "run.stop=2 s")
DRIVING = (*HALF, "run.stop=3.5 s", "drive.speed=6", "drive.ramp_start=0.3", "drive.ramp_time=1.5")
LAWS = ("sprocket", "wheel", "ground")


def _laws(key: str, factor: float, scene: str = "settle") -> list[str]:
    contact = _load(scene).vehicle.contact
    return [f"vehicle.contact.{law}.{key}={factor * getattr(getattr(contact, law), key)}" for law in LAWS]


def _heavy(factor: float) -> list[str]:
    v = _load("settle").vehicle
    inertia = [factor * part for part in v.track.inertia]
    return [
        f"vehicle.track.mass={factor * v.track.mass}", f"vehicle.track.inertia={inertia}",
        f"vehicle.material.density={factor * v.material.density}",
    ]  # fmt: skip


def _fast(kmh: float) -> list[str]:
    v = _load("straight").vehicle
    omega = kmh / 3.6 * 2 * math.pi / (v.sprocket.teeth * v.track.pitch)
    ramp = max(1.5, 0.7 * kmh / 3.6)  # peak of the half cosine below the friction of 0.3
    stop = math.ceil(ramp + 2.0)
    return [*HALF, f"run.stop={stop}", f"drive.speed={omega}", "drive.ramp_start=0.3", f"drive.ramp_time={ramp}"]


def _obstacle(rise: float) -> list[str]:
    bump = f'ground.bump={{start=1.0, rise={rise}, slope="30 deg", length=1.0, radius=0.3}}'
    drive = ("drive.speed=8", "drive.ramp_start=0.2", "drive.ramp_time=2", "run.stop=6 s")
    return [*HALF, *drive, "ground.hull=true", bump]


def _stepped(ms: float) -> list[str]:
    stop = 2.0 if ms >= 0.2 else 0.5
    return [*HALF, f"run.stop={stop}", f"run.step={ms} ms"]


def _link_count(n: float) -> list[str]:
    return [f"chain.links={n:.0f}", "run.stop=0.5 s", "track.link_outputs=true"]


def _loop(n: float) -> list[str]:
    return [f"chain.links={n:.0f}", f"chain.spin={5.0 * 64.0 / n}", "run.stop=0.5 s"]  # the tension of 64 links


def _round_wheels(n: float) -> list[str]:
    scene = _load("rig")
    assert isinstance(scene, RigScene)
    distance = scene.rig.axle_distance + 0.5 * (n - scene.rig.links) * scene.vehicle.track.pitch
    return [f"rig.links={n:.0f}", f"rig.axle_distance={distance}", "run.stop=4 s", "track.link_outputs=false"]


FAMILIES = (
    Family("Young's modulus, Pa", "settle", "flexible", tuple(2.0 * 10.0**k for k in range(6, 14)),
           lambda E: [*SHORT, f"vehicle.material.youngs_modulus={E}"], sensible=(2e9, 2e13), quick=(2e6, 2e11, 2e13)),
    Family("contact stiffness, factor", "settle", "flexible", (0.01, 0.1, 1.0, 10.0, 100.0),
           lambda f: [*SHORT, *_laws("stiffness", f)], sensible=(0.5, 100.0), quick=(0.01, 1.0, 100.0)),
    Family("contact damping, factor", "settle", "flexible", (0.0, 1.0, 10.0),
           lambda f: [*SHORT, *_laws("damping", f)], quick=(0.0,)),
    Family("friction of the ground", "straight", "flexible", (0.0, 0.1, 0.3, 0.6, 1.0, 1.5),
           lambda mu: [*DRIVING, f"vehicle.contact.ground.friction={mu}"],
           lambda mu: "speed" if mu else "stays", quick=(0.0, 1.5), seconds=25.0),
    Family("friction everywhere", "straight", "flexible", (0.0, 0.5, 1.5),
           lambda mu: [*DRIVING, *(f"vehicle.contact.{law}.friction={mu}" for law in LAWS)],
           lambda mu: "speed" if mu else "stays", sensible=(0.0, 0.8), quick=(), seconds=25.0),
    Family("friction velocity, m/s", "straight", "flexible", (1e-1, 1e-2, 1e-3, 1e-4),
           lambda v: [*DRIVING, *(f"vehicle.contact.{law}.friction_velocity={v}" for law in LAWS)],
           "speed", quick=(1e-1, 1e-4), seconds=25.0),
    Family("friction velocity, m/s, rigid", "straight", "rigid", (1e-2, 1e-3, 1e-4),
           lambda v: [*DRIVING, *(f"vehicle.contact.{law}.friction_velocity={v}" for law in LAWS)],
           "speed", quick=(), seconds=25.0),
    Family("material damping, s", "straight", "flexible", (0.0, 1e-6, 1e-4),
           lambda tau: [*DRIVING, f"vehicle.material.relaxation_time={tau}"], "speed", quick=(0.0,), seconds=25.0),
    Family("link mass, factor", "settle", "flexible", (0.01, 0.1, 1.0, 10.0, 100.0),
           lambda f: [*SHORT, *_heavy(f)], sensible=(0.1, 3.0), quick=(0.01, 100.0)),
    Family("link mass, factor, rigid", "settle", "rigid", (0.01, 0.1, 1.0, 10.0, 100.0),
           lambda f: [*SHORT, *_heavy(f)], sensible=(0.1, 3.0), quick=()),
    Family("communication step, ms", "settle", "flexible", (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0),
           _stepped, sensible=(0.05, 5.0), quick=(0.5, 5.0, 50.0), seconds=60.0),
    Family("internal step of implicit links, ms", "hanging_chain", "flexible", (0.1, 1.0, 5.0, 20.0, 50.0),
           lambda h: ["track.start=displaced", "run.stop=1 s", "run.step=50 ms", f"track.step={h} ms"],
           "ledger", sensible=(0.0, 2.0), quick=(1.0, 50.0)),
    Family("tension at the start, kN", "settle", "flexible", (0.0, 2.0, 16.3, 50.0, 100.0, 300.0),
           lambda T: [*SHORT, f"vehicle.track.tension={T} kN"], sensible=(2.0, 50.0), quick=(2.0, 100.0)),
    Family("links of a hanging chain", "hanging_chain", "flexible", (8.0, 16.0, 64.0, 256.0, 512.0),
           _link_count, "sag", quick=(8.0, 512.0)),
    Family("links of a hanging chain, rigid", "hanging_chain", "rigid", (8.0, 64.0, 512.0), _link_count, "sag",
           quick=()),
    Family("links of a free loop", "spinning_loop", "flexible", (8.0, 64.0, 512.0), _loop, "hoop", quick=(8.0,)),
    Family("links of a free loop, rigid", "spinning_loop", "rigid", (8.0, 64.0, 512.0), _loop, "hoop", quick=(512.0,)),
    Family("links round two wheels", "rig", "flexible", (20.0, 32.0, 64.0, 128.0, 256.0), _round_wheels, "rides",
           quick=(20.0,)),
    Family("links round two wheels, rigid", "rig", "rigid", (20.0, 64.0), _round_wheels, "rides", quick=()),
    Family("sprockets locked at speed, km/h", "straight", "flexible", (10.0, 20.0, 40.0),
           lambda v: [*_fast(v), f"drive.stop={max(1.5, 0.7 * v / 3.6) + 0.3}",
                      f"run.stop={math.ceil(max(1.5, 0.7 * v / 3.6) + 2.0)}"],
           "sliding", quick=(10.0,), seconds=30.0),
    Family("speed, km/h", "straight", "flexible", (20.0, 40.0, 60.0, 80.0, 100.0), _fast, "speed", quick=(),
           seconds=90.0),
    Family("speed, km/h, rigid", "straight", "rigid", (20.0, 60.0, 100.0), _fast, "speed", quick=(20.0,), seconds=90.0),
    Family("drop, m", "settle", "flexible", (0.5, 1.0, 2.0),
           lambda z: [*HALF, "run.stop=4 s", f"start.height={z}", "ground.hull=true"], "at_rest", quick=(2.0,)),
    Family("gravity, g", "settle", "flexible", (0.0, 1.0, 3.0, 10.0),
           lambda g: [*SHORT, f"vehicle.gravity={9.81 * g}"], lambda g: "weight" if g else "afloat",
           sensible=(0.0, 3.0), quick=(0.0, 10.0)),
    Family("thrown upside down from, m", "settle", "flexible", (0.5, 1.0, 2.0),
           lambda z: [*HALF, "run.stop=8 s", f"start.height={0.7 + z}", 'start.pitch=180 deg', "ground.hull=true"],
           "at_rest", quick=(1.0,), seconds=30.0),
    Family("rolled over from, m", "settle", "flexible", (0.5, 1.0),
           lambda z: [*HALF, "run.stop=8 s", f"start.height={0.7 + z}", 'start.roll=180 deg', "ground.hull=true"],
           "at_rest", quick=(1.0,), seconds=30.0),
    Family("obstacle, m", "straight", "flexible", (0.3, 0.65, 1.0), _obstacle, "climbs", quick=(0.65,), seconds=30.0),
    Family("tracks there are", "settle", "flexible", (0.0, 1.0, 2.0),
           lambda n: ["run.stop=2 s", "track.link_outputs=false",
                      f"tracks={['left', 'right'][: int(n)]}".replace("'", '"')], quick=(0.0, 1.0)),
    Family("minutes of driving", "straight", "rigid", (10.0,),
           lambda m: [*HALF, f"run.stop={60 * m}", "run.step=2 ms", "run.outputs=50"], "speed", quick=(),
           seconds=1200.0),
)  # fmt: skip
BISECTED = (
    ("communication step", "settle", "rigid", (*HALF, "run.stop=1 s"), "run.step", 1e-3),
    ("step of the explicit integrator", "hanging_chain", "flexible",
     ("chain.links=16", "track.start=displaced", "run.stop=0.05 s", "track.integrator=runge_kutta",
      "vehicle.material.relaxation_time=1e-5 s"), "track.step", 1e-6),
    ("step of the explicit integrator, soft links", "hanging_chain", "flexible",
     ("chain.links=16", "track.start=displaced", "run.stop=0.05 s", "track.integrator=runge_kutta",
      "vehicle.material.youngs_modulus=2e8", "vehicle.material.relaxation_time=1e-3 s"), "track.step", 1e-6),
)  # fmt: skip


def cases(quick: bool) -> list[Case]:
    """Every value of every family, then the limits that are bisected."""
    wanted = []
    for number, family in enumerate(FAMILIES):
        values = family.values if not quick or family.quick is None else family.quick
        for value in values:
            limit = max(LIMIT, 3.0 * family.seconds)
            wanted.append(Case(family.name, f"{family.name}: {value:g}", one, (number, value), family.seconds, limit))
    for number, (name, *_) in enumerate(BISECTED):
        if not quick or number == 1:
            wanted.append(Case(name, f"{name}: limit", bisected, (number,), 60.0, LIMIT))
    return wanted


def measure(case: Case) -> list[Row]:
    """The row of a case."""
    found = case.name.rpartition(": ")[2]
    return [row._replace(item=case.item, case=found) for row in case.function(*case.arguments)]


def one(number: int, value: float) -> list[Row]:
    """A member of a family."""
    family = FAMILIES[number]
    asked = family.asked if isinstance(family.asked, str) else family.asked(value)
    sensible = family.sensible[0] <= value <= family.sensible[1]
    row = Row("", "", value, MUTE, sensible, ASKED[asked][1])
    try:
        scene = _load(family.scene, family.track, family.settings(value))
    except BadInput as refusal:
        return [row._replace(verdict=CLEAN, note=str(refusal))]
    limit, cause = predicted(scene)
    return [judged(scene, asked)._replace(value=value, sensible=sensible, predicted=limit, cause=cause)]


def bisected(number: int) -> list[Row]:
    """The longest step that keeps a run stable, from 1 to 100 times the given one; the predicted one beside it."""
    _, scene, track, settings, key, least = BISECTED[number]
    asked = "weight" if scene == "settle" else "ledger"
    limit, cause = predicted(_load(scene, track, settings))
    stop = _load(scene, track, settings).run.stop

    def run(step: float) -> Row:
        whole = stop / round(stop / step) if key == "run.step" else step
        return judged(_load(scene, track, [*settings, f"{key}={whole!r}"]), asked)._replace(step=whole)

    def longest(good: tuple[str, ...]) -> tuple[Row, Row]:
        """The longest step that ends well, and the shortest beyond it that does not."""
        low, high = run(least), run(min(100.0 * least, stop))
        for _ in range(BISECTIONS if low.verdict in good and high.verdict not in good else 0):
            middle = run(math.sqrt(low.step * high.step))
            low, high = (middle, high) if middle.verdict in good else (low, middle)
        return (high, high) if high.verdict in good else (low, high)

    (right, _), (stable, beyond) = longest((RIGHT,)), longest((RIGHT, WRONG))
    end = f"at {beyond.step:.3g} s {beyond.verdict}: {beyond.note}" if beyond is not stable else "no limit up to there"
    note = f"right up to {right.step:.3g} s, stable up to {stable.step:.3g} s; {end}"
    return [right._replace(value=stable.step, predicted=limit, cause=cause, observed=stable.step, note=note)]


def failed(item: str, case: str, reason: str) -> Row:
    """A case that raised, took too long or lost its process: that is what must not happen."""
    return Row(item, case, math.nan, MUTE, True, "an end", note=reason)


def missed(rows: Sequence[Row]) -> list[Row]:
    """No end or no sentence; or a case that somebody could mean and that is not right."""
    return [row for row in rows if row.verdict == MUTE or (row.sensible and row.verdict != RIGHT)]


# --- table and map ------------------------------------------------------------------------------------

HEAD = (
    "family", "value", "verdict", "sensible", "asked", "found", "expected", "tolerance", "ledger open", "step, s",
    "predicted limit, s", "by", "margin", "observed limit, s", "run, s", "what happened",
)  # fmt: skip


def _number(x: float, digits: int) -> str:
    return "" if math.isnan(x) else f"{x:.{digits}g}"


def _cells(row: Row, digits: int) -> list[str]:
    r, n = row, digits
    return [
        r.item, r.case, r.verdict, "yes" if r.sensible else "no", r.asked, _number(r.found, n),
        _number(r.expected, n), _number(r.tolerance, n), _number(r.open, n), _number(r.step, n),
        _number(r.predicted, n), r.cause, _number(r.margin, n), _number(r.observed, n), _number(r.seconds, 2), r.note,
    ]  # fmt: skip


def to_csv(rows: Sequence[Row]) -> str:
    """All digits; NaN is an empty field."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(HEAD)
    writer.writerows(_cells(row, 17) for row in rows)
    return out.getvalue()


def to_markdown(rows: Sequence[Row]) -> str:
    """A table for people, and how many cases ended how."""
    lines = ["| " + " | ".join(HEAD) + " |", "|" + " --- |" * len(HEAD)]
    lines += ["| " + " | ".join(c.replace("|", "\\|") for c in _cells(row, 3)) + " |" for row in rows]
    ends = ", ".join(f"{sum(row.verdict == verdict for row in rows)} {verdict}" for verdict in VERDICTS)
    return "\n".join(lines) + f"\n\n{len(rows)} cases: {ends}.\n"


def draw(rows: Sequence[Row], files: Sequence[Path], title: str) -> None:
    """The map: a line a family, a field a value, its colour the verdict, below it the margin."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch, Rectangle

    families = list(dict.fromkeys(row.item for row in rows))
    across = max((sum(row.item == item for row in rows) for item in families), default=1)
    figure = Figure(figsize=(4.5 + 1.05 * across, 1.6 + 0.42 * len(families)), layout="constrained")
    FigureCanvasAgg(figure)
    pane = figure.subplots()
    for y, item in enumerate(families):
        for x, row in enumerate(row for row in rows if row.item == item):
            edge = "black" if row.sensible else "white"
            pane.add_patch(Rectangle((x + 0.04, y + 0.06), 0.92, 0.88, facecolor=COLOURS[row.verdict], edgecolor=edge))
            value = row.case if math.isnan(row.value) else f"{row.value:.3g}"
            label = value + ("" if math.isnan(row.margin) else f"\n{row.margin:.2g} x")
            pane.text(x + 0.5, y + 0.5, label, ha="center", va="center", fontsize=7)
    pane.set_xlim(0, across)
    pane.set_ylim(len(families), 0)
    pane.set_yticks([y + 0.5 for y in range(len(families))], families, fontsize=8)
    pane.set_xticks([])
    for spine in pane.spines.values():
        spine.set_visible(False)
    handles = [Patch(color=COLOURS[verdict], label=verdict) for verdict in VERDICTS]
    figure.legend(handles=handles, ncols=3, fontsize=8, loc="outside lower center", frameon=False)
    pane.set_title(f"{title}\nbelow the value: predicted limit over step; framed: physically sensible", fontsize=10)
    for file in files:
        figure.savefig(file, dpi=110)


def write(folder: Path, name: str, rows: Sequence[Row], title: str) -> list[Path]:
    """Table and map; raises OSError when the folder cannot be written."""
    texts = {f"{name}.csv": to_csv(rows), f"{name}.md": f"# {title}\n\n{to_markdown(rows)}"}
    return save(folder, texts, name, lambda files: draw(rows, files, title))
