"""Places of bodies in views, against log and contact laws; one link and one tooth in all drawings."""

import base64

import numpy as np
import pytest
from packed import unpacked
from scipy.spatial import ConvexHull, Delaunay
from scipy.spatial.transform import Rotation
from view_logs import STEP, bodies_of, decoded, driven_log, hanging_log, stretched

from fmus.physics.contact.guide import HORN
from fmus.vehicles.tables import BadInput
from fmus.vehicles.vehicle import read_table, vehicle
from orchestrator.log.reader import Log
from orchestrator.results.ground_surface import ground
from orchestrator.results.page import player
from orchestrator.results.rotation import matrices, quaternions
from orchestrator.results.run_data import RunData
from orchestrator.results.views import flat_views, foxglove_scene, projected, rerun_scene
from orchestrator.results.views.bodies import Bodies
from orchestrator.results.views.shapes import HORN_SIZE, teeth
from orchestrator.results.views.solids import across, block, convex, draped, prism

driven = pytest.fixture(scope="module")(driven_log)
hanging = pytest.fixture(scope="module")(hanging_log)
shown = pytest.fixture(bodies_of)

GAUSS = 0.5 / np.sqrt(3.0)  # of a pitch: contact points of flexible links with the ground, from their middle


@pytest.mark.long
def test_links_stand_between_their_pins(shown):
    log, bodies, poses = shown
    assert [(track.name, track.links, track.closed) for track in bodies.tracks] == [
        ("left_track", 64, True), ("right_track", 64, True),
    ]  # fmt: skip
    np.testing.assert_allclose(poses.t, np.arange(41) * STEP, atol=1e-12)
    for name, links in poses.links.items():
        series = log.read(f"/{name}/links")
        pins = np.stack(
            [[series.values[:, series.names.index(f"joint[{i + 1}].position.{x}")] for x in "xyz"] for i in range(64)]
        ).transpose(2, 0, 1)
        np.testing.assert_array_equal(links.centres, 0.5 * (pins + np.roll(pins, -1, axis=1)))
        along = np.roll(pins, -1, axis=1) - pins
        np.testing.assert_allclose(
            np.einsum("mnk,mnk->mn", links.axes[..., 0], along), np.linalg.norm(along, axis=2), rtol=1e-12
        )
        shifted = np.linalg.norm(links.centres - 0.5 * (pins + np.roll(pins, 1, axis=1)), axis=2)
        assert shifted.min() > 0.1  # the link before is a pitch away: the numbering matters
        np.testing.assert_array_equal(
            links.colour, 1e-3 * series.values[:, [series.names.index(f"link[{i + 1}].tension") for i in range(64)]]
        )


def test_wheels_and_hull_stand_where_they_were_recorded(shown):
    log, bodies, poses = shown
    assert len(bodies.wheels) == 14
    for name, pose in poses.wheels.items():
        track, wheel = name.split("/")
        series = log.read(f"/{track}/in")
        for part, values in (("position", pose.position), ("orientation", pose.orientation)):
            parts = "xyz" if part == "position" else "wxyz"
            recorded = series.values[:, [series.names.index(f"{wheel}.{part}.{x}") for x in parts]]
            assert len(values) == len(recorded) + 1  # with the end of the last step, where inputs come from
            np.testing.assert_array_equal(values[:-1], recorded)
    vehicle = bodies.scene["vehicle"]
    assert {wheel.radius for wheel in bodies.wheels if wheel.kind == "idler"} == {vehicle["idler"]["radius"]}
    recorded = [log.signal(f"chassis.chassis.position.{x}")[1] for x in "xyz"]
    np.testing.assert_array_equal(poses.hull.position.T, recorded)
    corners = bodies.hull.corners @ matrices(poses.hull.orientation[0]).T + poses.hull.position[0]
    c, s = np.cos(0.4), np.sin(0.4)
    drawn = np.array(vehicle["chassis"]["hull"]) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    np.testing.assert_allclose(corners, drawn + np.array([1.0, -2.0, 0.3]), atol=1e-12)
    assert len(bodies.hull.edges) == 17  # convex hull of the ten corners; a triangulation has 24
    assert len(bodies.hull.faces) == 17 - 10 + 2  # Euler
    for face, normal in zip(bodies.hull.faces, bodies.hull.normals, strict=True):
        outline = bodies.hull.corners[face]
        after, centre = np.roll(outline, -1, axis=0), bodies.hull.corners.mean(axis=0)
        turned = 0.5 * np.cross(outline - centre, after - centre).sum(axis=0)  # area by its normal
        np.testing.assert_allclose(turned, np.linalg.norm(turned) * normal, atol=1e-9)
        assert (outline[0] - centre) @ normal > 0.0


def test_pads_lie_as_deep_in_the_ground_as_was_recorded(shown):
    """Pads lie as deep in the ground as recorded, on the bump and beside it.

    Recorded depths are means over a step, of the deepest point of a link.
    """
    log, bodies, poses = shown
    touching, over = depths_apart(log, bodies, poses)
    assert touching["level"] > 100
    assert touching["bump"] > 20
    assert max(over.values()) < 2e-5
    right = bodies.ground
    bodies.ground = right._replace(height=right.level + 1.03 * (right.height - right.level))
    assert depths_apart(log, bodies, poses)[1]["bump"] > 2e-4
    off = 0.03 * bodies.scene["vehicle"]["track"]["face"]
    bodies.ground = right._replace(level=right.level - off, height=right.height - off)
    assert depths_apart(log, bodies, poses)[1]["level"] > 2e-4


def depths_apart(log, bodies, poses):
    """Number of links in contact, and the largest error of drawn depths, by 'level' and 'bump'."""
    count, apart = {"level": 0, "bump": 0}, {"level": 0.0, "bump": 0.0}
    profile, pitch = bodies.ground, bodies.scene["vehicle"]["track"]["pitch"]
    for track in bodies.tracks:
        links = poses.links[track.name]
        names = [f"{track.name}.link[{i + 1}].ground.depth" for i in range(track.links)]
        recorded = log.sample(names, poses.t)
        points = np.stack([
            links.centres + side * GAUSS * pitch * links.axes[..., 0] + track.half[2] * links.axes[..., 2]
            for side in (-1, 1)
        ])  # fmt: skip
        along = (points - profile.start) @ profile.ahead
        height = profile.height_at(along)
        slope = (profile.height_at(along + 1e-4) - profile.height_at(along - 1e-4)) / 2e-4
        deep = ((height - points[..., 2]) / np.sqrt(1 + slope**2)).max(axis=0)
        mean = 0.5 * (deep[1:] + deep[:-1])
        bent = (np.abs(height - profile.level) > 2e-3).all(axis=0)[1:] & (np.abs(np.diff(slope, axis=0)) < 1e-9)[0][1:]
        level = (np.abs(height - profile.level) < 1e-12).all(axis=0)[1:]
        steady = (deep[1:] > 1e-4) & (deep[:-1] > 1e-4) & (recorded[1:] > 1e-4)
        for where, mask in (("bump", bent & steady), ("level", level & steady)):
            count[where] += int(mask.sum())
            apart[where] = max(apart[where], float(np.abs(mean - recorded[1:])[mask].max(initial=0.0)))
    return count, apart


@pytest.mark.long
def test_instants_keep_a_steady_pace_at_most(hanging, tmp_path):
    times = np.arange(0, 200) * 0.007
    with Log(stretched(hanging, tmp_path / "fast.mcap", times)) as log:
        bodies = Bodies(RunData(log), 25.0)
        assert len(bodies.t) == int(times[-1] * 25) + 1
        assert set(np.round(bodies.t, 9)) <= set(np.round(times, 9))
        assert np.abs(bodies.t - np.arange(len(bodies.t)) / 25).max() <= 0.0035 + 1e-9
        pieces = [poses.links["chain"].centres for poses in bodies.blocks(10)]
        assert [len(piece) for piece in pieces] == [10, 10, 10, 5]
        first = next(Bodies(RunData(log), 1e4).blocks(1)).links["chain"].centres
        np.testing.assert_allclose(
            np.concatenate(pieces)[:, 0] - first[:, 0], bodies.t[:, None] * [1.0, 0.0, 0.0], atol=1e-12
        )


def test_an_open_chain_has_neither_wheels_nor_hull_nor_ground(hanging):
    with Log(hanging) as log:
        bodies = Bodies(RunData(log), 50.0)
        assert (bodies.wheels, bodies.hull, bodies.ground) == ((), None, None)
        assert [(track.links, track.closed) for track in bodies.tracks] == [(8, False)]
        poses = next(bodies.blocks())
        assert poses.links["chain"].centres.shape[1:] == (8, 3)
        assert poses.links["chain"].ground is None
        with pytest.raises(BadInput, match=r"--colour sliding: .* does not hold that; of its links it holds tension"):
            Bodies(RunData(log), 50.0, "sliding")
        with pytest.raises(BadInput, match="--colour red: links are coloured by one of tension, stress, ground"):
            Bodies(RunData(log), 50.0, "red")


def test_quaternions_and_rotations_are_inverse():
    turned = np.random.default_rng(3).normal(size=(50, 4))
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    again = np.roll(quaternions(matrices(turned)), 1, axis=-1)
    assert np.abs(np.abs(np.einsum("ni,ni->n", again, turned)) - 1).max() < 1e-12
    w, x, y, z = 0.5**0.5, 0.0, 0.0, 0.5**0.5  # a quarter turn to the left: forward becomes left
    np.testing.assert_allclose(matrices(np.array([w, x, y, z])) @ [1, 0, 0], [0, 1, 0], atol=1e-15)


def triangles(surface):
    """The three corners of all triangles, (n, 3) each."""
    return np.moveaxis(surface.corners[surface.numbers], 1, 0)


def test_triangles_of_sprocket_and_ground_look_outwards(shown):
    _, bodies, _ = shown
    sprocket = next(wheel for wheel in bodies.wheels if wheel.kind == "sprocket")
    a, b, c = triangles(prism(sprocket))
    x, y = sprocket.outline.T
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    volume = float(np.einsum("ni,ni->", a, np.cross(b, c))) / 6.0
    assert volume == pytest.approx(area * (sprocket.width - sprocket.gap), rel=1e-12)  # positive: they face outwards
    tips = np.hypot(x, y)
    assert tips.max() == pytest.approx(bodies.scene["vehicle"]["sprocket"]["outer_radius"], rel=1e-12)
    pitch_radius = 0.0762 / np.sin(np.pi / 10)
    assert tips.min() == pytest.approx(pitch_radius - 0.015, rel=1e-12)
    for part in bodies.tracks[0].parts:
        a, b, c = triangles(block(part))
        assert float(np.einsum("ni,ni->", a, np.cross(b, c))) / 6.0 == pytest.approx(8.0 * part.half.prod(), rel=1e-12)
    a, b, c = triangles(convex(bodies.hull))
    volume = float(np.einsum("ni,ni->", a, np.cross(b, c))) / 6.0
    assert volume == pytest.approx(ConvexHull(bodies.hull.corners).volume, rel=1e-12)
    a, b, c = triangles(draped(across(bodies.ground, bodies.ground.corners_between(-6.0, 4.0), 5.0)))
    normal = np.cross(b - a, c - a)
    assert (normal[:, 2] > 0).all()
    assert 0.5 * normal[:, 2].sum() == pytest.approx(10.0 * 10.0, rel=1e-12)  # the area under it


# --- one link and one tooth in all drawings ---------------------------------------------------------

AT, LINK = 0.02, 5  # s; from 1


@pytest.fixture(scope="module")
def marked(driven):
    """A right corner of a link, one of its horn's tip, and the first tooth tip of the left sprocket, from the log."""
    with Log(driven) as log:
        vehicle = RunData(log).scene["vehicle"]

        def vector(prefix, parts="xyz"):
            return log.sample([f"{prefix}.{part}" for part in parts], np.array([AT]))[0]

        before, after = (vector(f"left_track.joint[{i}].position") for i in (LINK, LINK + 1))
        across = sum(vector(f"left_track.joint[{i}].axis") for i in (LINK, LINK + 1))
        axle = vector("left_track.sprocket.position")
        turned = Rotation.from_quat(vector("left_track.sprocket.orientation", "wxyz"), scalar_first=True)
    along = (after - before) / np.linalg.norm(after - before)
    out = np.cross(along, across) / np.linalg.norm(np.cross(along, across))
    chain, sprocket = vehicle["track"], vehicle["sprocket"]
    left = np.cross(out, along)
    corner = 0.5 * (before + after) - 0.47 * chain["pitch"] * along - 0.5 * chain["width"] * left - chain["face"] * out
    length, width = (
        0.5 * share * whole for share, whole in zip(HORN_SIZE, (0.94 * chain["pitch"], chain["width"]), strict=True)
    )
    horn = 0.5 * (before + after) - length * along - width * left - (chain["face"] + HORN) * out
    angle = -0.8 * np.pi / sprocket["teeth"]
    ahead, up = sprocket["outer_radius"] * np.array([np.cos(angle), np.sin(angle)])
    return corner, horn, axle + turned.apply([ahead, -0.5 * chain["width"], up])


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
    assert missed([corner], boxes) < 1e-9
    assert missed([horn], view.links["horn"].reshape(-1, 2)) < 1e-9
    assert missed([tip], rims) < 1e-9
    assert missed([corner], 1.03 * boxes) > 1e-3
    assert missed([tip], 1.03 * rims) > 1e-3
    lowest = int(poses.links["left_track"].centres[0, :, 2].argmin())
    track, links = bodies.tracks[0], poses.links["left_track"]
    under = links.centres[0, lowest] + links.axes[0, lowest] @ (track.half * [1.0, 1.0, -1.0])
    assert missed([under[:2]], np.concatenate(flat_views.top_view(bodies, poses).links)) < 1e-9


@pytest.mark.parametrize("eye", ["right", "corner"])
def test_the_hull_hides_what_lies_behind_it(instant, eye):
    """Rays from points to the viewer are searched for points inside of the hull."""
    _, bodies, poses = instant
    hull, position, axes = bodies.hull, poses.hull.position[0], matrices(poses.hull.orientation[0])
    camera = projected.make_camera(eye, 0.4, position)
    points = position + np.random.default_rng(1).uniform(-3.0, 3.0, (400, 3)) @ axes.T
    inside = Delaunay(hull.corners @ axes.T + position)

    def crosses(of):
        rays = of[:, None] + np.linspace(0.0, 12.0, 600)[:, None] * camera.toward
        return (inside.find_simplex(rays) >= 0).any(axis=1)

    crossing = crosses(points)
    assert 20 < crossing.sum() < 200
    assert projected.hides(hull, camera, position, axes, points[crossing]).all()
    outline = ConvexHull(camera.project(hull.corners @ axes.T + position)).equations
    covered = (camera.project(points) @ outline[:, :2].T + outline[:, 2] < -0.05).all(axis=1)
    np.testing.assert_array_equal(projected.hides(hull, camera, position, axes, points)[covered], crossing[covered])


def test_links_behind_the_hull_are_drawn_before_it(instant):
    _, bodies, poses = instant
    camera = projected.make_camera("corner", 0.4, poses.hull.position[0])
    whole = projected.polygons(camera, bodies, poses, 0, (0.0, 1.0))
    layers = projected.layers(camera, bodies, poses, 0, (0.0, 1.0))
    assert len(layers.hidden.outlines) + len(layers.visible.outlines) == len(whole.outlines)
    position, axes = poses.hull.position[0], matrices(poses.hull.orientation[0])
    hidden = {
        side: projected.hides(bodies.hull, camera, position, axes, poses.links[f"{side}_track"].centres[0]).mean()
        for side in ("left", "right")
    }
    assert hidden["left"] > 0.6  # the camera is on the right: the left track is the far one
    assert hidden["right"] < 0.1
    assert len(layers.hull.outlines) == np.count_nonzero(bodies.hull.normals @ axes.T @ camera.toward > 0.0)


def test_the_player_places_a_link_and_a_tooth_where_they_were(instant, marked, monkeypatch):
    """The player places a link and a tooth where they were, by the rules of page.js.

    Links reach from pin to pin, less a gap; wheels turn about their centres.
    """
    log, _, poses = instant
    monkeypatch.setattr(player, "RATE", 100.0)
    view = player.player(RunData(log), "left_track")
    k = int(np.abs(unpacked(view["t"]) - AT).argmin())
    assert unpacked(view["t"])[k] == pytest.approx(AT)

    def places(packed):
        return np.frombuffer(base64.b64decode(packed), "<i2").reshape(view["pictures"], -1, 2)[k] * view["unit"]

    axle = poses.wheels["left_track/sprocket"].position[0]
    level = ground(RunData(log).scene).level
    seen = projected.make_camera("right", 0.4, np.array([*axle[:2], level]))
    a, b = places(view["pins"])[LINK - 1 : LINK + 1]
    gap, along = 0.5 * (1.0 - view["drawn"]), (b - a) / np.linalg.norm(b - a)
    outwards = np.array([-along[1], along[0]])
    ends = [a + gap * (b - a), b - gap * (b - a)]
    corners = [end + side * 0.5 * view["thick"] * outwards for end in ends for side in (-1, 1)]
    sprocket = next(wheel for wheel in view["wheels"] if wheel["outline"])
    angle = unpacked(sprocket["angle"])[k]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    outline = places(sprocket["centre"]) + np.array(sprocket["outline"]) @ turn.T
    part = view["parts"]["horn"]
    tips = [0.5 * (a + b) + part["low"][0] * along + part["low"][1] * outwards]
    corner, horn, tip = seen.project(np.stack(marked))
    assert missed([corner], corners) < 3 * player.UNIT
    assert missed([horn], tips) < 3 * player.UNIT
    pad = view["parts"]["pad"]
    assert pad["high"][1] == pytest.approx(0.5 * view["thick"], rel=1e-12)  # pads end at the outer face
    assert missed([tip], outline) < 3 * player.UNIT
    assert missed([tip], np.array(outline) - 5 * player.UNIT) > 3 * player.UNIT


def test_rerun_places_a_link_and_a_tooth_where_they_were(driven, marked, tmp_path):
    chunk = pytest.importorskip("rerun.chunk")
    rerun_scene.show(driven, tmp_path / "run.rrd")
    batches = {}
    for piece in chunk.RrdReader(tmp_path / "run.rrd").stream():
        batches.setdefault((piece.entity_path, piece.is_static), piece.to_record_batch())
    boxes = batches["/world/links/left_track", False]
    centres, turned = (
        np.array(boxes[f"Boxes3D:{name}"].to_pylist())[1] for name in ("centers", "quaternions")
    )  # at 20 ms
    half = np.array(batches["/world/links/left_track", True]["Boxes3D:half_sizes"].to_pylist())[0]
    corners = centres + np.einsum("nij,nj->ni", Rotation.from_quat(turned).as_matrix(), half * [-1.0, -1.0, -1.0])
    assert missed(marked[:1], corners) < 1e-6
    others = "/world/links/left_track/pads\\ and\\ horns"
    places = np.array(batches[others, False]["InstancePoses3D:translations"].to_pylist())[1]
    vertices = np.array(batches[others, True]["Mesh3D:vertex_positions"].to_pylist())[0]
    moved = places[:, None] + np.einsum("nij,vj->nvi", Rotation.from_quat(turned).as_matrix(), vertices)
    assert missed(marked[1:2], moved.reshape(-1, 3)) < 1e-6
    wheel = "/world/wheels/left_track\\/sprocket"
    place = batches[wheel, False]
    position = np.array(place["Transform3D:translation"].to_pylist())[1, 0]
    turn = Rotation.from_quat(np.array(place["Transform3D:quaternion"].to_pylist())[1, 0])
    vertices = np.array(batches[f"{wheel}/shape", True]["Mesh3D:vertex_positions"].to_pylist())[0]
    assert missed(marked[2:], position + turn.apply(vertices)) < 1e-6


def test_foxglove_places_a_link_and_a_tooth_where_they_were(driven, marked, tmp_path):
    pytest.importorskip("foxglove")
    foxglove_scene.write(driven, tmp_path / "x.mcap")
    messages = {topic: decoded(tmp_path / "x.mcap", topic) for topic in ("/shapes", "/scene", "/frames")}

    def numbers(of, names="xyz"):
        return np.array([getattr(of, name) for name in names])

    links = next(each for each in messages["/scene"][1].entities if each.id == "links of left_track").cubes
    corners = [
        numbers(cube.pose.position)
        + Rotation.from_quat(numbers(cube.pose.orientation, "xyzw")).apply(-0.5 * numbers(cube.size))
        for cube in links
    ]
    assert missed(marked[:2], corners) < 1e-9
    frame = next(each for each in messages["/frames"][1].transforms if each.child_frame_id == "left_track/sprocket")
    shape = next(each for each in messages["/shapes"][0].entities if each.id == "left_track/sprocket").triangles[0]
    turn = Rotation.from_quat(numbers(frame.rotation, "xyzw"))
    assert missed(marked[2:], numbers(frame.translation) + turn.apply([numbers(p) for p in shape.points])) < 1e-9


def test_the_outline_of_a_sprocket_has_its_teeth_and_a_seat_ahead():
    """Every tooth is the same, turned; pins seat straight ahead at the pitch circle."""
    table = vehicle(*read_table("m113")).model_dump()
    number, pin = table["sprocket"]["teeth"], table["sprocket"]["pin_radius"]
    outline = teeth(table)
    angle, radius = np.arctan2(outline[:, 1], outline[:, 0]), np.linalg.norm(outline, axis=1)
    turned = Rotation.from_euler("z", 360 / number, degrees=True).as_matrix()[:2, :2]
    np.testing.assert_allclose(outline @ turned.T, np.roll(outline, -4, axis=0), atol=1e-12)
    root = table["track"]["pitch"] / (2.0 * np.sin(np.pi / number)) - pin
    assert len(outline) == 4 * number
    np.testing.assert_allclose(np.sort(radius), np.repeat([root, table["sprocket"]["outer_radius"]], 2 * number))
    ahead = radius[np.abs(angle) < np.pi / number * 0.5]
    np.testing.assert_allclose(ahead, root, err_msg="no seat straight ahead")
    assert (np.diff(np.unwrap(angle)) > 0.0).all(), "edges cross"
