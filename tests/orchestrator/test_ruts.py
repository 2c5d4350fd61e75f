"""Ruts that drawings show: a pad that presses, grows the rut with time and leaves it; beside the rut of the track."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from report_pages import unpacked
from view_files import decoded

from fmus.physics.contact.soil.memory import deepest_at
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results.ground_surface import GroundSurface, ground
from orchestrator.results.page import player
from orchestrator.results.rotation import link_axes
from orchestrator.results.run_data import RunData
from orchestrator.results.views import colours, film, foxglove_scene, ruts
from orchestrator.results.views.bodies import Bodies, LinkPoses, Poses
from orchestrator.results.views.shapes import track_body
from orchestrator.results.views.solids import Reach
from orchestrator.scene.scene import load

LEVEL, DEPTH = -0.6, 0.05
SURFACE = GroundSurface(np.zeros(3), np.array([1.0, 0.0, 0.0]), LEVEL, np.zeros(0), np.zeros(0))


@pytest.fixture(scope="module")
def vehicle():
    return load("soft_ground").vehicle.model_dump()


def bodies(surface, track, t, centres, axes):
    """Bodies of one track whose links have these centres (m, n, 3) and axes (m, n, 3, 3)."""
    links = LinkPoses(centres, centres, axes, None, None)
    return SimpleNamespace(ground=surface, tracks=(track,), blocks=lambda: [Poses(t, {track.name: links}, {}, None)])


@pytest.fixture
def pressed(vehicle):
    """A pad that lies level at x = 0 from 1 s on, and half as deep one length ahead from 2 s on."""
    track = track_body("left_track", 1, False, vehicle)
    length, half = 2.0 * float(track.half[0]), float(track.half[2])
    places = [[0.0, 0.0, LEVEL - DEPTH + half], [length, 0.0, LEVEL - 0.5 * DEPTH + half]]
    down = np.diag([1.0, -1.0, -1.0])
    at = bodies(SURFACE, track, np.array([1.0, 2.0]), np.array(places)[:, None], np.tile(down, (2, 1, 1, 1)))
    return ruts.Ruts(at), length, 2.0 * float(track.half[1])


def test_grousers_are_drawn_and_press_where_they_touch(vehicle):
    """Two bars of 40 mm in the middle of the halves of a link, 50 mm high; the plate is as much less deep."""
    chain = vehicle["track"] | {"grouser": {"height": 0.05, "length": 0.04, "width": 0.3, "count": 2}}
    track, plain = (track_body("left_track", 1, False, vehicle | {"track": each}) for each in (chain, vehicle["track"]))
    pads = [part for part in track.parts if part.kind == "pad"]
    middles = np.array([-0.25, 0.25]) * chain["pitch"]
    assert np.array([part.centre for part in pads]) == pytest.approx(
        np.array([[x, 0.0, chain["face"] + 0.025] for x in middles])
    )
    assert np.array([part.half for part in pads]) == pytest.approx(np.array([[0.02, 0.15, 0.025]] * 2))
    assert [len(each.parts) for each in (track, plain)] == [4, 3]
    chain["grouser"] |= {"width": 0.2, "count": 1}
    track = track_body("left_track", 1, False, vehicle | {"track": chain})
    down, at = np.diag([1.0, -1.0, -1.0]), np.array([[[0.0, 0.0, LEVEL - 0.01 + chain["face"]]]])
    sinkage = []
    for each in (track, plain):
        rut = ruts.Ruts(bodies(SURFACE, each, np.array([1.0]), at, down[None, None]))
        sinkage.append(rut.sinkage(1.0)[rut.sinkage(1.0) > 0.0])
    assert sorted(set(np.round(sinkage[0], 9))) == pytest.approx([0.01, 0.06])
    assert sinkage[1] == pytest.approx(0.01)


def test_a_pad_leaves_its_rectangle(pressed, vehicle):
    rut, length, width = pressed
    corners, depth = rut.tiles(1.5)
    assert depth == pytest.approx(DEPTH)
    area = len(depth) * rut.cell**2
    assert length * width < area < (length + 2.0 * rut.cell) * (width + 2.0 * rut.cell)
    assert corners[..., 2] == pytest.approx(LEVEL - DEPTH)
    assert abs(corners[..., 1]).max() < 0.5 * width + 2.0 * rut.cell
    track, at = track_body("left_track", 1, False, vehicle), np.array([[[0.0, 0.0, LEVEL + 0.2]]])
    above = ruts.Ruts(bodies(SURFACE, track, np.array([0.0]), at, np.eye(3)[None, None]))
    assert not len(above.tiles(1.0)[1]), "a link in the air presses something"


def test_a_rut_grows_with_time_and_stays(pressed):
    rut, length, _ = pressed
    x = np.array([0.0, length, -1.0])

    def heights(t):
        return rut.surface(t).height_under(np.stack([x, 0.0 * x, 0.0 * x], axis=-1))

    late = [LEVEL - DEPTH, LEVEL - 0.5 * DEPTH, LEVEL]
    assert heights(3.0) == pytest.approx(late)
    assert heights(0.5) == pytest.approx(LEVEL)  # also after a later time
    assert heights(1.0) == pytest.approx([LEVEL - DEPTH, LEVEL, LEVEL])
    assert heights(2.0) == pytest.approx(late)
    assert heights(2.0) != pytest.approx([1.03 * h for h in late])


@pytest.mark.parametrize("heading", [0.0, 0.4])
def test_the_ground_in_space_is_whole(pressed, heading):
    """Around the hole and in it: each place once, level at the seam; the rut grows in the hole."""
    rut, _, _ = pressed
    surface = rut.surface(0.0)._replace(terrain=None, ahead=np.array([np.cos(heading), np.sin(heading), 0.0]))
    around, _ = Reach(-1.0, 1.0, 1.0).ground(surface, rut.hole)
    whole = Reach(-1.0, 1.0, 1.0).mesh(surface)
    floor, touched = rut.floor(0.5)
    a, b, c = np.moveaxis(around.corners[around.numbers][..., :2], 1, 0)
    u, v = b - a, c - a
    area = 0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    assert area.min() > 0.0
    assert area.sum() + len(floor) * rut.cell**2 == pytest.approx(np.ptp(whole.x) * np.ptp(whole.y))
    middles = np.round(floor.mean(axis=1)[:, :2] / rut.cell, 6)
    inside = np.abs((a + b + c)[:, None] / 3.0 - rut.cell * middles).max(axis=2) < 0.49 * rut.cell
    assert not inside.any()
    assert not touched.any()
    assert floor[..., 2] == pytest.approx(LEVEL)
    late, touched = rut.floor(3.0)
    assert late[..., 2].min() == pytest.approx(LEVEL - DEPTH)
    assert touched.sum() == len(rut.tiles(3.0)[1]) < len(floor)
    corners, count = np.unique(np.round(late.reshape(-1, 3) / [rut.cell, rut.cell, 1.0], 6), axis=0, return_counts=True)
    assert corners[count < 4, 2] == pytest.approx(LEVEL)  # along the seam
    assert rut.floor(3.0)[0][..., 2].min() != pytest.approx(LEVEL - 1.03 * DEPTH)


@pytest.mark.long
def test_drawn_ruts_are_those_of_the_track():
    """But for what soil springs back, and for the edges of cells; in the frame of the track."""
    from vehicle_in_process import InProcess

    moving = InProcess(load("soft_ground", "rigid", ["drive.ramp_time=0.5 s"]))
    track, pins = moving["left_track"].model, []
    for _ in range(100):
        moving.run(0.02)
        pins.append(track.pins())
    pins = np.array(pins)
    scene = moving.scene.model_dump()
    count = pins.shape[1]
    body = track_body("left_track", count, True, scene["vehicle"])
    axes = link_axes(pins, np.array([0.0, 1.0, 0.0]), count)
    centres, t = 0.5 * (pins + np.roll(pins, -1, axis=1)), 0.02 * np.arange(1, 101)
    rut = ruts.Ruts(bodies(ground(scene), body, t, centres, axes))
    x = np.arange(-4.0, -3.0, 0.1)  # behind the last wheel
    x = x[np.array([deepest_at(track.s.rut, place, 0.0) for place in x]) > 0.02]
    own = np.array([deepest_at(track.s.rut, place, 0.0) for place in x])
    surface = rut.surface(2.0)
    drawn = surface.level - surface.height_under(np.stack([x, 0.0 * x, 0.0 * x], axis=-1))
    assert len(x) > 3
    assert np.median(abs(drawn - own)) < 5e-3
    assert np.median(abs(1.1 * drawn - own)) > 5e-3


def test_hard_ground_has_no_ruts():
    hard = SimpleNamespace(scene={"ground": {"grade": 0.1}}, ground=object())
    assert ruts.untouched(hard) is None
    assert ruts.hole(hard) is None
    assert not [*ruts.floors(hard)]
    assert ruts.ground_at(hard, 1.0) is hard.ground
    assert ruts.inside(hard) == 0.0


@pytest.mark.long
def test_renderers_draw_the_same_rut(tmp_path, monkeypatch):
    """Of a vehicle that rests in the sand; the ground before it came is level."""
    pytest.importorskip("foxglove")
    path = tmp_path / "sand.mcap"
    simulate(load("soft_ground", "rigid", ("run.stop=0.05", "run.links=10", "expect={}")), path)
    with Log(path) as log:
        at = Bodies(RunData(log), 1e4)
        level, deepest = at.ground.level, ruts.ruts_of(at.run).sinkage(np.inf).max()
        assert 0.05 < deepest < 0.2
        foxglove_scene.write(path, tmp_path / "x.mcap")
        entities = [each for message in decoded(tmp_path / "x.mcap", "/shapes") for each in message.entities]
        rut = [each for each in entities if each.id == "ruts"][-1].triangles
        lowest, highest = (f(p.z for part in rut for p in part.points) for f in (min, max))
        assert highest == pytest.approx(level, abs=1e-6)
        assert level - deepest - 1e-6 < lowest < level - 0.8 * deepest  # corners are means of four cells
        around = next(each for each in entities if each.id == "ground").triangles[0]
        assert {round(p.z - level, 6) for p in around.points} == {0.0}
        drawn, draw, dashes = [], LineCollection.draw, LineCollection([], **colours.UNTOUCHED).get_linestyle()
        monkeypatch.setattr(LineCollection, "draw", lambda *given: (drawn.append(given[0]), draw(*given)))
        [*film.FilmPicture(at, "right", 400).frames(25.0)]
        (dashed,) = next(one for one in drawn if one.get_linestyle() == dashes).get_segments()
        assert np.ptp(dashed[:, 1]) == pytest.approx(0.0, abs=1e-9)
        table = player.player(RunData(log), "left_track")["ground"]
        before, after = (unpacked(each["sections"]).reshape(-1, 2) for each in (table["untouched"], table))
        assert table["untouched"]["counts"] == [2] * len(table["counts"])
        assert before[:, 1].max() - after[:, 1].min() == pytest.approx(deepest, abs=5e-3)
        assert abs(before[:, 1] - after[:, 1].max()).max() < 1e-5
