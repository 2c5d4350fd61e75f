"""Pictures, films and stills, curves, and files of Rerun and Foxglove of a run, against log and analyses."""

import json
import re
from decimal import Decimal
from itertools import combinations, pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from made_logs import of_columns, stretched
from matplotlib import image
from matplotlib.text import Text
from PIL import Image
from short_runs import hanging_log, settling_log
from view_files import bodies_of

from fmus.vehicles.tables import BadInput
from orchestrator.files.command import command_scope
from orchestrator.log.reader import Log
from orchestrator.results.analyses import events, link_loads, profile, wheel_loads
from orchestrator.results.output_files import new_figure
from orchestrator.results.page import player
from orchestrator.results.run_data import RunData, Window, within
from orchestrator.results.views import film, flat_views, foxglove_scene, projected, rerun_scene, solids
from orchestrator.results.views.bodies import EVERY, Bodies
from orchestrator.results.views.plots import curves, plots
from orchestrator.scene.scene import load

driven = pytest.fixture(scope="module")(settling_log)
hanging = pytest.fixture(scope="module")(hanging_log)
shown = pytest.fixture(bodies_of)

EARTH = [176, 160, 136]


@pytest.fixture(scope="module")
def expected(driven):
    """Curves, bars at 50 instants a second and events of the vehicle, by the analyses that the report shows."""
    with Log(driven) as log:
        run = RunData(log)
        loads, column = link_loads.of(run, "left_track"), wheel_loads.names(run).index("left_track.road_wheel[2]")
        profiles = [profile.of(run, loads, t) for t in (0.0, 0.02, 0.04)]
        return SimpleNamespace(
            places=[each.place for each in profiles],
            tensions=[each.tension / 1e3 for each in profiles],  # kN
            loads=np.concatenate([values[:, column] for _, values in wheel_loads.blocks(run)]) / 1e3,
            events=events.of(run).events,
            speed=log.signal("chassis.speed"),
        )


# --- Rerun and Foxglove ----------------------------------------------------------------------------


def origins_of_views(bodies, path):
    """Entities that the views of a recording show."""
    origins = []

    class Noted:
        def __getattr__(self, name):
            return lambda *_, **options: origins.append(options.get("origin"))

    scene = rerun_scene.RerunRecording(Noted(), Noted(), Noted(), "run", path)
    scene.start(bodies, plots(bodies.run), (0.0, 1.0), True)
    return [origin for origin in origins if origin]


def column(batch, name):
    return np.array((batch[name].cast("int64") if name == "time" else batch[name]).to_pylist())


@pytest.mark.long
def test_rerun_holds_bodies_curves_and_events(driven, expected, tmp_path):
    chunk = pytest.importorskip("rerun.chunk")
    rerun_scene.show(driven, tmp_path / "run.rrd", "ground")
    assert [file.name for file in tmp_path.iterdir()] == ["run.rrd"]
    timed, static = {}, {}
    for piece in chunk.RrdReader(tmp_path / "run.rrd").stream():
        (static if piece.is_static else timed).setdefault(piece.entity_path, []).append(piece.to_record_batch())
    with Log(driven) as log:
        bodies = Bodies(RunData(log), rerun_scene.RATE, "ground")
        poses = next(bodies.blocks())
        origins = origins_of_views(bodies, tmp_path / "x.rrd")
    (batch,) = timed["/world/links/left_track"]
    np.testing.assert_allclose(column(batch, "time") * 1e-9, poses.t, atol=1e-9)
    links = poses.links["left_track"]
    centres = links.centres + links.axes @ bodies.tracks[0].parts[0].centre
    np.testing.assert_allclose(column(batch, "Boxes3D:centers"), centres, atol=1e-6)
    hull = column(timed["/world/hull"][0], "Transform3D:translation")[:, 0]
    np.testing.assert_allclose(hull, poses.hull.position, atol=1e-6)
    faces = column(static[f"/{rerun_scene.FOLLOWED}/faces"][0], "Mesh3D:vertex_positions")[0]
    np.testing.assert_allclose(np.unique(faces, axis=0), np.unique(bodies.hull.corners, axis=0), atol=1e-6)
    assert "/world/ground" in static
    assert "LineStrips3D:strips" in static[f"/{rerun_scene.FOLLOWED}"][0].schema.names, "an eye follows shapes only"
    assert len(origins) == 1 + 2 + 3 + 5 + 1
    assert all(any(path.startswith("/" + origin.strip("/")) for path in {*timed, *static}) for origin in origins)
    assert sum(piece.num_rows for piece in timed["/plots/speed/chassis.speed"]) == 41  # every record
    bars = sorted(
        (time, bar[0]["buffer"], place[0]["buffer"])
        for batch in timed["/chain/left_track"]
        for time, bar, place in zip(
            *(batch[name].to_pylist() for name in ("time", "BarChart:values", "BarChart:abscissa")), strict=True
        )
    )
    np.testing.assert_allclose([values for _, values, _ in bars], expected.tensions, rtol=1e-6)
    np.testing.assert_allclose([places for *_, places in bars], expected.places, atol=1e-3)
    batches = timed["/plots/loads_left_track/left_track.road_wheel\\[2\\].load"]
    loads = np.concatenate([column(batch, "Scalars:scalars") for batch in batches])
    np.testing.assert_allclose(np.ravel(loads), expected.loads, rtol=1e-12)
    (record,) = timed["/events"]
    assert len(expected.events) > 0
    times = column(record, "time") * 1e-9
    np.testing.assert_allclose(times, [event.t for event in expected.events], atol=1e-9)
    assert [row[0] for row in record["TextLog:text"].to_pylist()] == [
        f"{event.component}: {event.text}" for event in expected.events
    ]


def test_foxglove_holds_scenes_frames_curves_and_a_layout_of_them(driven, expected, tmp_path):
    pytest.importorskip("foxglove")
    from mcap.reader import make_reader

    layout = foxglove_scene.write(driven, tmp_path / "x.mcap")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["x.layout.json", "x.mcap"]
    sent, kinds = {}, {}
    with (tmp_path / "x.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            sent.setdefault(channel.topic, []).append((message.log_time, message.data))
            kinds[channel.topic] = schema.name

    def values(topic, key="value"):
        return [json.loads(data)[key] for _, data in sent[topic]]

    assert [len(sent[topic]) for topic in ("/shapes", "/hull", "/scene", "/frames")] == [1, 1, 3, 3]
    assert [kinds[topic].removeprefix("foxglove.") for topic in ("/scene", "/frames", "/events")] == [
        "SceneUpdate", "FrameTransforms", "Log",
    ]  # fmt: skip
    t, speed = expected.speed
    np.testing.assert_allclose([at for at, _ in sent["/plots/speed/chassis_speed"]], t * 1e9, atol=1.0)
    np.testing.assert_allclose(values("/plots/speed/chassis_speed"), speed, atol=1e-6)
    loads = values("/plots/loads_left_track/left_track_road_wheel_2__load")
    np.testing.assert_allclose(loads, expected.loads, rtol=1e-6)
    places = values("/chain/left_track", "place")
    np.testing.assert_allclose(places, expected.places, atol=1e-3)  # the zero is that of the first record
    np.testing.assert_allclose(values("/chain/left_track", "tension"), expected.tensions, atol=6e-5)
    assert [at for at, _ in sent["/events"]] == [round(event.t * 1e9) for event in expected.events] != []
    assert all(event.text.encode() in data for event, (_, data) in zip(expected.events, sent["/events"], strict=True))
    # every panel is in the layout, and shows a topic that is sent
    panels = json.loads(layout.read_text())
    within_layout = json.dumps([panels["layout"], panels["configById"]["Tab!curves"]])
    assert sorted(re.findall(r'"((?:3D|Plot|Tab|RosOut)!\w+)"', within_layout)) == sorted(panels["configById"])
    drawn = re.findall(r'"value": "(/[^"]+)"', layout.read_text())
    for path in drawn:
        topic, _, field = path.partition(".")
        assert isinstance(values(topic, field.removesuffix("[:]"))[0], list) == field.endswith("[:]"), path
    assert {path.partition(".")[0] for path in drawn} == {
        topic for topic in sent if topic.startswith(("/plots/", "/chain/"))
    }
    hidden = panels["configById"]["3D!space"]["transforms"]
    assert {"frame:world", "frame:hull"} < hidden.keys()
    assert not any(each["visible"] for each in hidden.values())
    with pytest.raises(BadInput), command_scope():
        foxglove_scene.write(driven, driven)  # a file that is read


def test_curves_are_every_record(driven):
    with Log(driven) as log:
        wanted, pieces = plots(RunData(log)), {}
        for plot, signal, t, values in curves(RunData(log), wanted, (0.01, 0.02)):
            pieces.setdefault((plot.name, signal), []).append((t, values))
        times, recorded = log.signal("left_track.tension.max")
    assert [plot.name for plot in wanted if plot.group == "loads"] == [
        "tension",
        "loads_left_track",
        "loads_right_track",
    ]
    assert [plot.name for plot in wanted[3:]] == ["speed", "yaw_rate", "slip", "torque", "power"]
    assert len(pieces) == 4 + 10 + 1 + 1 + 2 + 2 + 2
    t, values = (np.concatenate(each) for each in zip(*pieces["tension", "left_track.tension.max"], strict=True))
    kept = within(times, Window(0.01, 0.02))
    np.testing.assert_array_equal(t, times[kept])
    np.testing.assert_allclose(values, recorded[kept] / 1e3, rtol=1e-15)


# --- films and stills ------------------------------------------------------------------------------


@pytest.mark.long
def test_a_film_has_the_pictures_of_its_time(hanging, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    log = stretched(hanging, tmp_path / "slow.mcap", np.arange(5) * 0.12)
    assert film.write(log, tmp_path / "x.mp4") == 13  # of 0.48 s, with both ends
    reader = ffmpeg.read_frames(str(tmp_path / "x.mp4"))
    width, height = next(reader)["source_size"]
    assert width == film.WIDTHS[".mp4"]
    pictures = [np.frombuffer(each, np.uint8).reshape(height, width, 3).astype(int) for each in reader]
    changed = [np.abs(b - a).mean() > 0.1 for a, b in pairwise(pictures)]
    assert changed == [False, False, True] * 4  # each record is shown in three pictures, until the next one
    assert film.write(log, tmp_path / "x.gif") == 7  # 12.5 per second
    assert (tmp_path / "x.gif").read_bytes()[:6] == b"GIF89a"
    assert film.write(log, tmp_path / "x.gif", window=Window(0.12, 0.36)) == 4
    assert {file.name for file in tmp_path.iterdir()} == {"slow.mcap", "x.mp4", "x.gif"}


def pixels(path):
    with Image.open(path) as opened:
        return np.asarray(opened.convert("RGB")).astype(int)


@pytest.mark.long
def test_stills_show_the_vehicle_on_the_ground_from_every_side_at_an_instant(driven, cotrack, tmp_path):
    def still(eye, *at):
        view = ("view", driven, "-o", tmp_path / "x.png", "--seen-from", eye, "--colour", "sliding", *at)
        assert cotrack.done(*view) == f"{tmp_path / 'x.png'}\n"
        picture = pixels(tmp_path / "x.png")
        assert picture.shape[1] == film.WIDTHS[film.STILL]
        assert 0.05 < (np.abs(picture - EARTH).max(axis=2) < 12).mean() < 0.9, eye
        return picture

    last, *others = [still(eye) for eye in ("corner", "top", "right")]
    first, beyond = still("corner", "--at", "0"), still("corner", "--at", "9")
    np.testing.assert_array_equal(beyond, last)
    height = min(map(len, (first, last, *others)))
    assert np.abs(first[:height] - last[:height]).max() > 20
    assert min(np.abs(other[:height] - last[:height]).mean() for other in others) > 5.0


def test_a_run_has_one_colour_scale_in_all_its_pictures(driven, tmp_path, monkeypatch):
    with Log(driven) as log:
        names = [f"{side}_track.link[{i + 1}].tension" for side in ("left", "right") for i in range(64)]
        t = log.signal("left_track.link[1].tension")[0]
        largest = log.sample(names, t).max(axis=1) / 1e3
        most = float(np.quantile(largest, 0.98, method="higher"))
        assert largest[t > 0.03].max() < 0.95 * most
        scale = pytest.approx((0.0, most), rel=1e-12)
        still = Bodies(RunData(log), 1e4, window=(0.03, np.inf))
        still.select_instants([0.04])
        for bodies in (still, Bodies(RunData(log), 10.0), Bodies(RunData(log), 1e4, track="right_track")):
            assert bodies.colour_range() == scale
        layers, scales = projected.layers, []
        monkeypatch.setattr(projected, "layers", lambda *given: (scales.append(given[4]), layers(*given))[1])
        next(film.FilmPicture(still, "corner", 400).frames(1.0))
        assert scales == [scale]
        view = player.player(RunData(log), "left_track")
        assert (view["least"], view["most"]) == scale
    pytest.importorskip("foxglove")
    panels = json.loads(foxglove_scene.write(driven, tmp_path / "x.mcap").read_text())["configById"]
    told = f"links by link tension, kN: 0 (dark) to {most:.3g} (light)"
    assert panels["3D!space"]["foxglovePanelTitle"] == f"{told}; arrows: forces of the ground, 20 kN a metre"


def test_arrows_of_a_round_force_show_the_scale_of_others():
    for longest, force, length, label in ((0.999, 20e3, 0.5, "10 kN"), (1.0, 20e3, 1.0, "20 kN"),
                                          (0.045, 1e3, pytest.approx(0.02), "0.02 kN")):  # fmt: skip
        assert solids.scale_arrow(longest, force) == (length, label)
    scene = {"vehicle": {"track": {"pitch": 0.1524}}}
    for links, force in ((64, 20e3), (32, 5e3), (10, 500.0)):  # as the square of the length, rounded
        assert solids.force_of_a_metre(SimpleNamespace(tracks=[SimpleNamespace(links=links)], scene=scene)) == force
    (drawn, short) = solids.with_heads(np.array([[[0.0, 0.0], [2.0, 0.0]], [[0.0, 0.0], [0.0, 0.03]]]), 0.5)
    np.testing.assert_allclose(drawn[[0, 1, 3]], [[0, 0], [2, 0], [2, 0]], atol=1e-15)
    np.testing.assert_allclose(sorted(drawn[[2, 4]].tolist()), [[1.5, -0.25], [1.5, 0.25]], atol=1e-15)
    np.testing.assert_allclose(short[[0, 1, 3]], [[0, 0], [0, 0.03], [0, 0.03]], atol=1e-15)
    np.testing.assert_allclose(short[[2, 4], 1], 0.02, atol=1e-15)  # a third of the arrow


# --- pictures in a plane ---------------------------------------------------------------------------


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


def test_the_section_of_the_ground_runs_under_a_vehicle_that_turned(shown):
    _, bodies, _ = shown
    profile = bodies.ground
    for turned in (0.0, 0.7):
        seen = projected.make_camera("right", 0.4 + turned, profile.start + np.array([0.0, 0.0, 1.0]))
        line, metres = projected.section(seen, profile, -4.0, 4.0)
        places = seen.centre + line[:, :1] * seen.right + line[:, 1:] * seen.up
        heights = profile.height_at((places - profile.start) @ profile.ahead)
        np.testing.assert_allclose(heights, places[:, 2], atol=1e-12)
        assert np.ptp(line[:, 1]) == pytest.approx(0.01, abs=1e-9)
        assert np.diff(metres[:, 0]) == pytest.approx(1.0 / np.cos(turned))


@pytest.mark.parametrize(("motions", "texts"), [
    ([(0.0, 0.7 * k) for k in range(5)], ["0 s -", "1 s -", "2 s -", "3 s -", "4 s -"]),  # on the spot: at the fronts
    ([(0.0, 0.0)] * 4, ["0, 1, 2, 3 s"]),  # at rest
    ([(5.0 * k, 0.1 * k) for k in range(4)], ["0 s", "1 s", "2 s", "3 s"]),
    ([(0.0, 0.0), (0.5, 0.0), (3.9, 0.3), (7.0, 0.8), (9.0, 1.3)], ["0 s", "1 s", "2 s", "3 s", "4 s"]),
    ([(0.2 * k, 0.0) for k in range(5)] + [(9.0, 0.0)], ["0 s", "1 s -", "2 s -", "3 s -", "4 s", "5 s"]),  # crowded
])  # fmt: skip
def test_times_from_above_stand_at_their_dots(motions, texts):
    """Of a track of 4 m at (x, heading) every second, as drawn: a time is within 10 points of its dot, or a line ("-")
    leads to it, from the left or, of all dots in one place, from the front. Times do not overlap, and beside one is no
    other dot.
    """
    views = []
    for t, (x, heading) in enumerate(motions):
        ahead, hull = np.array([np.cos(heading), np.sin(heading)]), np.array([x, 0.0])
        corners = hull + 2.0 * np.stack([ahead, -ahead])
        views.append(
            flat_views.TopView(float(t), hull, ahead, [corners[:1], corners[1:]], hull[None], np.ones((1, 2)), False)
        )
    figure = new_figure(8.0, 8.0, dpi=72)  # a point is a pixel
    pane, size = figure.subplots(), max(abs(x) for x, _ in motions) + flat_views.ROOM
    pane.plot([-0.5 * flat_views.ROOM, size - 0.5 * flat_views.ROOM], [0.0, 0.0])
    flat_views.draw_times(pane, views, size)
    pane.set_aspect("equal", adjustable="datalim")
    figure.draw_without_rendering()
    drawn = [Text.get_window_extent(text) for text in pane.texts]
    dots = pane.transData.transform([view.hull for view in views])
    gaps = [np.hypot(*np.maximum(0.0, np.abs(dots - (box.min + box.max) / 2) - box.size / 2).T) for box in drawn]
    assert [text.get_text() + (" -" if text.arrow_patch else "") for text in pane.texts] == texts
    for text, box, gap, view in zip(pane.texts, drawn, gaps, views, strict=False):
        own = np.hypot(*(dots - pane.transData.transform(text.xy)).T) < 1.0
        if text.arrow_patch:
            ends = text.arrow_patch.get_transform().transform(text.arrow_patch.get_path().vertices)[[0, -1]]
            assert box.padded(8.0).contains(*ends[0])
            assert np.hypot(*(ends[1] - dots[own][0])) < 4.0
            away = pane.transData.inverted().transform((box.min + box.max) / 2) - text.xy  # m
            aside = view.ahead if own.all() else np.array([-view.ahead[1], view.ahead[0]])
            assert max(0.95 * np.hypot(*away), 2.0 if own.all() else 0.0) < aside @ away < 2.6
        else:
            assert gap[own].max() < 10.0
            assert gap[~own].min(initial=np.inf) > gap[own].max()
    assert not any(a.overlaps(b) for a, b in combinations(drawn, 2))


@pytest.mark.long
def test_a_picture_from_the_side_fills_its_page(driven, tmp_path):
    """Less than a fifth is blank on either side, by one or three instants, and links are as wide as high."""
    for name, times in (("one", [0.04]), ("three", None)):
        flat_views.draw_side(driven, tmp_path / f"{name}.png", times)
        drawn = np.flatnonzero((image.imread(tmp_path / f"{name}.png")[..., :3] < 0.99).any(axis=(0, 2)))
        width = pixels(tmp_path / f"{name}.png").shape[1]
        assert drawn[0] < 0.2 * width
        assert drawn[-1] > 0.8 * width


@pytest.mark.parametrize(("step", "refused"), [("0.3e-3", 557), ("0.7e-3", 71), ("1e-3", 0)])
def test_pictures_are_of_moving_instants_and_of_the_end_as_it_is_written(step, refused):
    """The end as printed, which rounding puts above the last record for some k H."""
    above = 0
    for k in range(1, 1001):
        recorded = np.arange(k + 1) * float(step)
        end = float(k * Decimal(step))
        above += end > recorded[-1]
        assert flat_views.moving_instants(recorded, recorded[-1], [end]) == [recorded[k]]
        assert flat_views.moving_instants(recorded, recorded[-1], None)[-1] == recorded[k]
        with pytest.raises(BadInput):
            flat_views.moving_instants(recorded, recorded[-1], [end + 1e-3 * float(step)])
    assert above == refused
    recorded = np.arange(0, 10.01, 0.1)  # pictures are of instants in which something moves
    assert flat_views.moving_instants(recorded, 10.0, None, Window(1.0, 4.0)) == pytest.approx([0.0, 2.0, 3.0, 4.0])
    assert flat_views.moving_instants(recorded, 10.0, None) == pytest.approx([3.3, 6.7, 10.0])
    assert flat_views.moving_instants(np.zeros(1), 0.0, None) == [0.0]


@pytest.mark.long
def test_the_view_from_above_has_lower_runs_and_forces_of_the_log(driven, cotrack, tmp_path):
    cotrack.done("view", driven, "--above", "-o", "a.png")
    assert len(np.unique(pixels(tmp_path / "a.png").reshape(-1, 3), axis=0)) > 100
    with Log(driven) as log:
        bodies = Bodies(RunData(log), EVERY)
        bodies.select_instants([0.0, 0.04])
        views = [flat_views.top_view(bodies, poses) for poses in bodies.blocks(1)]
        whole = np.stack([log.signal(f"left_track.ground.force.{axis}")[1] for axis in "xy"], axis=1)
    ahead = np.array([np.cos(0.4), np.sin(0.4)])
    corners = np.concatenate(views[1].links) - [1.0, -2.0]
    along, left = corners @ ahead, corners @ [-ahead[1], ahead[0]]
    assert np.ptp(along[left > 0.0]) == pytest.approx(4.5, abs=0.3)  # as long as a track, as wide as a link
    for side in (-1.0, 1.0):
        across = side * left[side * left > 0.0]
        assert [across.min(), across.max()] == pytest.approx([1.0795 - 0.189, 1.0795 + 0.189], abs=1e-3)
    assert [view.feet.shape for view in views] == [(128, 2), (128, 2)]
    for view, force in zip(views, whole[[0, -1]], strict=True):
        assert view.force[:64].sum(axis=0) == pytest.approx(force, abs=1e-6)


def test_a_run_that_blew_up_is_shown_up_to_there(hanging, tmp_path):
    path = stretched(hanging, tmp_path / "blown.mcap", np.arange(5) * 0.1, blown=3)
    with Log(path) as log:
        bodies = Bodies(RunData(log), 1e4)
        (poses,) = bodies.blocks()
        np.testing.assert_allclose(poses.t, [0.0, 0.1, 0.2], atol=1e-12)
        bodies.select_instants([0.1, 0.4])
        assert len([*bodies.blocks(1)]) == 1
        bodies.select_instants([0.4])
        with pytest.raises(BadInput):
            next(bodies.blocks())


@pytest.mark.parametrize(("points", "says"), [([], True), ([[0.0, 0.0, 0.0]], False)])
def test_a_view_says_that_a_vehicle_without_hull_points_has_no_hull(cotrack, tmp_path, monkeypatch, points, says):
    table = load("straight").vehicle.model_dump(mode="json")
    table["chassis"]["hull"] = points
    t = 0.1 * np.arange(3)
    path = of_columns(tmp_path / "a.mcap", {"chassis.yaw": t}, t, {"assembly": "vehicle", "vehicle": table})
    for module, function in ((film, "still"), (flat_views, "draw_above")):
        monkeypatch.setattr(module, function, lambda *of: None)
    status, _, err = cotrack("view", path, "-o", tmp_path / "x.png", "--seen-from=corner")
    assert (status, "no hull is drawn" in err) == (0, says), err
    assert cotrack("view", path, "-o", tmp_path / "x.png", "--above")[2] == "", "it shows no hull of any vehicle"
