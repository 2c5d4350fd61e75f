"""Stiffnesses change deflections as statics predicts, for all kinds of links.

The references are scalings: deflection by force over stiffness, motion by stiffness over density. Each is tested by a
change of a tenth and would show a wrong effect of a few per cent (``FAINT``). Weights: ``test_vehicle_layouts``.
"""

import math
from functools import cache

import numpy as np
import pytest
from vehicle_in_process import InProcess

from orchestrator.scene.scene import from_table, load
from orchestrator.scene.settings import set_key

MORE = 1.1
FAINT = 0.03
PREDICTED = (
    "cable",
    pytest.param("planar", marks=pytest.mark.long),
    pytest.param("beam", marks=pytest.mark.study),
    "rigid",
)
# half a vehicle at rest in long steps: statics does not depend on them
STANDING = ("symmetric=true", "run.step=2 ms", "track.step=2 ms", "track.link_outputs=false", "placed=true")


def of(kind):
    """Settings that choose a kind of links."""
    return {"planar": ("planar=true",), "beam": ("track.element=beam",)}.get(kind, ())


def scene_of(name, kind, settings=(), **changes):
    table = load(name, "rigid" if kind == "rigid" else "flexible", (*settings, *of(kind))).resolved()
    for key, value in changes.items():
        set_key(table, key, value)
    return from_table(table, name)


@cache
def settled(kind):
    """States by component of half a vehicle at rest."""
    vehicle = InProcess(scene_of("settle", kind, STANDING)).run(1.6)
    return {name: member.model.state.copy() for name, member in vehicle.members.items()}


@cache
def standing(kind, *changes):
    """Mean outputs of a settled vehicle after a change, with a fading window: ringing cancels."""
    vehicle = InProcess(scene_of("settle", kind, STANDING, **dict(changes)))
    vehicle.step()  # in the first step a track compares its wheels with those round which it was laid
    for name, member in vehicle.members.items():
        member.model.state[:] = settled(kind)[name]
        member.model.outputs(member.y)
    vehicle.run(0.4)
    fading = np.hanning(401)
    means: dict[str, float] = {}
    for share in fading / fading.sum():
        vehicle.step()
        for member in vehicle.members.values():
            for name, value in zip(member.outputs, member.y, strict=True):
                key = f"{member.name}.{name}"
                means[key] = means.get(key, 0.0) + share * value
    return means


def potential(means):
    """Potential energy of a whole vehicle, J: stored energy and height of chassis and tracks."""
    body = sum(means[f"chassis.energy.{part}"] for part in ("gravity", "spring"))
    return body + 2.0 * sum(means[f"left_track.energy.{part}"] for part in ("gravity", "strain", "contact"))


@pytest.mark.parametrize("kind", PREDICTED)
def test_a_stiffer_contact_stores_less(kind):
    """A stiffer contact stores less: at rest d(potential)/d(ln k) is the energy in the springs k."""
    laws = load("settle", "rigid").vehicle.contact
    pairs = ("sprocket", "wheel", "ground")
    stiffer = tuple((f"vehicle.contact.{pair}.stiffness", MORE * getattr(laws, pair).stiffness) for pair in pairs)
    before, after = standing(kind), standing(kind, *stiffer)
    stored = before["left_track.energy.contact"] + after["left_track.energy.contact"]  # twice the mean, of two sides
    assert potential(after) - potential(before) == pytest.approx(math.log(MORE) * stored, rel=FAINT)


def test_a_stiffer_suspension_gives_less():
    """A stiffer suspension gives less: its loads stay, so its shortening is force over stiffness."""
    table = load("settle", "rigid").vehicle
    drawn = math.dist(table.suspension.on_arm, table.suspension.on_chassis)
    stiffer = standing("cable", ("vehicle.suspension.stiffness", MORE * table.suspension.stiffness))
    names = [f"chassis.left.suspension[{i}].length" for i in range(1, 6)]
    given, less = (sum(drawn - means[name] for name in names) for means in (standing("cable"), stiffer))
    assert less == pytest.approx(given / MORE, rel=FAINT)


@pytest.mark.parametrize("key", ["suspension", "tensioner"])
def test_a_preload_is_balanced_by_its_stiffness(key):
    """A preload is balanced by the stiffness: a push P moves the spring by P/k."""
    force = 1e3

    def place(chassis):
        """Length of the first spring, or distance of the idler behind the chassis along it, m."""
        if key == "suspension":
            return chassis["left.suspension[1].length"]
        behind, below = (chassis[f"left.idler.position.{x}"] - chassis[f"chassis.position.{x}"] for x in "xz")
        return -(math.cos(chassis["pitch"]) * behind - math.sin(chassis["pitch"]) * below)

    def moved(stiffness):
        settings = ("tracks=[]", "vehicle.gravity=0", "placed=true", "start.height=1")
        changes = {"stiffness": stiffness, "preload": force, "damping": 3e4}
        changes = {f"vehicle.{key}.{name}": value for name, value in changes.items()}
        chassis = InProcess(scene_of("settle", "cable", settings, **changes))["chassis"]
        start = place(chassis)
        for k in range(600):
            chassis.step(5e-3 * k, 5e-3)
        return place(chassis) - start

    assert moved(1e6) == pytest.approx(force / 1e6, rel=1e-3)
    assert moved(2e6) == pytest.approx(force / 2e6, rel=1e-3)


def spun(kind, **changes):
    """Stretch of the chords of a spinning loop, and rotation of a link's ends relative to its chord, rad."""
    model = InProcess(scene_of("spinning_loop", kind, ("chain.links=16",), **changes))["chain"].model
    places = model.pins()
    chord = np.roll(places, -1, axis=0) - places
    length = np.linalg.norm(chord, axis=1)
    along = (chord / length[:, None])[:, [0, 2]]
    slope = model.s.q[:, model.kit.PLANE[1 if kind == "beam" else 2]] if kind != "beam" else model.s.q[:, [12, 14]]
    turned = (along[:, 0] * slope[:, 1] - along[:, 1] * slope[:, 0]) / np.linalg.norm(slope, axis=1)
    return float(length.mean() / 0.1524 - 1.0), float(abs(turned).mean())


@pytest.mark.parametrize(
    "kind", ["cable", *(pytest.param(kind, marks=pytest.mark.long) for kind in ("planar", "beam"))]
)
def test_links_stretch_and_bend_by_their_stiffness(kind):
    """Links stretch by T/EA and bend by w l^3/24EI under their own m omega^2 Rc, on two pins."""
    table = load("spinning_loop", "flexible").vehicle
    mass, E, section, p, links, omega = table.track.mass, table.material.youngs_modulus, table.section, 0.1524, 16, 5.0
    middle = p / (2.0 * math.tan(math.pi / links))
    tension = mass * omega**2 * middle / (2.0 * math.tan(math.pi / links))
    turn = mass * omega**2 * middle * p**2 / (24.0 * E * section.bending)
    stretched, turned = spun(kind)
    assert stretched == pytest.approx(tension / (E * section.area), rel=0.02)
    if kind != "beam":  # one beam per link is too stiff in bending: shear locks it (fmus/physics/README.md)
        assert turned == pytest.approx(turn, rel=FAINT)
    for key, value, stretch, bend in (
        ("vehicle.section.area", section.area, MORE, 1.0 if kind != "beam" else None),
        ("vehicle.section.bending", section.bending, 1.0, MORE),
        ("vehicle.material.youngs_modulus", E, MORE, MORE if kind != "beam" else None),
        ("vehicle.track.mass", mass, 1.0 / MORE, 1.0 / MORE),
    ):
        less_stretched, less_turned = spun(kind, **{key: MORE * value})
        assert less_stretched == pytest.approx(stretched / stretch, rel=0.01), key
        if bend is not None:
            assert less_turned == pytest.approx(turned / bend, rel=FAINT), key
