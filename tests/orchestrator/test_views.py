"""Views in space: pictures, films, curves, and files in other libraries."""

import json
import re
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from made_logs import of_columns
from view_logs import bodies_of, driven_log, hanging_log, stretched

from fmus.vehicles.tables import BadInput
from orchestrator.files.command import command_scope
from orchestrator.log.reader import Log
from orchestrator.results.analyses import events, link_loads, profile, wheel_loads
from orchestrator.results.page import player
from orchestrator.results.rotation import matrices
from orchestrator.results.run_data import RunData, Window, within
from orchestrator.results.views import film, flat_views, foxglove_scene, projected, rerun_scene, solids
from orchestrator.results.views.bodies import Bodies
from orchestrator.results.views.plots import chain_profiles, curves, plots
from orchestrator.scene.scene import load

driven = pytest.fixture(scope="module")(driven_log)
hanging = pytest.fixture(scope="module")(hanging_log)
shown = pytest.fixture(bodies_of)


LOADS = "loads_left_track/left_track.road_wheel\\[2\\].load"


def by_place(log, times):
    """Places, m, and tensions, kN, of the left track by the analysis ``profile``, which the report shows."""
    run = RunData(log)
    loads = link_loads.of(run, "left_track")
    return [(each.place, each.tension / 1e3) for each in (profile.of(run, loads, t) for t in times)]


def wheel_load(log):
    """Loads of the second road wheel on the left, kN, by the analysis ``wheel_loads``."""
    run = RunData(log)
    column = wheel_loads.names(run).index("left_track.road_wheel[2]")
    return np.concatenate([values[:, column] for _, values in wheel_loads.blocks(run)]) / 1e3


def origins_of_views(run):
    """Entities that the views of a blueprint show."""
    origins = []

    class Noted:
        def __getattr__(self, name):
            return lambda *_, **options: origins.append(options.get("origin"))

    rerun_scene._arranged(Noted(), Bodies(run, 50.0), plots(run), chain_profiles(run), (0.0, 1.0), True)
    return [origin for origin in origins if origin]


def bar_charts(batches):
    """Values and abscissae of bars in batches of Rerun, in the order of time."""
    rows = {}
    for batch in batches:
        for t, bars, places in zip(
            batch["time"].cast("int64").to_pylist(),
            batch["BarChart:values"].to_pylist(),
            batch["BarChart:abscissa"].to_pylist(),
            strict=True,
        ):
            rows[t] = bars[0]["buffer"], places[0]["buffer"]
    return [rows[t] for t in sorted(rows)]


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
    body = bodies.tracks[0].parts[0]
    np.testing.assert_allclose(
        batch["Boxes3D:centers"].to_pylist(), links.centres + links.axes @ body.centre, atol=1e-6
    )
    turned = np.array(batch["Boxes3D:quaternions"].to_pylist())
    np.testing.assert_allclose(matrices(np.roll(turned, 1, axis=-1)), links.axes, atol=1e-6)
    sizes = static["/world/links/left_track"][0]["Boxes3D:half_sizes"].to_pylist()
    np.testing.assert_allclose(sizes[0], np.broadcast_to(body.half, (64, 3)), atol=1e-7)
    (placed,) = timed["/world/links/left_track/pads\\ and\\ horns"]
    np.testing.assert_allclose(placed["InstancePoses3D:translations"].to_pylist(), links.centres, atol=1e-6)
    assert placed["InstancePoses3D:quaternions"].to_pylist() == batch["Boxes3D:quaternions"].to_pylist()
    wheel = bodies.wheels[3].name
    (batch,) = timed["/world/wheels/" + wheel.replace("/", "\\/").replace("[", "\\[").replace("]", "\\]")]
    np.testing.assert_allclose(
        np.array(batch["Transform3D:translation"].to_pylist())[:, 0], poses.wheels[wheel].position, atol=1e-6
    )
    assert "/world/ground" in static
    assert "LineStrips3D:strips" in static[f"/{rerun_scene.FOLLOWED}"][0].schema.names, "an eye follows shapes only"
    corners = np.array(static[f"/{rerun_scene.FOLLOWED}/faces"][0]["Mesh3D:vertex_positions"].to_pylist()[0])
    np.testing.assert_allclose(np.unique(corners, axis=0), np.unique(bodies.hull.corners, axis=0), atol=1e-6)
    np.testing.assert_allclose(
        np.array(timed["/world/hull"][0]["Transform3D:translation"].to_pylist())[:, 0], poses.hull.position, atol=1e-6
    )
    assert sum(piece.num_rows for piece in timed["/plots/speed/chassis.speed"]) == 41  # every record
    with Log(driven) as log:
        origins = origins_of_views(RunData(log))
    assert len(origins) == 1 + 2 + 3 + 5 + 1
    assert all(any(path.startswith("/" + origin.strip("/")) for path in {*timed, *static}) for origin in origins)
    bars = bar_charts(timed["/chain/left_track"])
    with Log(driven) as log:
        expected = by_place(log, poses.t)
    np.testing.assert_allclose([values for values, _ in bars], [tension for _, tension in expected], rtol=1e-6)
    np.testing.assert_allclose([places for _, places in bars], [place for place, _ in expected], atol=1e-3)
    loads = [batch["Scalars:scalars"].to_pylist() for batch in timed[f"/plots/{LOADS}"]]
    with Log(driven) as log:
        np.testing.assert_allclose(np.ravel(np.concatenate(loads)), wheel_load(log), rtol=1e-12)
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
    once, frames = (count["/shapes"], count["/hull"]), (count["/scene"], count["/frames"])
    assert (*once, *frames, count["/plots/speed/chassis_speed"]) == (1, 1, 3, 3, 41)
    assert (kinds["/scene"], kinds["/frames"]) == ("foxglove.SceneUpdate", "foxglove.FrameTransforms")
    with Log(driven) as log:
        t, values = log.signal("chassis.speed")
        happened = events.of(RunData(log)).events
    assert kinds["/events"] == "foxglove.Log"
    assert [at for at, _ in messages] == [round(event.t * 1e9) for event in happened] != []
    assert all(event.text.encode() in data for event, (_, data) in zip(happened, messages, strict=True))
    np.testing.assert_allclose(np.array(speed), np.stack([t * 1e9, values], axis=1), atol=1e-6)
    panels = json.loads(layout.read_text())
    shown = json.dumps([panels["layout"], panels["configById"]["Tab!curves"]])
    named = re.findall(r'"((?:3D|Plot|Tab|RosOut)!\w+)"', shown)
    assert sorted(named) == sorted(panels["configById"])
    with (tmp_path / "x.mcap").open("rb") as file:
        sent = [(channel.topic, message.data) for _, channel, message in make_reader(file).iter_messages()]
    first = dict(reversed(sent))
    for path in re.findall(r'"value": "(/[^"]+)"', layout.read_text()):
        topic, _, field = path.partition(".")
        value = json.loads(first[topic])[field.removesuffix("[:]")]
        assert isinstance(value, list) == field.endswith("[:]"), path
    assert {f"Plot!{name}" for name in ("chain_left_track", "loads_right_track", "yaw_rate", "slip")} < {*named}
    assert {topic for topic in count if topic.startswith(("/plots/", "/chain/"))} == {
        path.partition(".")[0] for path in re.findall(r'"value": "(/[^"]+)"', layout.read_text())
    }
    loads, chain = (
        [json.loads(data) for topic, data in sent if topic == wanted]
        for wanted in ("/plots/loads_left_track/left_track_road_wheel_2__load", "/chain/left_track")
    )
    with Log(driven) as log:
        np.testing.assert_allclose([each["value"] for each in loads], wheel_load(log), rtol=1e-6)
        for each, (place, tension) in zip(chain, by_place(log, [0.0, 0.02, 0.04]), strict=True):
            np.testing.assert_allclose(each["place"], place, atol=1e-3)  # the zero is that of the first record
            np.testing.assert_allclose(each["tension"], tension, atol=6e-5)
    hidden = panels["configById"]["3D!space"]["transforms"]
    assert {"frame:world", "frame:hull"} < hidden.keys()
    assert not any(each["visible"] for each in hidden.values())
    with pytest.raises(BadInput, match=r"run\.mcap' cannot be written: it is a file that is read"), command_scope():
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
    assert film.write(log, tmp_path / "x.gif", window=Window(0.12, 0.36)) == 4
    assert {file.name for file in tmp_path.iterdir()} == {"slow.mcap", "x.mp4", "x.gif"}


def test_a_film_of_a_vehicle_from_every_side(driven, tmp_path):
    from PIL import Image

    for eye in projected.VIEWPOINTS:
        film.write(driven, tmp_path / f"{eye}.gif", eye, "sliding")
        with Image.open(tmp_path / f"{eye}.gif") as image:
            seen = np.asarray(image.convert("RGB")).reshape(-1, 3).astype(int)
        earth = np.abs(seen - [176, 160, 136]).max(axis=1) < 12
        assert 0.05 < earth.mean() < 0.9, eye


@pytest.mark.long
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
        line, _ = projected.section(
            flat_views.side_view(bodies, next(bodies.blocks())).camera, bodies.ground, -4.5, 0.5
        )
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
        ("rerun", ("--rerun", "-o", "x.rrd"), "rerun is not installed: {} -e '.[view]'"),
        ("foxglove", ("--foxglove", "-o", "x.mcap"), "foxglove is not installed: {} -e '.[view]'"),
        ("imageio_ffmpeg", ("-o", "x.mp4"), "imageio_ffmpeg is not installed: {} -e '.[video]'"),
    ],
)
def test_without_an_extra_there_is_a_sentence(cotrack, hanging, monkeypatch, tmp_path, name, arguments, said):
    monkeypatch.setitem(__import__("sys").modules, name, None)
    status, _, err = cotrack("view", hanging, *arguments)
    assert (status, said.format("pip install -c constraints.txt") in err) == (2, True), err
    assert not list(tmp_path.iterdir())


def test_a_run_has_one_colour_scale_in_all_its_pictures(driven, tmp_path):
    with Log(driven) as log:
        names = [f"{side}_track.link[{i + 1}].tension" for side in ("left", "right") for i in range(64)]
        t = log.signal("left_track.link[1].tension")[0]
        largest = log.sample(names, t).max(axis=1) / 1e3
        most = float(np.quantile(largest, 0.98, method="higher"))
        assert largest[t > 0.03].max() < 0.95 * most
        expected = pytest.approx((0.0, most), rel=1e-12)
        run = RunData(log)
        still = Bodies(run, 1e4, window=(0.03, np.inf))
        still.select_instants([0.04])
        for bodies in (still, Bodies(run, 10.0), Bodies(RunData(log), 1e4, track="right_track")):
            assert bodies.colour_range() == expected
        assert film.FilmPicture(still, "corner", 400)._scale == expected
        view = player.player(RunData(log), "left_track")
        assert (view["least"], view["most"]) == expected
    pytest.importorskip("foxglove")
    panels = json.loads(foxglove_scene.write(driven, tmp_path / "x.mcap").read_text())["configById"]
    shown = f"links by link tension, kN: 0 (dark) to {most:.3g} (light)"
    assert panels["3D!space"]["foxglovePanelTitle"] == f"{shown}; arrows: forces of the ground, 20 kN a metre"


def test_arrows_of_a_round_force_show_the_scale_of_others():
    assert solids.scale_arrow(0.999, 20e3) == (0.5, "10 kN")
    assert solids.scale_arrow(1.0, 20e3) == (1.0, "20 kN")
    assert solids.scale_arrow(0.045, 1e3) == (pytest.approx(0.02), "0.02 kN")
    for links, force in ((64, 20e3), (32, 5e3), (10, 500.0)):  # as the square of the length, rounded
        scene = {"vehicle": {"track": {"pitch": 0.1524}}}
        assert solids.force_of_a_metre(SimpleNamespace(tracks=[SimpleNamespace(links=links)], scene=scene)) == force
    (drawn, short) = solids.with_heads(np.array([[[0.0, 0.0], [2.0, 0.0]], [[0.0, 0.0], [0.0, 0.03]]]), 0.5)
    np.testing.assert_allclose(drawn[[0, 1, 3]], [[0, 0], [2, 0], [2, 0]], atol=1e-15)
    np.testing.assert_allclose(sorted(drawn[[2, 4]].tolist()), [[1.5, -0.25], [1.5, 0.25]], atol=1e-15)
    np.testing.assert_allclose(short[[0, 1, 3]], [[0, 0], [0, 0.03], [0, 0.03]], atol=1e-15)
    np.testing.assert_allclose(short[[2, 4], 1], 0.02, atol=1e-15)  # a third of the arrow


def test_curves_are_every_record(driven):
    with Log(driven) as log:
        wanted = plots(RunData(log))
        assert [(plot.group, plot.name) for plot in wanted] == [
            *(("loads", name) for name in ("tension", "loads_left_track", "loads_right_track")),
            *(("motion", name) for name in ("speed", "yaw_rate", "slip", "torque", "power")),
        ]
        pieces = {}
        for plot, signal, t, values in curves(RunData(log), wanted, (0.01, 0.02)):
            pieces.setdefault((plot.name, signal), []).append((t, values))
        t, values = (np.concatenate(each) for each in zip(*pieces["tension", "left_track.tension.max"], strict=True))
        times, recorded = log.signal("left_track.tension.max")
        kept = within(times, Window(0.01, 0.02))
        np.testing.assert_array_equal(t, times[kept])
        np.testing.assert_allclose(values, recorded[kept] / 1e3, rtol=1e-15)
        assert len(pieces) == 4 + 10 + 1 + 1 + 2 + 2 + 2


def test_a_run_that_blew_up_is_shown_up_to_there(hanging, tmp_path):
    path = stretched(hanging, tmp_path / "blown.mcap", np.arange(5) * 0.1, blown=3)
    with Log(path) as log:
        bodies = Bodies(RunData(log), 1e4)
        (poses,) = bodies.blocks()
        np.testing.assert_allclose(poses.t, [0.0, 0.1, 0.2], atol=1e-12)
        bodies.select_instants([0.1, 0.4])
        assert len(flat_views._figure(bodies).axes) == 2, "a pane and the colour scale"
        bodies.select_instants([0.4])
        with pytest.raises(BadInput, match="values of /chain/links are no finite numbers: there is nothing to show"):
            next(bodies.blocks())


@pytest.mark.parametrize(("points", "option", "says"), [
    ([], "--seen-from=corner", True), ([], "--above", False),  # which draws no hull of any vehicle
    ([[0.0, 0.0, 0.0]], "--seen-from=corner", False),
])  # fmt: skip
def test_a_view_says_that_a_vehicle_without_hull_points_has_no_hull(
    cotrack, tmp_path, monkeypatch, points, option, says
):
    table = load("straight").vehicle.model_dump(mode="json")
    table["chassis"]["hull"] = points
    t = 0.1 * np.arange(3)
    path = of_columns(tmp_path / "a.mcap", {"chassis.yaw": t}, t, {"assembly": "vehicle", "vehicle": table})
    monkeypatch.setattr(film, "still", lambda *of: None)
    monkeypatch.setattr(flat_views, "draw_above", lambda *of: None)
    status, out, err = cotrack("view", path, "-o", tmp_path / "x.png", option)
    assert (status, out) == (0, f"{tmp_path / 'x.png'}\n"), err
    assert ("no hull is drawn: the vehicle has no hull points (chassis.hull)" in err) is says
