"""Ground as it is drawn and as links touch it, against the heights of the ground and the contact law."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from report_pages import unpacked
from short_runs import terrain_log
from view_files import bodies_of, decoded

from fmus.ground.contact import ground_shape
from fmus.ground.terrain import heights
from fmus.physics.contact.ground import surface_depth
from fmus.vehicles.tables import BadInput
from orchestrator.log.reader import Log
from orchestrator.results.ground_mesh import MAX_QUADRANGLES, PRECISION, bends, ground_mesh
from orchestrator.results.ground_surface import ground
from orchestrator.results.page import player
from orchestrator.results.run_data import RunData
from orchestrator.results.validity import chain_checks
from orchestrator.results.views import film, flat_views, foxglove_scene, projected
from orchestrator.results.views.bodies import Bodies
from orchestrator.results.views.solids import Reach
from orchestrator.scene.scene import load

driven = pytest.fixture(scope="module")(terrain_log)
shown = pytest.fixture(bodies_of)

GROUNDS = {
    "inclined": {"grade": 0.2, "bank": -0.1, "incline_start": 1.0},
    "stairs": {"step": {"x": [1.0, 2.5], "rise": 0.3, "radius": 0.02}},
    "half round": {"half_round": {"x": [0.5, 2.0], "radius": 0.2, "fillet": 0.02}, "grade": 0.2},
    "trench": {"trench": {"start": 1.0, "width": 1.2, "depth": 0.8, "radius": 0.02}, "bank": 0.1},
    "kerb": {"kerb": {"y": -0.8, "rise": 0.2, "radius": 0.02}},
    "washboard": {"washboard": {"amplitude": 0.05, "wavelength": 1.0, "phase": 1.0, "start": -2.0}},
    "surface": {"rough": {"iso_class": "C", "isotropic": True, "period": 50.0, "band": [0.02, 1.0]}},
    "rough": {"rough": {"iso_class": "F", "start": -3.0, "period": 50.0, "band": [0.02, 1.0]}},
    "map": {
        "heightmap": {
            "heights": [[0.0, 0.1, 0.0], [0.3, 0.2, 0.1], [0.0, 0.3, 0.2]], "corner": [-2, -2], "spacing": [2, 2],
        }
    },
}  # fmt: skip


def surface_of(name, **start):
    """Ground of a scene of that name, and the heights at places in world by its table alone."""
    settings = {f"ground.{key}": value for key, value in GROUNDS[name].items()}
    scene = load("straight", "rigid", settings | {f"start.{key}": value for key, value in start.items()}).model_dump()
    wheel = scene["vehicle"]["road_wheel"]
    level = scene["start"]["position"][2] + wheel["z"] - wheel["radius"] - 2.0 * scene["vehicle"]["track"]["face"]
    return ground(scene), lambda x, y: level + heights(scene["ground"], x, y)


def off(drawn, true, steep):
    """Largest distance of drawn heights from true ones, m, where the ground is not nearly a wall."""
    return float(np.abs(drawn - true)[~steep].max())


def interpolated(triangles, x, y):
    """Heights of a triangulated surface at places (n,), m."""
    a, b, c = np.moveaxis(triangles.corners[triangles.numbers], 1, 0)
    u, v, found = (b - a)[:, :2].T, (c - a)[:, :2].T, np.full(len(x), np.nan)
    for k, place in enumerate(np.stack([x, y], axis=1)):
        w, area = (place - a[:, :2]).T, u[0] * v[1] - u[1] * v[0]
        s, t = (w[0] * v[1] - w[1] * v[0]) / area, (u[0] * w[1] - u[1] * w[0]) / area
        inside = np.flatnonzero((s > -1e-9) & (t > -1e-9) & (s + t < 1.0 + 1e-9))[0]
        found[k] = a[inside, 2] + s[inside] * (b - a)[inside, 2] + t[inside] * (c - a)[inside, 2]
    return found


@pytest.mark.parametrize("name", GROUNDS)
def test_mesh_and_sections_are_the_heights_of_the_ground(name):
    """Mesh and sections at random places; the direction of the start plays no part."""
    surface, true = surface_of(name, heading=0.4, position=[1.0, -2.0, 0.3])
    draw = np.random.default_rng(1)
    x, y = draw.uniform(-4.0, 4.0, (2, 150))
    places = np.stack([x, y, np.zeros(150)], axis=1)
    np.testing.assert_allclose(surface.height_under(places), true(x, y), atol=1e-12)
    steep = surface.normals(places)[:, 2] < 0.3
    triangles, lines = Reach(-4.0, 4.0, 4.0).ground(surface)
    assert (np.diff(triangles.corners[triangles.numbers][..., :2], axis=1) != 0.0).any(axis=2).all()
    assert len(triangles.numbers) <= 2 * MAX_QUADRANGLES
    a, b, c = np.moveaxis(triangles.corners[triangles.numbers], 1, 0)
    assert (np.cross(b - a, c - a)[:, 2] > 0.0).all()  # the outside is up
    assert off(interpolated(triangles, x, y), true(x, y), steep) < PRECISION
    ends = lines.reshape(-1, 3)
    assert off(ends[:, 2] - 0.003, true(*ends[:, :2].T), surface.normals(ends)[:, 2] < 0.3) < PRECISION
    camera = projected.make_camera("right", 0.7, np.array([0.5, 0.3, 1.0]))
    line, metres = projected.section(camera, surface, -5.0, 5.0)
    along = draw.uniform(-5.0, 5.0, 300)
    at = camera.centre + along[:, None] * camera.right
    assert off(np.interp(along, *line.T), true(*at.T[:2]) - 1.0, surface.normals(at)[:, 2] < 0.3) < PRECISION
    marks = camera.centre + metres[:, :1] * camera.right
    np.testing.assert_allclose(metres[:, 1], true(*marks.T[:2]) - 1.0, atol=1e-9)
    np.testing.assert_allclose(surface.station(marks), metres[:, 2], atol=1e-9)
    # twins: the ground a little aside, and one that is a little higher
    if name not in ("rough", "surface"):
        assert off(interpolated(triangles, x, y), true(x + 0.05, y + 0.05), steep) > PRECISION
    assert off(interpolated(triangles, x, y), 1.02 * true(x, y) + 2e-3, steep) > PRECISION


def test_normals_of_a_terrain():
    surface, _ = surface_of("half round")
    x = np.array([-2.0, 2.0 - 0.1, 2.0 + 0.1])
    normals = surface.normals(np.stack([x, x, x], axis=1))
    slope = 0.2 + np.array([0.0, 1.0, -1.0]) * 0.1 / np.sqrt(0.2**2 - 0.1**2)
    expected = np.stack([-slope, 0.0 * slope, 1.0 + 0.0 * slope], axis=1) / np.sqrt(1.0 + slope**2)[:, None]
    np.testing.assert_allclose(normals, expected, atol=1e-5)


def test_a_plane_needs_one_quadrangle_and_a_long_way_no_more_than_allowed():
    surface, _ = surface_of("inclined")
    assert ground_mesh(surface, np.array([-9.0, -9.0]), np.array([0.0, 9.0])).z.shape == (2, 2)
    rough, _ = surface_of("rough")
    mesh = ground_mesh(rough, np.array([0.0, -5.0]), np.array([45.0, 5.0]), most=200)
    assert len(mesh.quads()) <= 200
    part = mesh.around(np.array([20.0, 0.0]), 3.0)
    assert part.x[0] <= 17.0 < part.x[1]
    assert part.x[-2] < 23.0 <= part.x[-1]
    assert len(bends(lambda x: np.sin(3.0 * x)[:, None], 0.0, 50.0, 30)) == 30


@pytest.mark.long
def test_the_deepest_place_is_the_ground_where_it_is(shown):
    log, _, _ = shown
    depth = chain_checks.depths(RunData(log), "left_track", 0.02)["ground"]
    recorded = max(log.sample([f"left_track.link[{i + 1}].ground.depth" for i in range(64)], np.array([0.02]))[0])
    assert recorded > 8e-3
    assert depth == pytest.approx(recorded, abs=3e-3)


@pytest.mark.long
def test_renderers_draw_that_ground(shown, tmp_path, monkeypatch):
    pytest.importorskip("foxglove")
    log, bodies, poses = shown
    surface = bodies.ground
    foxglove_scene.write(log.path, tmp_path / "x.mcap")
    entity = next(each for each in decoded(tmp_path / "x.mcap", "/shapes")[0].entities if each.id == "ground")
    points = np.array([[p.x, p.y, p.z] for p in entity.triangles[0].points])
    steep = surface.normals(points)[:, 2] < 0.3
    assert off(points[:, 2], surface.height_under(points), steep) < 1e-5  # numbers of the file are float32
    assert np.ptp(points[:, 0]) > 10.0
    seen = []
    section = projected.section
    monkeypatch.setattr(projected, "section", lambda *given: (seen.append(given), section(*given))[1])
    next(film.FilmPicture(bodies, "right", 400).frames(1.0))  # a film: sections under both tracks
    for (camera, ground_of_film, *_, near), track in zip(seen, ("left_track", "right_track"), strict=False):
        middle = (poses.links[track].centres[0].mean(axis=0) - camera.centre) @ camera.toward
        assert (ground_of_film, near) == (surface, pytest.approx(middle + bodies.tracks[0].half[1], abs=1e-12))
    # side view and player: the section under the track
    view = flat_views.side_view(bodies, poses)
    pane = Figure().subplots()
    flat_views.draw_view(pane, view, surface, (0.0, 1.0), flat_views.extent([view]))
    line = next(each for each in pane.collections if each.get_zorder() == 0).get_paths()[0].vertices
    line = line[np.abs(line[:, 1] - line[:, 1].min()) > 1e-9]  # without the lower edge
    at = view.camera.centre + view.near * view.camera.toward + line[:, :1] * view.camera.right
    over = surface.height_under(at) - view.camera.centre[2]
    assert off(line[:, 1], over, surface.normals(at)[:, 2] < 0.3) < 1e-9
    monkeypatch.setattr(player, "RATE", 100.0)
    table = player.player(RunData(log), "left_track")["ground"]
    assert len(table["counts"]) == 3
    first = unpacked(table["sections"]).reshape(-1, 2)[: table["counts"][0]]
    camera = projected.side_camera(bodies, poses, 0, "left_track")
    at = camera.centre + first[:, :1] * camera.right
    under = np.interp(np.linspace(-4.0, 0.0, 50), *first.T)
    assert abs(under.mean()) < 0.1  # the pictures follow the ground
    one = Bodies(RunData(log), 1e4, track="left_track")
    over = surface.height_under(at) - one.height_of_ground(next(one.blocks()), 0)
    assert off(first[:, 1], over, surface.normals(at)[:, 2] < 0.3) < 1e-5


# --- the line of a bump against the contact law ------------------------------------------------------

BUMP = "ground.bump={start=2, rise=0.2, slope=0.35, length=0.6, radius=0.15}"


@pytest.mark.parametrize("settings", [(), (BUMP,), (BUMP, "start.position=[3.0, -1.0, 0.5]", "start.heading=0.4")])
def test_points_of_the_line_lie_on_the_ground(settings):
    scene = load("straight", "rigid", settings)
    profile = ground(scene.model_dump())
    bump = scene.ground.bump and scene.ground.bump.model_dump()
    shape = ground_shape(scene.vehicle.model_dump(), {"bump": bump}, {"start.height": 0.0})
    along = np.concatenate([np.linspace(-1.0, 6.0, 300), profile.along])
    depths = [
        surface_depth(shape, x, z - profile.start[2])[0] for x, z in zip(along, profile.height_at(along), strict=True)
    ]
    # a straight line between two points of an arc is below it by less than this
    assert np.abs(depths).max() < 0.15 * (0.35 / 8) ** 2 / 8 * 1.1
    assert len(profile.along) == (36 if bump else 0)
    assert not bump or profile.height_at(np.array([profile.along.mean()]))[0] == pytest.approx(profile.level + 0.2)


@pytest.mark.long
@pytest.mark.long
def test_a_ground_that_is_no_ground_is_refused(driven, monkeypatch):
    with Log(driven) as log:
        run = RunData(log)
        run.scene["ground"]["half_round"] = {"x": [1.0], "radius": "much"}
        with pytest.raises(BadInput):
            Bodies(run, 25.0)
