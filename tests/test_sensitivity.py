"""Every number of a resolved scene has an effect: it changes a computed motion, force or energy.

`key_effects.KEYS` gives for each key the case in which it acts, the kinds of links, and its change. A case is a short
run of the models in this process. Outputs that repeat the key itself (a drive's speed, a start position) do not count.
Rounding is the effect of the next larger gravity, or another key's next value, in the same run; a key must have a
thousand times that effect.
"""

from __future__ import annotations

import fnmatch
import math
import re
from collections.abc import Iterator
from contextlib import ExitStack
from functools import cache
from typing import Any

import pytest
from key_effects import APART, CASES, CHOICES, KEYS, Acts, Case
from vehicle_in_process import InProcess

from fmus.track.choices import TRACKS
from orchestrator.cosim import master
from orchestrator.cosim.coupling.tracks_first import Coupling as TracksFirst
from orchestrator.cosim.graph import connect
from orchestrator.cosim.initialisation import load_components
from orchestrator.execution.prepared_run import step_control_of
from orchestrator.scene.assembly import assemble, system
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import from_table, load, scene_names
from orchestrator.scene.settings import set_key
from orchestrator.scene.track_table import TrackModelTable

ROUNDING = 1e3  # required effect over that of an ulp, and over the rounding of an output itself
FACTOR = 1.02


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


def computed(case: Case, kind: str, **changes: float | int) -> dict[str, float]:
    """Outputs at the end of a case by name: of the models in this process, or of FMUs where a step follows an error."""
    scene = scene_of(case, kind, **changes)
    if scene.run.variable is not None:
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
        graph = system(assemble(placed(scene)))
        components = load_components(graph, scene.run.times, stack)
        run = scene.run.model_copy(update={"stop": case.duration})
        outcome = master.run(TracksFirst(connect(graph, components)), step_control_of(run), [])
        assert outcome.status == "ok", outcome.message
        return {
            f"{one.name}.{name}": float(value)
            for one in components.values()
            for name, value in zip(one.outputs, one.y, strict=True)
            if not (name.startswith("sprocket.") and any(own.startswith("mount.") for own in one.outputs))
        }


def family(name: str) -> str:
    """Family of outputs with common rounding: components, sides, wheels, links and axes of one quantity."""
    return re.sub(r"\[\d+\]|\.[xyzw]$|^(left|right)_|\.(left|right)\.", "", name)


@cache
def base(name: str, kind: str) -> tuple[dict[str, float], dict[str, float]]:
    """Outputs of a case, and the effect of rounding on them by family."""
    case = CASES[name]
    first = computed(case, kind)
    table = dict(flat(scene_of(case, kind).resolved()))
    other = computed(case, kind, **{case.ulp: math.nextafter(table[case.ulp], math.inf)})
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


def effect(key: str, kind: str) -> float:
    """Largest effect of a change of the key on a motion, force or energy, over that of rounding."""
    where = acts(key)
    assert where is not None, key
    case = CASES[where.case]
    first, rounding = base(where.case, kind)
    value = dict(flat(scene_of(case, kind).resolved()))[key]
    other = computed(case, kind, **{key: changed(key, value, where.value)})
    return max(
        abs(other[output] - first[output]) / rounding[family(output)]
        for output in first.keys() & other.keys()
        if seen(output, where.seen)
    )


def in_brief(key: str, kinds: tuple[str, ...]) -> tuple[str, ...]:
    """Kinds of links for the short test of a key: no beams, if cables or rigid links show the key."""
    return tuple(kind for kind in kinds if kind != "beam") or kinds


def asked() -> dict[str, tuple[str, ...]]:
    """All keys of all scenes of the gallery and of all cases, with the kinds of links they act on."""
    all_keys: set[str] = set()
    for name in scene_names():
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
    from fmus.interface import numbers
    from fmus.track_flexible import model as flexible

    values, links = numbers.values, flexible.chain_links

    def kept(config):
        return {**values(config), "chassis.mass": 5489.24}

    def light(kind, vehicle, *rest):
        return links(kind, {**vehicle, "track": {**vehicle["track"], "mass": 18.02}}, *rest)

    for key, plant in (("vehicle.chassis.mass", (numbers, "values", kept)),
                       ("vehicle.track.mass", (flexible, "chain_links", light))):  # fmt: skip
        assert effect(key, "cable") > ROUNDING
        with monkeypatch.context() as planted:
            planted.setattr(*plant)
            assert effect(key, "cable") < 1.0
