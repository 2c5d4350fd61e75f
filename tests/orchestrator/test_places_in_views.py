"""Views in space: places of bodies against log and contact laws; files in other libraries."""

import base64
import json
import re
from itertools import pairwise

import numpy as np
import pytest
from packed import unpacked
from scipy.spatial.transform import Rotation

from fmus.vehicle import BadInput
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.results.analyses import events
from orchestrator.results.ground_profile import ground
from orchestrator.results.page import player
from orchestrator.results.rotation import matrices, quaternions
from orchestrator.results.run_data import RunData, Window, within
from orchestrator.results.views import film, foxglove_scene, projected, rerun_scene, side_view, top_view
from orchestrator.results.views.bodies import Bodies
from orchestrator.results.views.plots import curves, plots
from orchestrator.results.views.solids import across, prism, strip
from orchestrator.scene.scene import load

STOP, STEP = 0.04, 1e-3
GAUSS = 0.5 / np.sqrt(3.0)  # of a pitch: contact points of flexible links with the ground, from their middle
SHOWN = '["tension", "position", "ground", "sliding", "depth", "axis"]'


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """Log of a vehicle that settles on a low bump, turned by 0.4 rad; links are recorded at each step."""
    path = tmp_path_factory.mktemp("views") / "run.mcap"
    settings = (
        f"run.stop={STOP}", f"run.step={STEP}", "run.links=1", "expect={}", f"track.link_outputs={SHOWN}",
        "start.state=drawn", "start.heading=0.4", "start.position=[1.0, -2.0, 0.3]",
        "ground.bump={start=-2.4, rise=0.01, slope=0.1, length=0.5, radius=0.02}",
    )  # fmt: skip
    simulate(load("straight", "flexible", settings), path)
    return path


@pytest.fixture(scope="module")
def hanging(tmp_path_factory):
    """Log of an open chain, without wheels, hull and ground."""
    path = tmp_path_factory.mktemp("views") / "chain.mcap"
    simulate(load("hanging_chain", "rigid", ("run.stop=0.02", "chain.links=8", "run.links=5", "expect={}")), path)
    return path


@pytest.fixture
def shown(driven):
    with Log(driven) as log:
        bodies = Bodies(RunData(log), 1e4)
        yield log, bodies, next(bodies.blocks())


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


def stretched(log, path, times, blown=None):
    """Log of links at these times, with the first record of another log moved to the right by 1 m/s.

    From record ``blown`` on the positions are NaN.
    """
    with Log(log) as whole:
        links = whole.read("/chain/links")
        about = whole.topics["/chain/links"]
        attachments = {name: whole.attachment(name) for name in ("scene.json", "system.json")}
        topics = {"/chain/links": list(zip(about.names, about.units, strict=True))}
        with Recorder(path, topics, attachments, whole.metadata) as recorder:
            x = np.array([name.endswith("position.x") for name in about.names])
            for k, t in enumerate(times):
                way = float("nan") if blown is not None and k >= blown else float(t)
                recorder.write("/chain/links", k, float(t), 0.1, links.values[0] + way * x)
            recorder.close("ok", "", len(times))
    return path


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
    assert volume == pytest.approx(area * sprocket.width, rel=1e-12)  # positive: triangles face outwards
    tips = np.hypot(x, y)
    assert tips.max() == pytest.approx(bodies.scene["vehicle"]["sprocket"]["outer_radius"], rel=1e-12)
    pitch_radius = 0.0762 / np.sin(np.pi / 10)
    assert tips.min() == pytest.approx(pitch_radius - 0.015, rel=1e-12)
    a, b, c = triangles(strip(across(bodies.ground, bodies.ground.corners_between(-6.0, 4.0), 5.0)))
    normal = np.cross(b - a, c - a)
    assert (normal[:, 2] > 0).all()
    assert 0.5 * normal[:, 2].sum() == pytest.approx(10.0 * 10.0, rel=1e-12)  # the area under it


@pytest.mark.parametrize("eye", projected.VIEWPOINTS)
def test_cameras_keep_lengths_and_show_ahead_to_the_right(eye):
    seen = projected.make_camera(eye, 0.4, np.array([1.0, 2.0, 3.0]))
    frame = np.stack([seen.right, seen.up, seen.toward])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(frame) == pytest.approx(1.0)
    ahead = np.array([np.cos(0.4), np.sin(0.4), 0.0])
    assert seen.project(seen.centre + ahead)[0] > 0.5
    if eye == "right":
        np.testing.assert_allclose(seen.project(seen.centre + 2 * ahead + [0, 0, 3]), [2, 3], atol=1e-15)


def test_rerun_holds_the_boxes_of_bodies(driven, tmp_path):
    chunk = pytest.importorskip("rerun.chunk")
    rerun_scene.show(driven, tmp_path / "run.rrd", "ground")
    assert [file.name for file in tmp_path.iterdir()] == ["run.rrd"]
    timed, static = {}, {}
    for piece in chunk.RrdReader(tmp_path / "run.rrd").stream():
        batch = piece.to_record_batch()
        (static if piece.is_static else timed).setdefault(piece.entity_path, []).append(batch)
    with Log(driven) as log:
        bodies = Bodies(RunData(log), rerun_scene.RATE, "ground")
        poses = next(bodies.blocks())
    assert len(poses.t) == 3  # 0, 20 and 40 ms
    (batch,) = timed["/world/links/left_track"]
    np.testing.assert_allclose(np.array(batch["time"].cast("int64").to_pylist()) * 1e-9, poses.t, atol=1e-9)
    links = poses.links["left_track"]
    np.testing.assert_allclose(batch["Boxes3D:centers"].to_pylist(), links.centres, atol=1e-6)
    turned = np.array(batch["Boxes3D:quaternions"].to_pylist())
    np.testing.assert_allclose(matrices(np.roll(turned, 1, axis=-1)), links.axes, atol=1e-6)
    np.testing.assert_allclose(
        batch["Boxes3D:half_sizes"].to_pylist(), np.broadcast_to(bodies.tracks[0].half, (3, 64, 3)), atol=1e-7
    )
    wheel = bodies.wheels[3].name
    (batch,) = timed["/world/wheels/" + wheel.replace("/", "\\/").replace("[", "\\[").replace("]", "\\]")]
    np.testing.assert_allclose(
        np.array(batch["Transform3D:translation"].to_pylist())[:, 0], poses.wheels[wheel].position, atol=1e-6
    )
    assert "/world/ground" in static
    assert "LineStrips3D:strips" in static[f"/{rerun_scene.FOLLOWED}"][0].schema.names, "an eye follows shapes only"
    np.testing.assert_allclose(
        np.array(timed["/world/hull"][0]["Transform3D:translation"].to_pylist())[:, 0], poses.hull.position, atol=1e-6
    )
    assert sum(piece.num_rows for piece in timed["/plots/speed/chassis.speed"]) == 41  # every record
    (record,) = timed["/events"]
    with Log(driven) as log:
        happened = events.of(RunData(log)).events
    assert len(happened) > 0
    times = np.array(record["time"].cast("int64").to_pylist()) * 1e-9
    np.testing.assert_allclose(times, [event.t for event in happened], atol=1e-9)
    assert [row[0] for row in record["TextLog:text"].to_pylist()] == [f"{e.component}: {e.text}" for e in happened]


def test_foxglove_holds_scenes_frames_and_curves(driven, tmp_path):
    pytest.importorskip("foxglove")
    from mcap.reader import make_reader

    layout = foxglove_scene.write(driven, tmp_path / "x.mcap")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["x.layout.json", "x.mcap"]
    with (tmp_path / "x.mcap").open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        count = {each.topic: summary.statistics.channel_message_counts[k] for k, each in summary.channels.items()}
        kinds = {each.topic: summary.schemas[each.schema_id].name for each in summary.channels.values()}
        speed = [
            (message.log_time, json.loads(message.data)["value"])
            for _, _, message in reader.iter_messages("/plots/speed/chassis_speed")
        ]
        messages = [(message.log_time, message.data) for _, _, message in reader.iter_messages("/events")]
    assert (count["/shapes"], count["/scene"], count["/frames"], count["/plots/speed/chassis_speed"]) == (1, 3, 3, 41)
    assert (kinds["/scene"], kinds["/frames"]) == ("foxglove.SceneUpdate", "foxglove.FrameTransforms")
    with Log(driven) as log:
        t, values = log.signal("chassis.speed")
        happened = events.of(RunData(log)).events
    assert kinds["/events"] == "foxglove.Log"
    assert [at for at, _ in messages] == [round(event.t * 1e9) for event in happened] != []
    assert all(event.text.encode() in data for event, (_, data) in zip(happened, messages, strict=True))
    np.testing.assert_allclose(np.array(speed), np.stack([t * 1e9, values], axis=1), atol=1e-6)
    asked = re.findall(r"/plots/[^.]*(?=\.value)", layout.read_text())
    assert sorted(asked) == sorted(topic for topic in count if topic.startswith("/plots/"))
    panels = json.loads(layout.read_text())
    named = re.findall(r'"((?:3D|Plot|RosOut)!\w+)"', json.dumps(panels["layout"]))
    assert sorted(named) == sorted(panels["configById"])
    hidden = panels["configById"]["3D!space"]["transforms"]
    assert {"frame:world", "frame:hull"} < hidden.keys()
    assert not any(each["visible"] for each in hidden.values())
    with pytest.raises(BadInput, match=r"run\.mcap is the log itself"):
        foxglove_scene.write(driven, driven)


def test_a_film_has_the_pictures_of_its_time(hanging, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    log = stretched(hanging, tmp_path / "slow.mcap", np.arange(5) * 0.12)
    count = film.write(log, tmp_path / "x.mp4")
    assert count == 13  # of 0.48 s, with both ends
    reader = ffmpeg.read_frames(str(tmp_path / "x.mp4"))
    about = next(reader)
    assert about["source_size"][0] == film.WIDTHS[".mp4"]
    width, height = about["source_size"]
    pictures = [np.frombuffer(each, np.uint8).reshape(height, width, 3).astype(int) for each in reader]
    assert len(pictures) == 13
    changed = [np.abs(b - a).mean() > 0.1 for a, b in pairwise(pictures)]
    assert changed == [False, False, True] * 4  # each record is shown in three pictures, until the next one
    assert film.write(log, tmp_path / "x.gif") == 7  # 12.5 per second
    assert (tmp_path / "x.gif").read_bytes()[:6] == b"GIF89a"
    assert {file.name for file in tmp_path.iterdir()} == {"slow.mcap", "x.mp4", "x.gif"}


def test_a_film_of_a_vehicle_from_every_side(driven, tmp_path):
    from PIL import Image

    for eye in projected.VIEWPOINTS:
        film.write(driven, tmp_path / f"{eye}.gif", eye, "sliding")
        with Image.open(tmp_path / f"{eye}.gif") as image:
            seen = np.asarray(image.convert("RGB")).reshape(-1, 3).astype(int)
        earth = np.abs(seen - [176, 160, 136]).max(axis=1) < 12
        assert 0.05 < earth.mean() < 0.9, eye


def test_a_still_is_one_instant_from_any_side(driven, cotrack, tmp_path):
    from PIL import Image

    def seen(name, *arguments):
        status, out, err = cotrack("view", driven, "-o", tmp_path / name, *arguments)
        assert (status, out) == (0, f"{tmp_path / name}\n"), err
        with Image.open(tmp_path / name) as image:
            return np.asarray(image.convert("RGB")).astype(int)

    first, last = (seen(f"{t}.png", "--seen-from", "corner", "--at", t, "--colour", "sliding") for t in ("0", "9"))
    earth = np.abs(last - [176, 160, 136]).max(axis=2) < 12
    assert 0.05 < earth.mean() < 0.9
    assert first.shape[1] == last.shape[1] == film.WIDTHS[film.STILL]
    np.testing.assert_array_equal(seen("end.png", "--seen-from", "corner", "--colour", "sliding"), last)
    height = min(len(first), len(last))
    assert np.abs(first[:height] - last[:height]).max() > 20
    top = seen("top.png", "--seen-from", "top")
    height = min(len(top), len(last))
    assert np.abs(top[:height] - last[:height]).mean() > 5.0


def test_the_section_of_the_ground_runs_under_a_vehicle_that_turned(shown):
    _, bodies, _ = shown
    profile = bodies.ground
    for turned in (0.0, 0.7):
        seen = projected.make_camera("right", 0.4 + turned, profile.start + np.array([0.0, 0.0, 1.0]))
        line, metres = projected.section(seen, profile, -4.0, 4.0)
        places = seen.centre + line[:, :1] * seen.right + line[:, 1:] * seen.up
        np.testing.assert_allclose(
            profile.height_at((places - profile.start) @ profile.ahead), places[:, 2], atol=1e-12
        )
        assert line[:, 1].max() - line[:, 1].min() == pytest.approx(0.01, abs=1e-9)
        assert np.diff(metres[:, 0]) == pytest.approx(1.0 / np.cos(turned))


def test_a_picture_shows_the_ground_as_it_is(driven):
    with Log(driven) as log:
        run = RunData(log)
        links = run.links("left_track", Window(0.02, 0.02))
        bodies = Bodies(run, 1e4, track="left_track")
        bodies.select_instants([0.02])
        line, _ = projected.section(side_view.side_view(bodies, next(bodies.blocks())).camera, bodies.ground, -4.5, 0.5)
    deep = np.interp(links.forward[0], *line.T) - (links.up[0] - 0.029)
    assert np.ptp(line[:, 1]) == pytest.approx(0.01, abs=1e-6)
    top = line[line[:, 1] > line[:, 1].max() - 1e-9, 0]
    low = links.up[0] < -0.4
    over = low & (links.forward[0] > top[0]) & (links.forward[0] < top[-1])
    beside = low & (links.forward[0] > -3.3) & (links.forward[0] < top[0] - 0.3)
    for part in (over, beside):
        assert part.sum() >= 3
        assert np.abs(deep[part]).max() < 5e-3  # pads are compressed; without the bump, 1 cm
    # start of the bump, its foot, and half of its top from the middle; the sprocket axle has hardly moved
    assert 0.5 * (top[0] + top[-1]) == pytest.approx(-2.4 + 0.5 * (0.5) + foot(), abs=0.02)


def foot():
    """Length of a side of the bump, along the way, m."""
    straight = 0.01 - 2 * 0.02 * (1 - np.cos(0.1))
    return 2 * 0.02 * np.sin(0.1) + straight / np.tan(0.1)


@pytest.mark.long
def test_numbers_under_narrow_panes_do_not_overlap(tmp_path, monkeypatch):
    path, drawn = tmp_path / "folded.mcap", []
    simulate(load("folded_chain", "rigid", ("run.stop=0.01", "chain.links=65", "expect={}")), path)
    monkeypatch.setattr(side_view, "save_figure", lambda figure, output: drawn.append(figure))
    side_view.draw(path, tmp_path / "x.png")
    (figure,) = drawn
    figure.canvas.draw()
    panes = figure.axes[:-1]  # the last one is the colour scale
    assert len({pane.get_position().y0 for pane in panes}) == 1, "panes are not side by side"
    for pane in panes:
        low, high = pane.get_xlim()
        labels = [each for each in pane.get_xticklabels() if low <= each.get_position()[0] <= high]
        boxes = sorted((each.get_window_extent().x0, each.get_window_extent().x1) for each in labels)
        assert len(boxes) >= 1
        assert all(end < begin for (_, end), (begin, _) in pairwise(boxes))


def test_pictures_are_of_instants_in_which_something_moves():
    recorded = np.arange(0, 10.01, 0.1)
    assert side_view._instants(recorded, 10.0, None, Window(1.0, 4.0)) == pytest.approx([0.0, 2.0, 3.0, 4.0])
    assert side_view._instants(recorded, 10.0, None) == pytest.approx([3.3, 6.7, 10.0])
    assert side_view._instants(np.zeros(1), 0.0, None) == [0.0]


def test_what_cannot_be_written_is_refused_first(cotrack, hanging, tmp_path, monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    for arguments, said in (
        (("-o", "x.tif"), "x.tif cannot be written: its name must end in .png, .svg or .pdf; a view can be"),
        (("-o", "x.rrd"), "x.rrd cannot be written: its name must end in .png, .svg or .pdf; a view can be"),
        (("--rerun", "-o", "x.png"), "x.png cannot be written: its name must end in .rrd; a view can be"),
        (("--foxglove", "-o", "nowhere/x.mcap"), "there is no folder nowhere"),
        (("--rerun",), "there is no display for the viewer"),
        (("--foxglove",), "-o FILE says what is written"),
        (("--rerun", "--foxglove", "-o", "x.mcap"), "one of them at a time"),
        (("-o", "x.mp4", "--seen-from", "below"), "one looks from one of right, top, corner"),
        (("-o", "x.mp4", "--at", "0"), "--at is for pictures"),
        (("-o", "x.png", "--colour", "stress"), "--colour is for films, stills (--seen-from), --rerun and --foxglove"),
        (("-o", "x.png", "--above", "--seen-from", "top"), "--seen-from is for films and stills"),
        (("-o", "x.png", "--seen-from", "top", "--at", "0", "--at", "1"), "a still shows one instant"),
        (("-o", "x.svg", "--seen-from", "top"), "its name must end in .png"),
        (("-o", "x.png", "--seen-from", "top", "--at", "-1"), "no instant"),
    ):
        status, out, err = cotrack("view", hanging, *arguments)
        assert (status, out, len(err.splitlines())) == (2, "", 1), arguments
        assert said in err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "arguments", "said"),
    [
        ("rerun", ("--rerun", "-o", "x.rrd"), "rerun is not installed: pip install 'cotrack[view]'"),
        ("foxglove", ("--foxglove", "-o", "x.mcap"), "foxglove is not installed: pip install 'cotrack[view]'"),
        ("imageio_ffmpeg", ("-o", "x.mp4"), "imageio_ffmpeg is not installed: pip install 'cotrack[video]'"),
    ],
)
def test_without_an_extra_there_is_a_sentence(cotrack, hanging, monkeypatch, tmp_path, name, arguments, said):
    monkeypatch.setitem(__import__("sys").modules, name, None)
    status, _, err = cotrack("view", hanging, *arguments)
    assert (status, said in err) == (2, True), err
    assert not list(tmp_path.iterdir())


def test_curves_are_every_record(driven):
    with Log(driven) as log:
        wanted = plots(log)
        assert [plot.name for plot in wanted] == ["speed", "torque", "power", "tension"]
        pieces = {}
        for plot, signal, t, values in curves(log, wanted, (0.01, 0.02)):
            pieces.setdefault((plot.name, signal), []).append((t, values))
        t, values = (np.concatenate(each) for each in zip(*pieces["tension", "left_track.tension.max"], strict=True))
        times, recorded = log.signal("left_track.tension.max")
        kept = within(times, Window(0.01, 0.02))
        np.testing.assert_array_equal(t, times[kept])
        np.testing.assert_allclose(values, recorded[kept] / 1e3, rtol=1e-15)
        assert len(pieces) == 1 + 2 + 2 + 4


# --- one link and one tooth in all drawings ---------------------------------------------------------

AT, LINK = 0.02, 5  # s; from 1


@pytest.fixture(scope="module")
def marked(driven):
    """A right corner of a link and the first tooth tip of the left sprocket, from the log alone."""
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
    angle = -0.8 * np.pi / sprocket["teeth"]
    ahead, up = sprocket["outer_radius"] * np.array([np.cos(angle), np.sin(angle)])
    return corner, axle + turned.apply([ahead, -0.5 * chain["width"], up])


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
    view = side_view.side_view(bodies, poses)
    boxes, rims = view.links.reshape(-1, 2), np.concatenate([outline for _, _, outline in view.wheels])
    corner, tip = view.camera.project(np.stack(marked))
    assert missed([corner], boxes) < 1e-9
    assert missed([tip], rims) < 1e-9
    assert missed([corner], 1.03 * boxes) > 1e-3
    assert missed([tip], 1.03 * rims) > 1e-3
    lowest = int(poses.links["left_track"].centres[0, :, 2].argmin())
    track, links = bodies.tracks[0], poses.links["left_track"]
    under = links.centres[0, lowest] + links.axes[0, lowest] @ (track.half * [1.0, 1.0, -1.0])
    assert missed([under[:2]], np.concatenate(top_view.top_view(bodies, poses).links)) < 1e-9


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
    corner, tip = seen.project(np.stack(marked))
    assert missed([corner], corners) < 3 * player.UNIT
    assert missed([tip], outline) < 3 * player.UNIT
    assert missed([tip], np.array(outline) - 5 * player.UNIT) > 3 * player.UNIT


def test_rerun_places_a_link_and_a_tooth_where_they_were(driven, marked, tmp_path):
    chunk = pytest.importorskip("rerun.chunk")
    rerun_scene.show(driven, tmp_path / "run.rrd")
    batches = {}
    for piece in chunk.RrdReader(tmp_path / "run.rrd").stream():
        batches.setdefault((piece.entity_path, piece.is_static), piece.to_record_batch())
    boxes = batches["/world/links/left_track", False]
    centres, turned, half = (
        np.array(boxes[f"Boxes3D:{name}"].to_pylist())[1] for name in ("centers", "quaternions", "half_sizes")
    )  # at 20 ms
    corners = centres + np.einsum("nij,nj->ni", Rotation.from_quat(turned).as_matrix(), half * [-1.0, -1.0, -1.0])
    assert missed(marked[:1], corners) < 1e-6
    wheel = "/world/wheels/left_track\\/sprocket"
    place = batches[wheel, False]
    position = np.array(place["Transform3D:translation"].to_pylist())[1, 0]
    turn = Rotation.from_quat(np.array(place["Transform3D:quaternion"].to_pylist())[1, 0])
    vertices = np.array(batches[f"{wheel}/shape", True]["Mesh3D:vertex_positions"].to_pylist())[0]
    assert missed(marked[1:], position + turn.apply(vertices)) < 1e-6


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
    assert missed(marked[:1], corners) < 1e-9
    frame = next(each for each in messages["/frames"][1].transforms if each.child_frame_id == "left_track/sprocket")
    shape = next(each for each in messages["/shapes"][0].entities if each.id == "left_track/sprocket").triangles[0]
    turn = Rotation.from_quat(numbers(frame.rotation, "xyzw"))
    assert missed(marked[1:], numbers(frame.translation) + turn.apply([numbers(p) for p in shape.points])) < 1e-9


def decoded(path, topic):
    """Messages of a topic, decoded by the schema in the file."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
    from mcap.reader import make_reader

    messages = []
    with path.open("rb") as file:
        for schema, _, message in make_reader(file).iter_messages(topic):
            files = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
            pool = descriptor_pool.DescriptorPool()
            for each in files.file:
                pool.Add(each)
            kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
            messages.append(kind.FromString(message.data))
    return messages


def test_a_run_that_blew_up_is_shown_up_to_there(hanging, tmp_path):
    path = stretched(hanging, tmp_path / "blown.mcap", np.arange(5) * 0.1, blown=3)
    with Log(path) as log:
        bodies = Bodies(RunData(log), 1e4)
        (poses,) = bodies.blocks()
        np.testing.assert_allclose(poses.t, [0.0, 0.1, 0.2], atol=1e-12)
        bodies.select_instants([0.1, 0.4])
        assert len(side_view._figure(bodies).axes) == 2, "a pane and the colour scale"
        bodies.select_instants([0.4])
        with pytest.raises(BadInput, match="values of /chain/links are no finite numbers: there is nothing to show"):
            next(bodies.blocks())
