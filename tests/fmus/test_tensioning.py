"""The place of the tensioning wheel: the track has the asked tension there, and it is computed once per build."""

import re

import numpy as np
import pytest
import random_vehicles
from named_ports import parameters
from scipy.optimize import brentq

from fmus.physics.chain import layout
from fmus.physics.chain.report import T_MEAN
from fmus.rest import tensioning
from fmus.track.start import drawn
from fmus.track_flexible.model import Model as Flexible
from fmus.track_rigid.model import Model as Rigid
from fmus.vehicles.tables import BadInput
from orchestrator.scene.assembly import assemble
from orchestrator.scene.parts import closed_track_config
from orchestrator.scene.placing import placed
from orchestrator.scene.scene import load

CONFIG = next(part.config for part in assemble(load("straight")).parts if part.kind == "TrackFlexible")


def test_a_place_is_computed_once_for_a_track_and_a_tension(monkeypatch, fresh_cache):
    searched = []

    def search(config, name, tension, keys, links):
        searched.append(tension)
        return -4.0 + 1e-17 * tension / 3.0, 0.4, tension / 7.0, tension, ""

    monkeypatch.setattr(tensioning, "search", search)
    lighter = CONFIG | {"vehicle": CONFIG["vehicle"] | {"track": CONFIG["vehicle"]["track"] | {"mass": 1.0}}}
    first = tensioning.tension_wheel(CONFIG, "idler", 1e4)
    for config, tension, new in ((CONFIG, 1e4, 0), (CONFIG, 1.01e4, 1), (lighter, 1e4, 1), (CONFIG, 1e4, 0)):
        before = len(searched)
        assert (tensioning.tension_wheel(config, "idler", tension) == first) == (tension == 1e4)
        assert len(searched) == before + new


@pytest.mark.parametrize("tension", [8e3, 2.7e4])
def test_few_equilibria_find_the_place_that_the_whole_range_gives(tension, monkeypatch):
    """A bracket near the drawn place saves equilibria, and the place is the same."""
    near = tensioning.Track(CONFIG, "idler", tensioning.CABLES)
    far = tensioning.Track(CONFIG, "idler", tensioning.CABLES)
    monkeypatch.setattr(far, "near", lambda tension, reach: (far.drawn, far.drawn))
    places = [track.place(tension, tensioning.REACH) for track in (near, far)]
    assert places[0] == pytest.approx(places[1], abs=1.01e-8)
    assert near.tension(places[0]) == pytest.approx(tension, abs=0.1)
    assert len(near.found) <= 10
    assert len(near.found) <= len(far.found) - 2


ASKED = 1e-3  # relative difference of tensions
REAR = (16, 52, 83)  # random vehicles with the sprocket at the rear, on which pins are easily laid on teeth


def scene_of(k, links="rigid", **settings):
    """Scene of the random vehicle ``k``, as drawn."""
    table = random_vehicles.random_vehicle(k)
    return load("straight", links, {"vehicle": table, "start.state": "drawn", **settings})


def track_of(scene):
    """Config of the left track."""
    config = closed_track_config(scene)
    track = {key: value for key, value in config["track"].items() if key != "terrain"}
    return {**config, "track": {**track, "wheels": drawn(config["vehicle"], track["wheels"])}}


def laid(config, x, kind=Flexible):
    """Track at rest, laid out with its idler at x."""
    wheels = [
        {**w, "position": [x, w["position"][1]]} if w["name"] == "idler" else w for w in config["track"]["wheels"]
    ]
    model = kind({**config, "track": {**config["track"], "wheels": wheels}, "link_outputs": False})
    model.initialise(parameters(model))
    return model


@pytest.mark.parametrize("k", REAR[:1])
def test_a_chain_laid_out_anew_is_the_one_that_was_tightened(k):
    """The same tension at each place of the idler, laid out there or followed from the slack side."""
    config = track_of(scene_of(k))
    first = next(w["position"][0] for w in config["track"]["wheels"] if w["name"] == "idler")
    places = first + 0.01 * np.arange(-3, 3) * np.sign(first)
    followed, tensions = laid(config, places[0]), []
    for x in places:
        rows = followed.start_rows.copy()
        rows[[w["name"] == "idler" for w in config["track"]["wheels"]], 0] = x
        followed.find_equilibrium(rows)
        tensions.append(followed.report[T_MEAN])
    anew = [laid(config, x).report[T_MEAN] for x in places]
    assert np.all(np.diff(anew) > 0.0)
    np.testing.assert_allclose(anew, tensions, rtol=1e-5)


@pytest.mark.parametrize("k", [REAR[0], *(pytest.param(k, marks=pytest.mark.long) for k in REAR[1:])])
def test_the_tension_asked_is_had(k):
    scene = scene_of(k)
    config, asked = track_of(scene), scene.vehicle.track.tension
    x = search(config, asked).x
    assert laid(config, x).report[T_MEAN] == pytest.approx(asked, rel=1e-5)
    assert laid(config, x + 2e-4).report[T_MEAN] != pytest.approx(asked, rel=ASKED)


def test_rigid_links_as_drawn_have_the_tension_asked():
    """They do not stretch: at the place of cables the m113's carry 0.18 % more."""
    config = track_of(load("settle", "rigid"))
    cables, rigid = (
        tensioning.tension_wheel(config, "idler", 16.3e3, links=links).x
        for links in (tensioning.CABLES, ("TrackRigid", {}))
    )
    assert laid(config, rigid, Rigid).report[T_MEAN] == pytest.approx(16.3e3, rel=1e-5)
    assert cables == -4.00164022
    assert laid(config, cables, Rigid).report[T_MEAN] != pytest.approx(16.3e3, rel=ASKED)


def search(config, tension, links=tensioning.CABLES):
    return tensioning.search(config, "idler", tension, "vehicle.track", links)


@pytest.mark.long
def test_a_tension_out_of_reach_is_told_with_the_nearest_which_can_be_had():
    config = track_of(scene_of(6))
    place = search(config, 1845.3)
    assert re.fullmatch(r"not reached with the idler .* where the track carries [\d.]+ to [\d.]+ N: .*", place.missed)
    assert laid(config, place.x).report[T_MEAN] == pytest.approx(place.tension, rel=1e-9)
    again = search(config, place.tension)
    assert (again.x, again.missed) == (pytest.approx(place.x, abs=1e-8), "")
    assert search(config, place.tension * (1.0 - 2.0 * ASKED)).missed


def test_a_tension_that_is_jumped_over_is_refused_with_both_sides(monkeypatch):
    """A chain whose tension leaps from 1 to 3 kN where its idler is 7 mm further out."""

    def tension(track, x):
        track.found[x] = (1e5 * (x + 0.01) + 2e3 * (x > 0.007), 1.0)
        return track.found[x][0]

    config = {"track": {"wheels": [{"name": "idler", "position": [0.0, 0.0]}], "links": 10}}
    config["vehicle"] = {"track": {"pitch": 0.1524}, "sprocket": {}}
    monkeypatch.setattr(tensioning.Track, "tension", tension)
    monkeypatch.setattr(tensioning.Track, "outwards", 1.0, raising=False)
    monkeypatch.setattr(tensioning.Track, "advice", lambda *_: "; 9 links would fit")
    for asked, nearest in ((2.0e3, 1.7e3), (3.0e3, 3.7e3)):
        place = search(config, asked)
        assert place.tension == pytest.approx(nearest)
        assert "N and jumps as a pin changes its seat: vehicle.track.links = 10" in place.missed
        assert place.missed.endswith("decide it; 9 links would fit")
    assert search(config, 3.8e3).x == pytest.approx(0.008)


def test_a_slack_track_hangs_as_a_catenary():
    """A tension of 0 moves the idler inwards; of a free span, slopes change by a link's weight over one pull."""
    scene = scene_of(31, **{"vehicle.track.tension": 0.0})
    config, track = track_of(scene), scene.vehicle.track
    x = search(config, 0.0).x
    assert x == pytest.approx(scene.vehicle.idler.x - 0.06 * track.pitch / 0.1524)
    model = laid(config, x)
    pins = model.pins()[:, [0, 2]]
    chord = np.roll(pins, -1, axis=0) - pins
    free = (chord[:, 0] > 0.0) & (pins[:, 0] > 0.25 * x) & (pins[:, 0] < 0.75 * x)  # the upper run goes forward
    slopes, links = (chord[:, 1] / chord[:, 0])[free], int(free.sum())
    pull = track.mass * scene.vehicle.gravity / np.diff(slopes)
    assert links == 9
    assert np.ptp(pull) < 1e-3 * pull.mean()
    assert model.report[T_MEAN] == pytest.approx(pull.mean(), rel=0.05)
    first = int(np.argmax(free))
    for mass, same in ((1.0, True), (1.05, False)):  # a hanging chain has the form of its pull over its weight
        steps = (np.arange(links) - np.argmin(abs(slopes))) * mass * track.mass * scene.vehicle.gravity / pull.mean()
        form = layout.chain_of_angles(pins[first], np.arctan(steps + slopes[np.argmin(abs(slopes))]), track.pitch)
        assert (abs(form[:-1] - pins[first : first + links]).max() < 1e-4) == same


def test_the_range_of_the_search_is_that_of_the_m113_in_pitches(monkeypatch):
    for name, reach in (("m113", 0.06), ("robot", 0.06 * 0.04 / 0.1524)):
        scene = load("straight", "rigid", {"vehicle": name})
        asked = []
        monkeypatch.setattr(tensioning.Track, "end", lambda self, way, asked=asked: asked.append(way) or self.drawn)
        place = search(track_of(scene), 1e7)
        assert f"within {1e3 * reach:.3g} mm" in place.missed
        assert asked[1:] == pytest.approx([-reach, reach], rel=1e-14)
        assert abs(asked[0]) == pytest.approx(reach, rel=1e-14), "of the search near the drawn place"


def test_a_belt_that_does_not_fit_is_refused_with_the_place_that_would():
    """Of two wheels the open belt has a formula."""
    scene = load("rig", "rigid", {"rig.links": 40})
    with pytest.raises(BadInput, match="axle_distance") as refusal:
        placed(scene)
    pitch, face = scene.vehicle.track.pitch, scene.vehicle.track.face
    large, small = 0.5 * pitch / np.sin(np.pi / 10), scene.vehicle.idler.radius + face

    def length(d):
        lean = np.arcsin((large - small) / d)
        return 2.0 * d * np.cos(lean) + np.pi * (large + small) + 2.0 * lean * (large - small)

    exact = brentq(lambda d: length(d) - 40 * pitch, 0.5, 10.0)
    printed = float(re.findall(r"distance = ([\d.]+)", str(refusal.value))[0])
    assert printed == pytest.approx(exact, abs=1e-3)
    rig = load("rig", "rigid", {"rig.links": 40, "rig.axle_distance": printed})
    assert tensioning.tension_wheel(closed_track_config(rig), "idler", rig.rig.tension, "rig").x < 0.0


@pytest.mark.study
def test_of_100_random_vehicles_none_is_wrong():
    """Each as drawn has the tension asked, to 0.1 %, on cables and rigid links, or the nearest with a sentence."""
    missed = 0
    for k in range(random_vehicles.COUNT):
        scene = scene_of(k)
        config, asked = track_of(scene), scene.vehicle.track.tension
        for links, kind in ((tensioning.CABLES, Flexible), (("TrackRigid", {}), Rigid)):
            place = search(config, asked, links)
            assert bool(place.missed) == (abs(place.tension / asked - 1.0) > ASKED), (k, kind)
            assert laid(config, place.x, kind).report[T_MEAN] == pytest.approx(place.tension, rel=ASKED), (k, kind)
            missed += bool(place.missed)
    assert missed < 0.2 * 2 * random_vehicles.COUNT


@pytest.mark.parametrize("sag", [0.0, 0.02, 0.1])
def test_the_sag_of_the_longest_span_is_that_of_a_straightedge(sag):
    """Over two rims 3 m apart, as a parabola; the span along the ground is longer, but borne."""
    centres, radii = np.array([[0.0, 0.0], [-3.0, 0.1], [0.2, -0.4], [-3.4, -0.4]]), np.array([0.3, 0.2, 0.3, 0.3])
    ends = np.array([[-3.0, 0.3], [0.0, 0.3]])
    along = np.linspace(0.0, 1.0, 25)
    upper = (
        ends[0] + along[:, None] * (ends[1] - ends[0]) + [[0.0, 1.0]] * (-4.0 * sag * along * (1.0 - along))[:, None]
    )
    round_ = [[0.5, -0.2], [0.2, -0.7], [-1.5, -0.7], [-3.4, -0.7], [-3.65, -0.3]]
    pins = np.vstack([round_, upper])
    borne = np.array([False, False, True, True])
    assert layout.sag_of_longest_span(centres, radii, borne, pins) == pytest.approx(sag, abs=1e-3)
    assert layout.sag_of_longest_span(centres, radii, borne & False, pins) == pytest.approx(0.0, abs=1e-9)
