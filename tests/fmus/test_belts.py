"""Belts of one piece: bending and stretch of a belt cut into links, and a smooth wheel that drives it by friction."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import scipy
from named_ports import outputs, parameters

from fmus.track_flexible.model import Model as Flexible
from fmus.track_rigid.model import Model as Rigid
from fmus.vehicles.sides import way_a_turn
from fmus.vehicles.tables import BadInput
from fmus.vehicles.vehicle import read_table, vehicle

pytestmark = pytest.mark.long  # each kind of links is compiled anew with bushes
SHAPE = ("teeth", "outer_radius", "pin_radius", "seat_clearance", "flank_angle", "tip_radius")
BAR = {"bending": "20 N m^2", "length": "1 m", "mass": "8 kg", "thickness": "20 mm", "axial": "10 MN"}
RADIUS, FACE, DISTANCE = 0.25, 1e-3, 1.0  # of the wheels of ``slipping``, half a thickness, distance of the axles, m


def table(links: int, belt: dict, *, own_section: bool = False) -> dict:
    """Table of the m113 with a belt 0.1 m wide instead of its links."""
    raw = read_table("m113")[0]
    raw["track"] |= {"links": links, "width": "0.1 m", "belt": belt}
    for key in ("pitch", "mass", "inertia", "face"):
        del raw["track"][key]
    for name in () if own_section else ("section", "material"):
        del raw[name]
    return raw


def chain(model, links: int, ends: dict, **belt):
    """An open belt without wheels, initialised."""
    own = vehicle(table(links, BAR | belt), "belt").model_dump()
    own["material"]["relaxation_time"] = 1e-3  # so that it comes to rest
    config = {"links": links, "closed": False, "wheels": [], "ground": False, "gravity": 1e-3, "ends": ends}
    if ends["kind"] == "pulled":
        config["gravity"] = 0.0
    made = model({"vehicle": own, "track": config, "link_outputs": ["position", "force", "moment"]})
    made.initialise(parameters(made))
    return made


def elastica(bending: float, length: float, span: float) -> tuple[float, float]:
    """Push, N, and sag, m, of a belt between two pins nearer than its length (Love, Elasticity, 1927, art. 263)."""
    k = scipy.optimize.brentq(
        lambda k: 2.0 * scipy.special.ellipe(k * k) / scipy.special.ellipk(k * k) - 1.0 - span / length, 0.01, 0.95
    )
    quarter = scipy.special.ellipk(k * k)
    return 4.0 * quarter**2 * bending / length**2, k / quarter * length


@pytest.mark.parametrize("model", [Rigid, Flexible])
def test_links_of_a_belt_approach_the_elastica_by_the_square_of_their_pitch(model):
    """A belt of 1 m is cut into 16, 32 and 64 links, flexible ones with bushes in series; the twin is another belt."""
    ends = {"kind": "pinned", "first": [0.0, 0.0], "last": [0.9, 0.0]}
    push, sag = elastica(20.0, 1.0, 0.9)
    misses = []
    for links in (16, 32, 64):
        made = chain(model, links, ends)
        lowest = min(outputs(made)[f"joint[{i}].position.z"] for i in range(1, links + 2))
        misses.append((abs(outputs(made)["joint[1].force.x"]) / push - 1.0, -lowest / sag - 1.0))
    assert np.abs(misses[2]).max() < 3e-4
    for coarse, fine in pairwise(misses):
        assert coarse[0] / fine[0] == pytest.approx(4.0, abs=0.4)
        assert np.abs(coarse).max() > np.abs(fine).max()
    assert elastica(20.02, 1.0, 0.9)[0] / push - 1.0 > 5e-4, "the twin: a thousandth more stiffness"
    if model is Flexible:  # in series with links ten times as stiff as the belt, which else would push 9 % less
        assert made.bushing.stiffness == pytest.approx(20.0 * 64 / 0.9, rel=1e-12)


@pytest.mark.parametrize(("axial", "agrees"), [(1e6, True), (1.02e6, False)])
def test_a_belt_stretches_as_a_bar(axial, agrees):
    """Pulled by F = 1 kN a bar of EA = 1 MN is longer by F L / (EA) = 1 mm."""
    links = 8
    ends = {"kind": "pulled", "first": [1000.0, 0.0], "last": [-1000.0, 0.0]}
    bar = chain(Flexible, links, ends, axial=axial)
    for k in range(100):
        bar.step(k * 1e-3, 1e-3, np.zeros(0))
    length = outputs(bar)["joint[1].position.x"] - outputs(bar)[f"joint[{links + 1}].position.x"]
    assert (length - 1.0 == pytest.approx(1e-3, rel=5e-3)) == agrees


def slipping(model, links: int, friction: float, idler: float) -> tuple[float, float]:
    """Tensions of the runs over one another, and creep of the belt, m/s, on a locked wheel that it grips.

    The driving wheel turns at 2 m/s in a belt without weight that a wheel of radius ``idler`` holds.
    """
    lean = np.arcsin((RADIUS - idler) / DISTANCE)
    path = 2.0 * DISTANCE * np.cos(lean) + (np.pi + 2.0 * lean) * (RADIUS + FACE)
    path += (np.pi - 2.0 * lean) * (idler + FACE)
    length = path * (1.0 - 5e-4)  # what it is tightened by
    belt = {"bending": 0.02, "length": length, "mass": length, "thickness": 2.0 * FACE, "axial": 2e6}
    raw = table(links, belt)
    raw["material"] = {"relaxation_time": 1e-4}
    raw["sprocket"] = {key: value for key, value in raw["sprocket"].items() if key not in SHAPE} | {"radius": RADIUS}
    law = {"stiffness": 1e8 / links, "damping": 1e5 / links, "friction_velocity": 0.01}
    raw["contact"] |= {"wheel": law | {"friction": 0.9}, "sprocket": law | {"friction": friction}}
    own = vehicle(raw, "belt").model_dump()
    assert way_a_turn(own) == pytest.approx(2.0 * np.pi * (RADIUS + FACE), rel=1e-14)
    wheels = [
        {"name": "sprocket", "kind": "driving"},
        {"name": "idler", "kind": "rim", "radius": idler, "position": [-DISTANCE, 0.0]},
    ]
    config = {"links": links, "closed": True, "wheels": wheels, "ground": False, "gravity": 0.0, "ends": None}
    made = model({"vehicle": own, "track": config, "link_outputs": ["tension", "position"]})
    made.initialise(parameters(made, **{"start.lateral": 0.0}))
    u, rate, seen = np.zeros((2, 13)), 2.0 / RADIUS, []
    u[1, 0], u[1, 3] = -DISTANCE, 1.0
    for k in range(500):
        t = k * 1e-3
        angle = rate * (0.5 * t * t / 0.2 if t < 0.2 else t - 0.1)
        u[0, 3], u[0, 5], u[0, 11] = np.cos(0.5 * angle), np.sin(0.5 * angle), rate * min(t / 0.2, 1.0)
        made.step(t, 1e-3, u.ravel())
        if t > 0.4:
            y = outputs(made)
            pins = np.array([[y[f"joint[{i}].position.{a}"] for a in "xz"] for i in range(1, links + 1)])
            tension = np.array([y[f"link[{i}].tension"] for i in range(1, links + 1)])
            free = abs(pins[:, 0] + 0.5 * DISTANCE) < 0.1
            upper, lower = (tension[free & (pins[:, 1] * sign > 0.0)].mean() for sign in (1.0, -1.0))
            seen.append((upper / lower, y["speed"]))
    ratio, creep = np.mean(seen, axis=0)
    return float(ratio), float(creep)


@pytest.mark.parametrize("model", [Rigid, Flexible])
@pytest.mark.parametrize("idler", [RADIUS, 0.15])
def test_a_belt_slips_where_euler_and_eytelwein_say(model, idler):
    """Tensions exp(mu beta) over one another, whose friction acts at the face and not at the line of the pins."""
    friction, ratio, creep = 0.3, *slipping(model, 128, 0.3, idler)
    beta, inside = np.pi + 2.0 * np.arcsin((RADIUS - idler) / DISTANCE), RADIUS / (RADIUS + FACE)
    assert ratio == pytest.approx(np.exp(friction * beta), rel=0.02)
    assert ratio == pytest.approx(np.exp(friction * beta * inside), rel=2e-3)
    for twin in (0.95, 1.05):
        assert ratio != pytest.approx(np.exp(twin * friction * beta), rel=0.02)
    # on the other wheel all points creep alike, at that share of their friction by which the tensions differ there
    share = friction * beta / (0.9 * (2.0 * np.pi - beta))
    rim = (idler + FACE) / idler
    assert abs(creep) == pytest.approx(0.01 * share / np.sqrt(1.0 - share**2) * rim, rel=0.01)


def test_tables_of_smooth_wheels_and_of_belts_that_stretch():
    own = vehicle(table(32, BAR), "belt")
    young, area = own.material.youngs_modulus, own.section.area
    assert young * area == pytest.approx(10e6, rel=1e-14)
    assert young * own.section.bending == pytest.approx(200.0, rel=1e-14)
    assert (own.track.bushing.in_series, own.track.bushing.stiffness) == (True, 640.0)
    assert vehicle(own.model_dump(), "again") == own
    stretched = {"track": {**own.track.model_dump(), "belt": BAR | {"axial": "11 MN"}}}
    smooth = {"radius": 0.2, **dict.fromkeys(("mass", "spin_inertia", "transverse_inertia"), 1.0)}
    for parts, said in (
        (stretched, "material.youngs_modulus x section.area = 1e+07 N: track.belt.axial makes it 1.1e+07 N"),
        ({"sprocket": smooth | {"teeth": 10}}, "sprocket: radius = 0.2 excludes teeth"),
        ({"sprocket": smooth | {"tip_radius": 0.01}}, "tip_radius = 0.01 needs teeth"),
        ({"sprocket": {key: value for key, value in smooth.items() if key != "radius"}}, "key 'teeth' is missing"),
        ({"sprocket": smooth | {"radius": 60.0}}, "sprocket.radius = 60 m: must be 0.001 to 50 m"),
    ):
        with pytest.raises(BadInput) as refused:
            vehicle(own.model_dump() | parts, "own.toml")
        assert said in str(refused.value)
    with pytest.raises(BadInput, match="key 'section' is missing"):
        vehicle(table(32, {key: value for key, value in BAR.items() if key != "axial"}), "own.toml")
