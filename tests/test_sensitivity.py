"""Every number of a resolved scene has an effect: it changes a computed motion, force or energy.

`KEYS` gives for each key the case in which it acts, the kinds of links, and its change. A case is a short run of the
models in this process; the same through FMUs has the marker `study`. Outputs that repeat the key itself (a drive's
speed, a start position) do not count. Rounding is the effect of the next larger gravity, or another key's next value,
in the same run; a key must have a thousand times that effect.
"""

from __future__ import annotations

import fnmatch
import math
import re
from collections.abc import Iterator
from contextlib import ExitStack
from functools import cache
from typing import Any, NamedTuple

import pytest
from vehicle_in_process import InProcess, Overrides

from fmus.track_choices import TRACKS
from orchestrator.cosim import master
from orchestrator.cosim.coupling.tracks_first import TracksFirst
from orchestrator.cosim.graph import wire
from orchestrator.execution.simulate import load_components, pace_of
from orchestrator.scene import gallery
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import from_table, load
from orchestrator.scene.settings import set_key
from orchestrator.scene.track_table import TrackModelTable

ROUNDING = 1e3  # required effect over that of an ulp, and over the rounding of an output itself
FACTOR = 1.02


class Case(NamedTuple):
    """A short run of a scene in which keys are changed."""

    scene: str
    settings: tuple[str, ...] = ()
    duration: float = 0.02  # s
    ulp: str = "vehicle.gravity"  # a key whose last digit shows the growth of rounding
    overrides: Overrides | None = None


QUICK = ("track.start=polygon", "drive.ramp_start=0", "drive.ramp_time=0.02", "track.link_outputs=false", "placed=true")
# it falls on its suspension, nose down, and drives off to the right
VEHICLE = (*QUICK, "start.pitch=0.01", "start.height=-0.01", "drive.speed=20")
STEERED = (*QUICK, "start.pitch=0.01", "start.height=-0.01")
JOINED = ("drive.steering.ramp_start=0", "drive.steering.ramp_time=0.02")
RIG = (*QUICK, "drive.speed=2")
SLOWER: Overrides = {"left_drive": {"speed.end": 8.0}}
CASES = {
    "vehicle": Case("straight", VEHICLE, overrides=SLOWER),
    "guided": Case("straight", (*VEHICLE, "vehicle.guide.clearance=1e-5"), overrides=SLOWER),
    "eleven teeth": Case("straight", (*VEHICLE, "vehicle.sprocket.outer_radius=0.285"), overrides=SLOWER),
    "tensioned": Case("straight", ("track.link_outputs=false",), 0.002, "vehicle.track.tension"),
    "stopped": Case("straight", (*VEHICLE, "drive.stop=0.02", "drive.stop_time=5e-3"), 0.03),
    "motor": Case("straight", (*VEHICLE, "drive.mode=torque", "drive.torque=5e3", "drive.brake=1e3")),
    "steered": Case("turn", (*STEERED, "drive.speed=20", "drive.left.speed=8")),
    "steered and stopped": Case(
        "turn", (*STEERED, "drive.left.stop=0.02", "drive.right.stop=0.021", "drive.stop_time=5e-3"), 0.03
    ),
    "two motors and brakes": Case(
        "turn", (*STEERED, "drive.mode=torque", "drive.left.torque=5e3", "drive.right.torque=4e3", "drive.brake=1e3")
    ),
    "joined": Case("differential", (*STEERED, *JOINED, "drive.speed=20")),
    "joined and stopped": Case(
        "differential", (*STEERED, *JOINED, "drive.steering.stop=0.02", "drive.steering.stop_time=5e-3"), 0.03
    ),
    "joined, two motors": Case(
        "differential",
        (
            *STEERED, *JOINED, "drive.mode=torque", "drive.torque=5e3", "drive.steering.mode=torque",
            "drive.steering.torque=1e3", "drive.steering.brake=1e3",
        ),
    ),
    "driven": Case(
        "serpentine",
        (
            *QUICK[:1], *QUICK[3:], "driver.arcs=[[0.1, 0.05], [0.1, 0.2], [0.1, -0.1], [9, 0.1]]", "driver.reach=0.5",
            "driver.ramp_start=0", "driver.ramp_time=0.02", "driver.speed=0.03",
        ),
    ),
    "on one track": Case("straight", (*VEHICLE, "tracks=['left']", "start.height=-0.05", "start.pitch=-0.06")),
    "buried": Case(
        "straight", ("tracks=[]", "ground.hull=true", "start.height=-2.5", "start.pitch=0.1", "placed=true"), 0.002
    ),
    "over a bump": Case(
        "straight",
        (
            *VEHICLE, "ground.bump.start=-1.6", "ground.bump.rise=0.05", "ground.bump.slope=0.5",
            "ground.bump.length=0.12", "ground.bump.radius=0.05",
        ),
    ),
    "follows an error": Case(
        "sprocket_bench",
        (
            "drive.speed=2", "drive.ramp_time=0.05", "run.stop=0.03", "run.variable.estimate=power",
            "run.variable.tolerance=1e-2", "run.variable.energy=30", "run.variable.shortest=9e-4",
            "run.variable.longest=2e-3",
        ),
        0.03,
        "bench.upper",
    ),
    "hanging": Case("hanging_chain", ("chain.links=8", "track.start=displaced")),
    "damped": Case("hanging_chain", ("chain.links=8", "track.start=displaced", "track.spectral_radius=0.8")),
    "adaptive": Case(
        "hanging_chain",
        ("chain.links=8", "track.start=displaced", "track.integrator=adams", "track.rtol=1e-8", "track.atol=1e-8"),
    ),
    "released": Case("released_chain", ("chain.links=8",)),
    "ovalling": Case("spinning_loop", ("chain.links=16", "chain.ovalling=1"), ulp="chain.spin"),
    "sprung": Case(
        "spinning_loop",
        (
            "chain.links=16", "chain.ovalling=1", "track.closure=spring", "track.closure_stiffness=1e5",
            "track.closure_damping=100",
        ),
        ulp="chain.spin",
    ),
    "spinning": Case("spinning_loop", ("chain.links=16",), ulp="chain.spin"),
    "bench": Case("sprocket_bench", ("drive.speed=2", "drive.ramp_time=0.01"), ulp="bench.upper"),
    "rig": Case("rig", RIG, ulp="drive.speed"),
    "tensioned rig": Case("rig", ("track.link_outputs=false",), 0.002, "rig.tension"),
    "two speeds": Case(
        "rig",
        (
            *RIG, "idler_drive.mode=speed", "idler_drive.speed=2", "idler_drive.ramp_start=0.002",
            "idler_drive.ramp_time=0.01", "idler_drive.stop=0.015", "idler_drive.stop_time=0.01",
        ),
        ulp="drive.speed",
    ),
    "two motors": Case("rig", (*RIG, "idler_drive.torque=100"), ulp="drive.speed"),
}  # fmt: skip

FLEXIBLE = ("cable", "beam")
WIDE = ("beam", *(model for model in TRACKS if model != "flexible"))
ALL = ("cable", *WIDE)


class Acts(NamedTuple):
    """Place of action of a key: a case, kinds of links, another value, outputs."""

    case: str
    kinds: tuple[str, ...] = ("cable",)  # of links; keys of other components are tested with the cheapest
    value: Any = None  # instead of FACTOR times the value
    seen: str = ""  # pattern of outputs, where the key changes no motion or force


# The first match counts; keys of the vehicle's parts act through the chassis or a drive, whatever the links.
KEYS: dict[str, Acts] = {
    "vehicle.chassis.hull.*": Acts("buried"),
    "vehicle.track.tension": Acts("tensioned", ALL),
    "vehicle.track.inertia.1": Acts("vehicle", ALL),
    "vehicle.track.inertia.*": Acts("vehicle", WIDE),  # a cable has inertia about its pin only
    "vehicle.track.links": Acts("vehicle", ALL, 65),
    "vehicle.track.pitch": Acts("eleven teeth", ALL, 0.1527),
    "vehicle.track.width": Acts("vehicle", WIDE),  # a cable has contact on its line
    "vehicle.*.width": Acts("on one track"),
    "vehicle.track.*": Acts("vehicle", ALL),
    "vehicle.section.lateral_bending": Acts("vehicle", ("beam",)),  # a cable bends alike about both axes
    "vehicle.section.torsion": Acts("vehicle", ("beam",)),  # a cable has none
    "vehicle.section.outer_fibre": Acts("vehicle", FLEXIBLE, seen="stress.max"),
    "vehicle.section.*": Acts("vehicle", FLEXIBLE),
    "vehicle.material.shear_modulus": Acts("vehicle", ("beam",)),
    "vehicle.material.*": Acts("vehicle", FLEXIBLE),
    "vehicle.contact.*": Acts("vehicle", ALL),
    "vehicle.guide.clearance": Acts("guided", WIDE, 2e-5),  # cables stay in their plane
    "vehicle.sprocket.teeth": Acts("eleven teeth", ALL),
    "vehicle.sprocket.*radius": Acts("vehicle", ALL),
    "vehicle.sprocket.seat_clearance": Acts("vehicle", ALL),
    "vehicle.sprocket.flank_angle": Acts("vehicle", ALL),
    "vehicle.suspension.preload": Acts("vehicle", value=1e3),
    "vehicle.tensioner.preload": Acts("vehicle", value=1e3),
    "vehicle.gravity": Acts("vehicle", ALL),
    "vehicle.*": Acts("vehicle"),
    "push": Acts("on one track", value=1e3),  # on the idler without a track
    "start.position.?": Acts("vehicle", value=1.0, seen="*.position.*"),
    "start.heading": Acts("vehicle", value=0.5),
    "start.roll": Acts("buried", value=math.pi),
    "start.*": Acts("vehicle", value=0.02),
    "drive.steering.stop*": Acts("joined and stopped", ("rigid",)),
    "drive.steering.brake": Acts("joined, two motors", ("rigid",)),
    "drive.steering.torque": Acts("joined, two motors", ("rigid",)),
    "drive.steering.*": Acts("joined", ("rigid",), 0.03),
    "drive.*.stop*": Acts("steered and stopped", ("rigid",)),
    "drive.*.brake": Acts("two motors and brakes", ("rigid",)),
    "drive.*.torque": Acts("two motors and brakes", ("rigid",)),
    "drive.*.*": Acts("steered", ("rigid",), 0.03),
    "drive.stop*": Acts("stopped"),
    "drive.brake": Acts("motor"),
    "drive.torque": Acts("motor"),
    "drive.*": Acts("vehicle", value=0.03),
    "driver.arcs.3.0": Acts("driven", ("rigid",), 0.1),
    "driver.ramp_*": Acts("driven", ("rigid",), 0.03),
    "driver.*": Acts("driven", ("rigid",)),
    "ground.bump.*": Acts("over a bump", ALL),
    "track.closure_*": Acts("sprung", ("rigid",)),
    "track.spectral_radius": Acts("damped", ("cable", "rigid")),
    "track.?tol": Acts("adaptive", ("rigid",), 1e-5),
    "track.step": Acts("released", value=5e-5),
    "run.variable.shortest": Acts("follows an error", value=1.9e-3),
    "run.variable.*": Acts("follows an error"),
    "run.step": Acts("vehicle", value=0.5e-3),
    "chain.spin": Acts("spinning"),
    "chain.ovalling": Acts("ovalling"),
    "chain.span": Acts("hanging", value=0.79),
    "chain.links": Acts("hanging", value=9),
    "bench.links": Acts("bench"),
    "bench.*": Acts("bench"),
    "rig.tension": Acts("tensioned rig"),
    "rig.links": Acts("rig"),
    "rig.*": Acts("rig"),
    "idler_drive.brake": Acts("rig"),
    "idler_drive.torque": Acts("two motors"),
    "idler_drive.*": Acts("two speeds"),
}
# Duration, recording, checks and limits: they must not change any computed value.
APART = ("run.stop", "run.outputs", "run.links", "run.checkpoints", "expect.*", "vehicle.tensioner.travel")

# Keys of [track] that are no numbers: tests/regression/runs.py has runs with each choice.
CHOICES = (
    "element", "elasticity", "axes", "formulation", "joints", "coordinates", "closure", "integrator", "start",
)  # fmt: skip


def flat(value: Any, key: str = "") -> Iterator[tuple[str, float | int]]:
    """Dotted keys of all numbers in a resolved scene."""
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for name, inner in items:
            yield from flat(inner, f"{key}.{name}" if key else str(name))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield key, value


def acts(key: str) -> Acts | None:
    """Entry of ``KEYS`` for a key, or None."""
    return next((where for pattern, where in KEYS.items() if fnmatch.fnmatchcase(key, pattern)), None)


def scene_of(case: Case, kind: str, **changes: float | int) -> Any:
    """Scene of the case with a kind of links and the numbers ``changes`` in its resolved form."""
    settings = [*case.settings, *(["track.element=beam"] if kind == "beam" else [])]
    table = load(case.scene, kind if kind in TRACKS else "flexible", settings).resolved()
    for key, value in changes.items():
        set_key(table, key, value)
    return from_table(table, "the case")


def seen(name: str, pattern: str) -> bool:
    """Whether an output is a motion or a force, and not an input that is shown."""
    if pattern:
        return fnmatch.fnmatchcase(name, f"*{pattern}")
    return bool(re.search(r"position|velocity|displacement|pitch$|roll$|yaw$|force|torque|tension|place", name))


def computed(case: Case, kind: str, fmus: bool = False, **changes: float | int) -> dict[str, float]:
    """Outputs at the end of a case by name: of the models in this process, or of FMUs."""
    scene = scene_of(case, kind, **changes)
    if fmus or scene.run.variable is not None:
        return stepped(case, scene)
    members = InProcess(scene, case.overrides).run(case.duration).members.values()
    return {
        f"{one.name}.{name}": value
        for one in members
        for name, value in (*zip(one.outputs, one.y, strict=True), *zip(one.links, one.link_outputs(), strict=True))
        if not (one.kind in ("SprocketDrive", "SteeringDifferential") and "sprocket." in name)
    }


def stepped(case: Case, scene: Any) -> dict[str, float]:
    """Outputs at the end of a case through the master, with FMUs."""
    with ExitStack() as stack:
        assembly = assemble(placed(scene))
        parts = [
            part._replace(parameters={**part.parameters, **(case.overrides or {}).get(part.name, {})})
            for part in assembly.parts
        ]
        graph = system(assembly._replace(parts=tuple(parts)))
        components = load_components(graph, scene.run.stop, stack)
        run = scene.run.model_copy(update={"stop": case.duration})
        outcome = master.run(TracksFirst(wire(graph, components)), pace_of(run), [])
        assert outcome.status == "ok", outcome.message
        result = {}
        for one in components.values():
            one.read_links()
            drives = any(name.startswith("mount.") for name in one.outputs)
            values = (*zip(one.outputs, one.y, strict=True), *zip(one.links, one.y_links, strict=True))
            result |= {
                f"{one.name}.{name}": value for name, value in values if not (drives and name.startswith("sprocket."))
            }
    return {name: float(value) for name, value in result.items()}


def family(name: str) -> str:
    """Family of outputs with common rounding: components, sides, wheels, links and axes of one quantity."""
    return re.sub(r"\[\d+\]|\.[xyzw]$|^(left|right)_|\.(left|right)\.", "", name)


@cache
def base(name: str, kind: str, fmus: bool) -> tuple[dict[str, float], dict[str, float]]:
    """Outputs of a case, and the effect of rounding on them by family."""
    case = CASES[name]
    first = computed(case, kind, fmus)
    table = dict(flat(scene_of(case, kind).resolved()))
    other = computed(case, kind, fmus, **{case.ulp: math.nextafter(table[case.ulp], math.inf)})
    rounding: dict[str, float] = {}
    for output, value in first.items():
        apart = max(abs(other[output] - value), 4.0 * math.ulp(value))
        rounding[family(output)] = max(rounding.get(family(output), 0.0), apart)
    return first, rounding


def changed(key: str, value: float | int, given: Any) -> float | int:
    """Another value of a key: by a factor, one more of a count, or 0.02 instead of 0."""
    if given is not None:
        return given if value != given else FACTOR * given
    return value + 1 if isinstance(value, int) else FACTOR * value if value else 0.02


def effect(key: str, kind: str, fmus: bool = False) -> float:
    """Largest effect of a change of the key on a motion, force or energy, over that of rounding."""
    where = acts(key)
    assert where is not None, key
    case = CASES[where.case]
    first, rounding = base(where.case, kind, fmus)
    value = dict(flat(scene_of(case, kind).resolved()))[key]
    other = computed(case, kind, fmus, **{key: changed(key, value, where.value)})
    return max(
        abs(other[output] - first[output]) / rounding[family(output)]
        for output in first.keys() & other.keys()
        if seen(output, where.seen)
    )


def in_brief(key: str, kinds: tuple[str, ...]) -> tuple[str, ...]:
    """Kinds of links for the short test of a key: no beams, if cables or rigid links show the key."""
    return kinds if len(kinds) < 3 and "cable" not in kinds else tuple(kind for kind in kinds if kind != "beam")


def asked() -> dict[str, tuple[str, ...]]:
    """All keys of all scenes of the gallery and of all cases, with the kinds of links they act on."""
    all_keys: set[str] = set()
    for name in gallery.names():
        for model in TRACKS:
            all_keys |= {key for key, _ in flat(load(name, model).resolved())}
    for case in CASES.values():
        all_keys |= {key for key, _ in flat(scene_of(case, "cable").resolved())}
    keys = sorted(key for key in all_keys if not any(fnmatch.fnmatchcase(key, one) for one in APART))
    return {key: where.kinds if (where := acts(key)) else () for key in keys}


ASKED = asked()
BRIEF = [(key, kind) for key, kinds in ASKED.items() for kind in in_brief(key, kinds)]
REST = [(key, kind) for key, kinds in ASKED.items() for kind in kinds if (key, kind) not in BRIEF]


def test_every_key_of_every_scene_is_asked():
    assert [key for key, kinds in ASKED.items() if not kinds] == []
    patterns = {next(p for p in KEYS if fnmatch.fnmatchcase(key, p)) for key in ASKED}
    assert set(KEYS) - patterns == set()  # every pattern matches a key
    assert {acts(key).case for key in ASKED} == set(CASES)


def test_a_key_of_a_track_without_a_default_is_asked_or_a_choice():
    """No scene shows such a key in its resolved form, unless it is set."""
    absent = {key for key, field in TrackModelTable.model_fields.items() if field.default is None}
    assert {key for key in absent if f"track.{key}" not in ASKED} == set(CHOICES)


@pytest.mark.long
@pytest.mark.parametrize(("key", "kind"), [*BRIEF, *(pytest.param(*one, marks=pytest.mark.study) for one in REST)])
def test_a_key_changes_what_is_computed(key, kind):
    assert effect(key, kind) > ROUNDING


@pytest.mark.long
def test_a_mass_that_does_nothing_is_found(monkeypatch):
    """A mass without effect is found: a chassis and links that ignore their mass in the table."""
    from fmus.chassis import model as chassis
    from fmus.track_flexible import model as flexible

    tree, cables = chassis.tree, flexible.Model._cables

    def kept(vehicle, *rest):
        return tree({**vehicle, "chassis": {**vehicle["chassis"], "mass": 5489.24}}, *rest)

    def light(self, *rest):
        self.vehicle = {**self.vehicle, "track": {**self.vehicle["track"], "mass": 18.02}}
        return cables(self, *rest)

    for key, plant in (("vehicle.chassis.mass", (chassis, "tree", kept)),
                       ("vehicle.track.mass", (flexible.Model, "_cables", light))):  # fmt: skip
        assert effect(key, "cable") > ROUNDING
        with monkeypatch.context() as planted:
            planted.setattr(*plant)
            assert effect(key, "cable") < 1.0


@pytest.mark.study
@pytest.mark.parametrize(("key", "kind"), [*BRIEF, *REST])
def test_a_key_changes_what_an_fmu_computes(key, kind):
    assert effect(key, kind, fmus=True) > ROUNDING
