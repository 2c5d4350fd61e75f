"""Places of bodies in views, against log and contact laws; one link and one tooth in all drawings."""

import base64

import numpy as np
import pytest
from made_logs import stretched
from report_pages import unpacked
from scipy.spatial import ConvexHull, Delaunay
from scipy.spatial.transform import Rotation
from short_runs import STEP, hanging_log, settling_log, terrain_log
from view_files import bodies_of, decoded

from fmus.ground.refinement import refinement
from fmus.physics.contact.guide import HORN
from fmus.vehicles.vehicle import read_table, vehicle
from orchestrator.log.reader import Log
from orchestrator.results.ground_surface import ground
from orchestrator.results.page import player
from orchestrator.results.rotation import matrices
from orchestrator.results.run_data import RunData
from orchestrator.results.views import flat_views, foxglove_scene, projected, rerun_scene
from orchestrator.results.views.bodies import Bodies
from orchestrator.results.views.shapes import HORN_SIZE, teeth
from orchestrator.results.views.solids import across, block, convex, draped, prism

driven = pytest.fixture(scope="module")(settling_log)
hanging = pytest.fixture(scope="module")(hanging_log)
shown = pytest.fixture(bodies_of)

GAUSS = 0.5 / np.sqrt(3.0)  # of a pitch: contact points of links with the ground, from their middle


@pytest.mark.long
def test_links_stand_between_their_pins(shown):
    log, bodies, poses = shown
    assert [(track.name, track.links, track.closed) for track in bodies.tracks] == [
        (f"{side}_track", 64, True) for side in ("left", "right")
    ]
    np.testing.assert_allclose(poses.t, np.arange(41) * STEP, atol=1e-12)
    for name, links in poses.links.items():
        series = log.read(f"/{name}/links")
        wanted = [series.names.index(f"joint[{i + 1}].position.{x}") for i in range(64) for x in "xyz"]
        pins = series.values[:, wanted].reshape(-1, 64, 3)
        along = np.roll(pins, -1, axis=1) - pins
        np.testing.assert_array_equal(links.centres, 0.5 * (pins + np.roll(pins, -1, axis=1)))
        length = np.linalg.norm(along, axis=2)
        np.testing.assert_allclose(np.einsum("mnk,mnk->mn", links.axes[..., 0], along), length, rtol=1e-12)
        tension = series.values[:, [series.names.index(f"link[{i + 1}].tension") for i in range(64)]]
        np.testing.assert_array_equal(links.colour, 1e-3 * tension)


def test_wheels_and_hull_stand_where_they_were_recorded(shown):
    log, bodies, poses = shown
    assert len(bodies.wheels) == 14
    for name, pose in poses.wheels.items():
        track, wheel = name.split("/")
        series = log.read(f"/{track}/in")
        for part, axes, values in (("position", "xyz", pose.position), ("orientation", "wxyz", pose.orientation)):
            recorded = series.values[:, [series.names.index(f"{wheel}.{part}.{x}") for x in axes]]
            np.testing.assert_array_equal(values[:-1], recorded)  # the end of the last step is that of the outputs
    vehicle, hull = bodies.scene["vehicle"], bodies.hull
    assert {wheel.radius for wheel in bodies.wheels if wheel.kind == "idler"} == {vehicle["idler"]["radius"]}
    np.testing.assert_array_equal(
        poses.hull.position.T, [log.signal(f"chassis.chassis.position.{x}")[1] for x in "xyz"]
    )
    corners = hull.corners @ matrices(poses.hull.orientation[0]).T + poses.hull.position[0]
    drawn = Rotation.from_euler("z", 0.4).apply(vehicle["chassis"]["hull"]) + np.array([1.0, -2.0, 0.3])
    np.testing.assert_allclose(corners, drawn, atol=1e-12)
    assert len(hull.edges) == 17  # convex hull of the ten corners; a triangulation has 24
    assert len(hull.faces) == 17 - 10 + 2  # Euler
    for face, normal in zip(hull.faces, hull.normals, strict=True):
        outline, centre = hull.corners[face], hull.corners.mean(axis=0)
        turned = np.cross(outline - centre, np.roll(outline, -1, axis=0) - centre).sum(axis=0)  # along the normal
        np.testing.assert_allclose(turned, np.linalg.norm(turned) * normal, atol=2e-9)
        assert (outline[0] - centre) @ normal > 0.0


def depths_apart(log, bodies, poses, model, surface):
    """Errors of the depths of links in contact, m, where the ground under them is the plane and on the obstacle.

    Recorded depths are means over a step, of the deepest contact point of a link: in the middle plane of cables,
    on both sides of it of rigid links. Distances from the surface are sought along the heading of the drawn line, or
    along x.
    """
    apart, even = [], []
    vehicle, aside = bodies.scene["vehicle"]["track"], np.linspace(-0.03, 0.03, 601)
    ways, bank = ((0.0,), 0.0) if model == "flexible" else ((-0.25, 0.25), -0.1)  # of the width
    parts, strips = refinement(bodies.scene["ground"], vehicle, bodies.scene["start"]["heading"])
    ways = [way * (2 * strip + 1) / strips for strip in range(strips) for way in ways]
    places = [(k + 0.5 + side * GAUSS) / parts - 0.5 for k in range(parts) for side in (-1, 1)]
    search = aside[:, None] * (surface.ahead if model == "flexible" else [1.0, 0.0, 0.0])
    for track in bodies.tracks:
        links = poses.links[track.name]
        recorded = log.sample([f"{track.name}.link[{i + 1}].ground.depth" for i in range(track.links)], poses.t)
        points = np.stack([
            links.centres + along * vehicle["pitch"] * links.axes[..., 0]
            + way * vehicle["width"] * links.axes[..., 1] + track.half[2] * links.axes[..., 2]
            for along in places for way in ways
        ])  # fmt: skip
        above = points[..., 2] - surface.height_under(points)
        deep = np.full(above.shape, -1.0)
        for k in zip(*np.nonzero(above < 0.0), strict=True):
            line = points[k] + search
            deep[k] = np.sqrt((aside**2 + (surface.height_under(line) - line[:, 2]) ** 2 / (1.0 + bank**2)).min())
        slope = np.array([0.2, -0.1, 0.0] if model == "rigid" else np.zeros(3))
        level = (np.abs(surface.height_under(points) - surface.level - points @ slope) < 1e-9).all(axis=0)
        deep = deep.max(axis=0)
        steady = (deep[1:] > 1e-4) & (deep[:-1] > 1e-4) & (recorded[1:] > 1e-4)
        apart.append(np.abs(0.5 * (deep[1:] + deep[:-1]) - recorded[1:])[steady])
        even.append((level[1:] & level[:-1])[steady])
    apart, even = np.concatenate(apart), np.concatenate(even)
    return apart[even], apart[~even]


@pytest.mark.parametrize(("model", "allowed"), [
    ("flexible", 2e-5), pytest.param("rigid", 5e-5, marks=pytest.mark.long),
])  # fmt: skip
def test_links_lie_as_deep_in_the_drawn_ground_as_was_recorded(tmp_path_factory, model, allowed):
    """On level ground and a bump, on a slope and a half round; twins: the ground by 3 % of a pad higher."""
    path = {"flexible": settling_log, "rigid": terrain_log}[model](tmp_path_factory)
    for log, bodies, poses in bodies_of(path):
        right = bodies.ground
        plane, curved = depths_apart(log, bodies, poses, model, right)
        assert len(plane) > 100
        assert len(curved) > 10
        assert max(plane.max(), curved.max()) < allowed
        assert np.median(plane) < 1e-5
        off = 0.03 * bodies.scene["vehicle"]["track"]["face"]
        higher = right._replace(level=right.level + off, height=right.height + off)
        assert all(np.median(each) > 5e-4 for each in depths_apart(log, bodies, poses, model, higher))


@pytest.mark.long
def test_instants_keep_a_steady_pace_at_most(hanging, tmp_path):
    times = np.arange(0, 200) * 0.007
    with Log(stretched(hanging, tmp_path / "fast.mcap", times)) as log:
        bodies = Bodies(RunData(log), 25.0)
        pieces = [poses.links["chain"].centres for poses in bodies.blocks(10)]
        first = next(Bodies(RunData(log), 1e4).blocks(1)).links["chain"].centres
    assert [len(piece) for piece in pieces] == [10, 10, 10, 5]
    assert len(bodies.t) == int(times[-1] * 25) + 1
    assert set(np.round(bodies.t, 9)) <= set(np.round(times, 9))
    assert np.abs(bodies.t - np.arange(len(bodies.t)) / 25).max() <= 0.0035 + 1e-9
    moved = np.concatenate(pieces)[:, 0] - first[:, 0]
    np.testing.assert_allclose(moved, bodies.t[:, None] * [1.0, 0.0, 0.0], atol=1e-12)


def test_an_open_chain_has_neither_wheels_nor_hull_nor_ground(hanging):
    with Log(hanging) as log:
        bodies = Bodies(RunData(log), 50.0)
        links = next(bodies.blocks()).links["chain"]
    assert (bodies.wheels, bodies.hull, bodies.ground) == ((), None, None)
    assert [(track.links, track.closed) for track in bodies.tracks] == [(8, False)]
    assert (links.centres.shape[1:], links.ground) == ((8, 3), None)


def volume(surface):
    """Volume within triangles, positive if they face outwards."""
    a, b, c = np.moveaxis(surface.corners[surface.numbers], 1, 0)
    return float(np.einsum("ni,ni->", a, np.cross(b, c))) / 6.0


def test_triangles_of_bodies_and_ground_look_outwards(shown):
    _, bodies, _ = shown
    sprocket = next(wheel for wheel in bodies.wheels if wheel.kind == "sprocket")
    x, y = sprocket.outline.T
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    assert volume(prism(sprocket)) == pytest.approx(area * (sprocket.width - sprocket.gap), rel=1e-12)
    for part in bodies.tracks[0].parts:
        assert volume(block(part)) == pytest.approx(8.0 * part.half.prod(), rel=1e-12)
    assert volume(convex(bodies.hull)) == pytest.approx(ConvexHull(bodies.hull.corners).volume, rel=1e-12)
    surface = draped(across(bodies.ground, bodies.ground.corners_between(-6.0, 4.0), 5.0))
    a, b, c = np.moveaxis(surface.corners[surface.numbers], 1, 0)
    up = np.cross(b - a, c - a)[:, 2]
    assert (up > 0).all()
    assert 0.5 * up.sum() == pytest.approx(10.0 * 10.0, rel=1e-12)  # the area under it


# --- one link and one tooth in all drawings ---------------------------------------------------------

AT, LINK = 0.02, 5  # s; from 1


@pytest.fixture(scope="module")
def marked(driven):
    """A right corner of a link, one of its horn's tip, and the first tooth tip of the left sprocket, from the log."""
    with Log(driven) as log:
        vehicle = RunData(log).scene["vehicle"]

        def vector(name, parts="xyz"):
            return log.sample([f"left_track.{name}.{part}" for part in parts], np.array([AT]))[0]

        before, after = (vector(f"joint[{i}].position") for i in (LINK, LINK + 1))
        across = sum(vector(f"joint[{i}].axis") for i in (LINK, LINK + 1))
        axle, turn = vector("sprocket.position"), vector("sprocket.orientation", "wxyz")
    chain, sprocket, middle = vehicle["track"], vehicle["sprocket"], 0.5 * (before + after)
    along = (after - before) / np.linalg.norm(after - before)
    out = np.cross(along, across) / np.linalg.norm(np.cross(along, across))
    size = np.array([0.94 * chain["pitch"], chain["width"]])  # of the body of a link

    def corner(share, depth):
        length, width = 0.5 * share * size
        return middle - length * along - width * np.cross(out, along) - depth * out

    angle = -0.8 * np.pi / sprocket["teeth"]
    ahead, up = sprocket["outer_radius"] * np.array([np.cos(angle), np.sin(angle)])
    tip = Rotation.from_quat(turn, scalar_first=True).apply([ahead, -0.5 * chain["width"], up])
    return corner(np.ones(2), chain["face"]), corner(np.array(HORN_SIZE), chain["face"] + HORN), axle + tip


def missed(points, vertices):
    """Largest distance of the points (m, k) from the nearest of the vertices (n, k), m."""
    vertices = np.asarray(vertices)
    return max(np.linalg.norm(vertices - point, axis=1).min() for point in points)


@pytest.fixture
def instant(driven):
    with Log(driven) as log:
        bodies = Bodies(RunData(log), 1e4)
        bodies.select_instants([AT])
        yield log, bodies, next(bodies.blocks())


def test_flat_drawings_place_a_link_and_a_tooth_where_they_were(instant, marked):
    _, bodies, poses = instant
    for eye in projected.VIEWPOINTS:
        seen = projected.make_camera(eye, 0.4, poses.hull.position[0])
        vertices = np.concatenate(projected.polygons(seen, bodies, poses, 0, (0.0, 1.0)).outlines)
        assert missed(seen.project(np.stack(marked)), vertices) < 1e-9, eye
    view = flat_views.side_view(bodies, poses)
    boxes, rims = view.links["body"].reshape(-1, 2), np.concatenate([outline for _, _, outline in view.wheels])
    corner, horn, tip = view.camera.project(np.stack(marked))
    assert missed([corner], boxes) < 1e-9 < 1e-3 < missed([corner], 1.03 * boxes)
    assert missed([tip], rims) < 1e-9 < 1e-3 < missed([tip], 1.03 * rims)
    assert missed([horn], view.links["horn"].reshape(-1, 2)) < 1e-9
    track, links = bodies.tracks[0], poses.links["left_track"]
    lowest = int(links.centres[0, :, 2].argmin())
    under = links.centres[0, lowest] + links.axes[0, lowest] @ (track.half * [1.0, 1.0, -1.0])
    assert missed([under[:2]], np.concatenate(flat_views.top_view(bodies, poses).links)) < 1e-9


@pytest.mark.parametrize("eye", ["right", "corner"])
def test_the_hull_hides_what_lies_behind_it(instant, eye):
    """Rays from points to the viewer are searched for points inside of the hull."""
    _, bodies, poses = instant
    hull, position, axes = bodies.hull, poses.hull.position[0], matrices(poses.hull.orientation[0])
    camera = projected.make_camera(eye, 0.4, position)
    points = position + np.random.default_rng(1).uniform(-3.0, 3.0, (400, 3)) @ axes.T
    rays = points[:, None] + np.linspace(0.0, 12.0, 600)[:, None] * camera.toward
    crossing = (Delaunay(hull.corners @ axes.T + position).find_simplex(rays) >= 0).any(axis=1)
    assert 20 < crossing.sum() < 200
    hidden = projected.hides(hull, camera, position, axes, points)
    assert hidden[crossing].all()
    outline = ConvexHull(camera.project(hull.corners @ axes.T + position)).equations
    covered = (camera.project(points) @ outline[:, :2].T + outline[:, 2] < -0.05).all(axis=1)
    np.testing.assert_array_equal(hidden[covered], crossing[covered])
    if eye == "corner":  # links behind the hull are drawn before it; the camera is on the right
        whole = projected.polygons(camera, bodies, poses, 0, (0.0, 1.0))
        layers = projected.layers(camera, bodies, poses, 0, (0.0, 1.0))
        assert len(layers.hidden.outlines) + len(layers.visible.outlines) == len(whole.outlines)
        left, right = (
            projected.hides(hull, camera, position, axes, poses.links[f"{side}_track"].centres[0]).mean()
            for side in ("left", "right")
        )
        assert left > 0.6
        assert right < 0.1
        assert len(layers.hull.outlines) == np.count_nonzero(hull.normals @ axes.T @ camera.toward > 0.0)


def test_the_player_places_a_link_and_a_tooth_where_they_were(instant, marked, monkeypatch):
    """By the rules of page.js: links reach from pin to pin, less a gap; wheels turn about their centres."""
    log, _, poses = instant
    monkeypatch.setattr(player, "RATE", 100.0)
    view = player.player(RunData(log), "left_track")
    k = int(np.abs(unpacked(view["t"]) - AT).argmin())
    assert unpacked(view["t"])[k] == pytest.approx(AT)

    def places(packed):
        return np.frombuffer(base64.b64decode(packed), "<i2").reshape(view["pictures"], -1, 2)[k] * view["unit"]

    axle = poses.wheels["left_track/sprocket"].position[0]
    seen = projected.make_camera("right", 0.4, np.array([*axle[:2], ground(RunData(log).scene).level]))
    corner, horn, tip = seen.project(np.stack(marked))
    a, b = places(view["pins"])[LINK - 1 : LINK + 1]
    gap, along = 0.5 * (1.0 - view["drawn"]), (b - a) / np.linalg.norm(b - a)
    outwards = np.array([-along[1], along[0]])
    ends = [a + gap * (b - a), b - gap * (b - a)]
    assert (
        missed([corner], [end + side * view["thick"] * outwards for end in ends for side in (-0.5, 0.5)])
        < 3 * player.UNIT
    )
    pad, horn_part = view["parts"]
    low = horn_part["low"]
    assert missed([horn], [0.5 * (a + b) + low[0] * along + low[1] * outwards]) < 3 * player.UNIT
    assert (pad["kind"], horn_part["kind"]) == ("pad", "horn")
    assert pad["high"][1] == pytest.approx(0.5 * view["thick"], rel=1e-12)  # pads end at the outer face
    sprocket = next(wheel for wheel in view["wheels"] if wheel["outline"])
    c, s = np.cos(angle := unpacked(sprocket["angle"])[k]), np.sin(angle)
    outline = places(sprocket["centre"]) + np.array(sprocket["outline"]) @ np.array([[c, s], [-s, c]])
    assert missed([tip], outline) < 3 * player.UNIT < missed([tip], outline - 5 * player.UNIT)


def test_rerun_places_a_link_and_a_tooth_where_they_were(driven, marked, tmp_path):
    chunk = pytest.importorskip("rerun.chunk")
    rerun_scene.show(driven, tmp_path / "run.rrd")
    batches = {}
    for piece in chunk.RrdReader(tmp_path / "run.rrd").stream():
        batches.setdefault((piece.entity_path, piece.is_static), piece.to_record_batch())

    def numbers(entity, name, static=False, at=1):  # at 20 ms, of a rate of 50 per second
        return np.array(batches[f"/world/{entity}", static][name].to_pylist())[0 if static else at]

    links, others, wheel = "links/left_track", "links/left_track/pads\\ and\\ horns", "wheels/left_track\\/sprocket"
    turned = Rotation.from_quat(numbers(links, "Boxes3D:quaternions")).as_matrix()
    half = numbers(links, "Boxes3D:half_sizes", static=True)
    corners = numbers(links, "Boxes3D:centers") - np.einsum("nij,nj->ni", turned, half)
    assert missed(marked[:1], corners) < 1e-6
    vertices = numbers(others, "Mesh3D:vertex_positions", static=True)
    places = numbers(others, "InstancePoses3D:translations")
    moved = places[:, None] + np.einsum("nij,vj->nvi", turned, vertices)
    assert missed(marked[1:2], moved.reshape(-1, 3)) < 1e-6
    turn = Rotation.from_quat(numbers(wheel, "Transform3D:quaternion")[0])
    vertices = numbers(f"{wheel}/shape", "Mesh3D:vertex_positions", static=True)
    assert missed(marked[2:], numbers(wheel, "Transform3D:translation")[0] + turn.apply(vertices)) < 1e-6


def test_foxglove_places_a_link_and_a_tooth_where_they_were(driven, marked, tmp_path):
    pytest.importorskip("foxglove")
    foxglove_scene.write(driven, tmp_path / "x.mcap")

    def first(topic, k, items, **wanted):
        entries = getattr(decoded(tmp_path / "x.mcap", topic)[k], items)
        return next(one for one in entries if all(getattr(one, name) == value for name, value in wanted.items()))

    def numbers(of, names="xyz"):
        return np.array([getattr(of, name) for name in names])

    def turn(orientation):
        return Rotation.from_quat(numbers(orientation, "xyzw"))

    corners = [
        numbers(cube.pose.position) + turn(cube.pose.orientation).apply(-0.5 * numbers(cube.size))
        for cube in first("/scene", 1, "entities", id="links of left_track").cubes
    ]
    assert missed(marked[:2], corners) < 1e-9
    frame = first("/frames", 1, "transforms", child_frame_id="left_track/sprocket")
    shape = first("/shapes", 0, "entities", id="left_track/sprocket").triangles[0]
    vertices = turn(frame.rotation).apply([numbers(point) for point in shape.points])
    assert missed(marked[2:], numbers(frame.translation) + vertices) < 1e-9


@pytest.mark.parametrize(
    ("own", "between"),
    [
        ({}, 0.2 * np.pi),
        ({"teeth": 21, "gaps_per_pin": 2}, 4.0 * np.pi / 21),
        ({"teeth": 6, "pins_per_gap": 2, "outer_radius": 0.32}, np.pi / 6),
    ],
)
def test_the_outline_of_a_sprocket_has_its_teeth_and_a_seat_ahead(own, between):
    """Every tooth is the same, turned; pins seat straight ahead at the pitch circle, an angle apart."""
    table = vehicle(*read_table("m113")).model_dump()
    table["sprocket"] |= own
    number, pin = table["sprocket"]["teeth"], table["sprocket"]["pin_radius"]
    outline = teeth(table)
    angle, radius = np.arctan2(outline[:, 1], outline[:, 0]), np.linalg.norm(outline, axis=1)
    turned = Rotation.from_euler("z", 360 / number, degrees=True).as_matrix()[:2, :2]
    np.testing.assert_allclose(outline @ turned.T, np.roll(outline, -4, axis=0), atol=1e-12)
    root = table["track"]["pitch"] / (2.0 * np.sin(0.5 * between)) - pin
    assert len(outline) == 4 * number
    np.testing.assert_allclose(np.sort(radius), np.repeat([root, table["sprocket"]["outer_radius"]], 2 * number))
    ahead = radius[np.abs(angle) < np.pi / number * 0.5]
    np.testing.assert_allclose(ahead, root, err_msg="no seat straight ahead")
    assert (np.diff(np.unwrap(angle)) > 0.0).all(), "edges cross"
