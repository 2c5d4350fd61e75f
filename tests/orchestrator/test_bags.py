"""Bags of robots as measured data: the figures of CSV, clocks, names of elements, angles, metres, points, refusals."""

import json
import shutil
import sqlite3
import struct
from math import cos, radians, sin, sqrt
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from logged import logged
from mcap.writer import Writer
from measured_files import SPEED, UNITS, T, measured_run
from scene_files import toml_lines

from fmus.vehicles.tables import BadInput
from orchestrator.cli import inventory
from orchestrator.log.bags import contents
from orchestrator.log.container import LogUnreadable
from orchestrator.results.measured_record import read
from orchestrator.scene.commented_file import scene_text
from orchestrator.scene.data_files import read_files
from orchestrator.scene.scene import load, read_scene

run = pytest.fixture(scope="module")(measured_run)
START = 1_764_400_000_000_000_000  # ns
T_TEST = T[::5][:301]
V_TEST = np.interp(T_TEST, T, SPEED) + 0.1 * np.sin(20.0 * T_TEST)
COLUMN = {"chassis.speed": "/odom.twist.twist.linear.x"}


def ns(t):
    return START + round(1e9 * t)


def store(name="ROS2_HUMBLE"):
    types = pytest.importorskip("rosbags.typesys")
    return types.get_typestore(types.Stores[name])


class Kinds:
    """Messages of ROS by short names: ``kinds.Odometry()``, with zeros where nothing is given."""

    def __init__(self, own):
        self.store = own
        self.kind = {name.rpartition("/")[2]: kind for name, kind in own.types.items()}
        self.kind["Time"] = own.types["builtin_interfaces/msg/Time"]

    def header(self, t, frame=""):
        stamp = self.kind["Time"](*divmod(ns(t), 10**9))
        own = self.kind["Header"]
        return own(stamp, frame) if "seq" not in own.__dataclass_fields__ else own(0, stamp, frame)

    def vector(self, x=0.0, y=0.0, z=0.0):
        return self.kind["Vector3"](x, y, z)

    def quaternion(self, x=0.0, y=0.0, z=0.0, w=1.0):
        return self.kind["Quaternion"](x, y, z, w)

    def odometry(self, t, v):
        k, none = self.kind, np.zeros(36)
        pose = k["PoseWithCovariance"](k["Pose"](k["Point"](0.0, 0.0, 0.0), self.quaternion()), none)
        twist = k["TwistWithCovariance"](k["Twist"](self.vector(v), self.vector()), none)
        return k["Odometry"](self.header(t), "base_link", pose, twist)

    def joints(self, t, names, speeds):
        none = np.zeros(0)
        return self.kind["JointState"](self.header(t), names, none, np.array(speeds, float), none)


@pytest.fixture
def kinds():
    return Kinds(store())


def write(folder, kinds, topics, plugin="MCAP", mode=""):
    """Write a ROS 2 bag with ``topics``: messages (time of receipt, s, message); return its file."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    shutil.rmtree(folder, ignore_errors=True)
    writer = rosbag2.Writer(folder, version=9, storage_plugin=rosbag2.StoragePlugin[plugin])
    if mode:
        writer.set_compression(rosbag2.CompressionMode[mode], rosbag2.CompressionFormat.ZSTD)
    with writer as bag:
        for topic, messages in topics.items():
            connection = bag.add_connection(topic, messages[0][1].__msgtype__, typestore=kinds.store)
            for t, message in messages:
                bag.write(connection, ns(t), kinds.store.serialize_cdr(message, message.__msgtype__))
    return next(file for file in folder.iterdir() if file.suffix != ".yaml")


def write_ros1(path, topics):
    rosbag1, kinds = pytest.importorskip("rosbags.rosbag1"), Kinds(store("ROS1_NOETIC"))
    with rosbag1.Writer(path) as bag:
        for topic, messages in topics(kinds).items():
            connection = bag.add_connection(topic, messages[0][1].__msgtype__, typestore=kinds.store)
            for t, message in messages:
                bag.write(connection, ns(t), kinds.store.serialize_ros1(message, message.__msgtype__))
    return path


def write_mcap(path, *channels, **options):
    """Write an MCAP file of other software; channels: topic, encoding, schema or None, messages by time, s."""
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile="", library="theirs")
        for topic, encoding, schema, messages in channels:
            kind = writer.register_schema(*schema) if schema else 0
            channel = writer.register_channel(topic, encoding, kind)
            for t, data in messages.items():
                writer.add_message(channel, ns(t), data, ns(t))
        writer.finish()
    return path


def odometry(kinds, v=V_TEST):
    return {"/odom": [(t, kinds.odometry(t, x)) for t, x in zip(T_TEST, v, strict=True)]}


def as_json(v=V_TEST):
    texts = {t: json.dumps({"twist": {"twist": {"linear": {"x": x}}}}).encode() for t, x in zip(T_TEST, v, strict=True)}
    return "/odom", "json", ("Odometry", "jsonschema", b"{}"), texts


def figures(comparison):
    return [x for d in comparison.differences for x in d if isinstance(x, int | float)]


FORMS = "MCAP", "MCAP STORAGE", "MCAP MESSAGE", "SQLITE3", "SQLITE3 MESSAGE", "folder", "bag", "json", "lz4", "loose"


@pytest.mark.parametrize("form", FORMS)
def test_each_kind_of_bag_gives_the_figures_of_csv(run, kinds, tmp_path, form):
    """Compressed by chunk, by message or not at all; in each the twin has another speed."""
    rows = "".join(f"{t!r},{v!r}\n" for t, v in zip(T_TEST.tolist(), V_TEST.tolist(), strict=True))
    (tmp_path / "m.csv").write_text(f"t [s],v [m/s]\n{rows}")
    from_csv = run.compare_measured(tmp_path / "m.csv", {"chassis.speed": "v"})
    for v, is_same in ((V_TEST, True), (1.01 * V_TEST, False)):
        if form == "bag":
            file = write_ros1(tmp_path / f"{is_same}.bag", lambda kinds, v=v: odometry(kinds, v))
        elif form in ("json", "lz4", "loose"):
            more = {"lz4": {"compression": 1}, "loose": {"use_chunking": False}}.get(form, {})
            file = write_mcap(tmp_path / f"{is_same}.mcap", as_json(v), **more)
        else:
            plugin, _, mode = form.replace("folder", "MCAP").partition(" ")
            file = write(tmp_path / f"{is_same}", kinds, odometry(kinds, v), plugin, mode)
            file = file.parent if form == "folder" else file
        with logged("receipt" if form in ("json", "lz4", "loose") else "header.stamp"):
            found = run.compare_measured(file, {**COLUMN})
        assert (figures(found) == pytest.approx(figures(from_csv), abs=1e-12, rel=0.0)) == is_same
        assert found.notes == ("'/odom.twist.twist.linear.x' has no unit and is taken in m/s",)


def test_a_comparison_comes_to_the_noise(run, kinds, tmp_path):
    """Noise of 0.05 m/s, a clock of its own, messages out of order; with the times of receipt it is twice as much."""
    chance = np.random.default_rng(1)
    t = 2e-3 * np.arange(1000)
    late, noise = t + chance.exponential(0.02, 1000), chance.normal(0.0, 0.05, 1000)
    messages = [(late[k], kinds.odometry(t[k] - 12.5, np.interp(t[k], T, SPEED) + noise[k])) for k in np.argsort(late)]
    found = run.compare_measured(write(tmp_path / "a", kinds, {"/odom": messages}), COLUMN, shift="find")
    assert found.differences[0].rms == pytest.approx(0.05, rel=0.05)
    assert found.shift == pytest.approx(12.5 + late.min(), abs=2e-3)
    bare = [(time, message.twist.twist) for time, message in messages]
    twin = run.compare_measured(
        write(tmp_path / "b", kinds, {"/odom": bare}), {"chassis.speed": "/odom.linear.x"}, shift="find"
    )
    assert twin.differences[0].rms > 0.1


def test_stamps_count_and_messages_that_came_late_are_sorted(kinds, tmp_path):
    """The clock of the headers is 0.25 s behind; one message came 0.03 s late, one came twice."""
    t = 0.01 * np.arange(10)
    messages = [(0.25 + x, kinds.odometry(x, 100.0 * x)) for x in t]
    messages[4:8] = [messages[5], messages[6], messages[7], (0.325, messages[4][1])]
    messages.append((0.35, kinds.odometry(t[9], -1.0)))
    file = write(tmp_path / "a", kinds, {"/odom": messages})
    told = "/odom are those of header.stamp; 1 of 11 came late, by up to 0.03 s, and are sorted; 1 with the time of an"
    with logged(told):
        (found,) = read(file, COLUMN, UNITS.get)
    assert found.t == pytest.approx(t - 0.25, abs=1e-9)
    assert found.values == pytest.approx(100.0 * t, abs=1e-9)
    unset = [(x, kinds.odometry(1e-9 * -START, 1.0)) for x in t]
    with logged("those of receipt$"):
        assert read(write(tmp_path / "b", kinds, {"/odom": unset}), COLUMN, UNITS.get)[0].t == pytest.approx(
            t, abs=1e-9
        )
    other = [(x, kinds.odometry(x - 1e9, 1.0)) for x in t]  # since boot
    with logged("another clock"):
        assert read(write(tmp_path / "c", kinds, {"/odom": other}), COLUMN, UNITS.get)[0].t == pytest.approx(
            t, abs=1e-6
        )


def test_topics_of_one_clock_have_one_zero(kinds, tmp_path):
    """A simulation at half the pace: joints begin 1.5 s after odometry; the clock of a third topic is another one."""
    t = 0.1 * np.arange(40)
    simulated = 10.0 - 1e-9 * START
    odometry = [(2.0 * x, kinds.odometry(simulated + x, 100.0 * x)) for x in t]
    joints = [(2.0 * x, kinds.joints(simulated + x, ["l"], [x])) for x in t[15:]]
    boot = [(2.0 * x, kinds.odometry(2.0 * x - 1e9, x)) for x in t[3:]]
    file = write(tmp_path / "a", kinds, {"/joints": joints, "/odom": odometry, "/boot": boot})
    other = {"chassis.force": "/joints.velocity[l]", "chassis.slip": "/boot.twist.twist.linear.x"}
    with logged("of another clock, on which 10 s is 0$"):
        joint, since_boot, speed = read(file, {**other, **COLUMN}, UNITS.get)
    assert speed.t == pytest.approx(t, abs=1e-9)
    assert joint.t == pytest.approx(t[15:], abs=1e-9)  # not 0, and not 3 s, its receipt
    assert since_boot.t == pytest.approx(2.0 * t[3:], abs=1e-6)
    stamps = contents(file)["/joints"]["stamps"]
    assert stamps == pytest.approx([11.5, 13.9])


def test_stamps_that_are_not_set_or_hours_off_are_times_of_receipt(run, kinds, cotrack, tmp_path):
    """Neither at 0 nor hours away; what follows a far one did not come late."""
    t = 0.01 * np.arange(200)
    for fault in (1e-9 * -START, -8000.0, 9000.0):
        stamps = np.where((t > 0.995) & (t < 1.015), fault, t)
        messages = [(x + 0.001, kinds.odometry(at, 100.0 * x)) for x, at in zip(t, stamps, strict=True)]
        file = write(tmp_path / "a", kinds, {"/odom": messages})
        with logged("header.stamp; 2 of 200, without one or hours from the others, stand at the"):
            (found,) = read(file, COLUMN, UNITS.get)
        assert found.t == pytest.approx(t - 0.001 + 0.001 * (stamps != t), abs=1e-9)
        assert found.values == pytest.approx(100.0 * t)
    bare = kinds.kind["Twist"](kinds.vector(1.0), kinds.vector())
    file = write(tmp_path / "b", kinds, {"/v": [(x - 5.0 * 3600.0 * (x == 0.0), bare) for x in t]})
    err = cotrack.refused("compare", run.log, file, "--map", "chassis.speed=/v.linear.x")
    assert "5 hours without a message end at 18000" in err
    assert "have one instant alone in common; a shift" in err
    far = write(tmp_path / "b", kinds, {"/v": [(x + 1.5, bare) for x in t]})
    notes = run.compare_measured(far, {"chassis.speed": "/v.linear.x"}).notes
    assert not any("find" in note for note in notes)  # the first receipt is 0
    later = {t + 1.0: text for t, text in as_json()[3].items()} | {0.0: b'{"a": 1}'}
    file = write_mcap(tmp_path / "c.mcap", (*as_json()[:3], dict(sorted(later.items()))))
    assert any("shift = find" in note for note in run.compare_measured(file, COLUMN).notes)


def test_a_folder_is_the_files_of_its_metadata(kinds, tmp_path):
    """A file of another day is not read; a folder without metadata is read in the order of time, not of names."""
    t = 0.1 * np.arange(6)
    write(tmp_path / "b", kinds, {"/odom": [(x - 1e5, kinds.odometry(x - 1e5, 9.0)) for x in t]})
    file = write(tmp_path / "a", kinds, {"/odom": [(x, kinds.odometry(x, x)) for x in t]})
    shutil.copy(tmp_path / "b" / "b.mcap", tmp_path / "a" / "other.mcap")
    with logged("not read is other.mcap, which metadata.yaml does not list"):
        (found,) = read(tmp_path / "a", COLUMN, UNITS.get)
    assert found.values == pytest.approx(t)
    (file.parent / "metadata.yaml").unlink()
    for k in range(12):
        part = write(tmp_path / "c", kinds, {"/odom": [(k + x, kinds.odometry(k + x, k + x)) for x in t]})
        shutil.copy(part, tmp_path / "a" / f"part_{k}.mcap")
    for name in ("a.mcap", "other.mcap"):
        (tmp_path / "a" / name).unlink()
    with logged(".") as told:
        (found,) = read(tmp_path / "a", COLUMN, UNITS.get)
    assert len(found.t) == 72
    assert not any("late" in sentence for sentence in told)
    (tmp_path / "a" / "metadata.yaml").write_text(
        "rosbag2_bagfile_information: {relative_file_paths: [part_3.mcap, x.db3]}"
    )
    with logged("lists x.db3, which is not there"):
        assert len(read(tmp_path / "a", COLUMN, UNITS.get)[0].t) == 6
    (tmp_path / "a" / "metadata.yaml").write_text("[")
    with pytest.raises(BadInput, match=r"metadata\.yaml lists no files of a bag"):
        read(tmp_path / "a", COLUMN, UNITS.get)


def test_orientations_and_numbers_that_are_none_are_gaps(kinds, tmp_path):
    """Zeros, NaN, and -1 as the first covariance (Imu.msg); null in JSON; a frame twice in one message."""
    t, k = 0.1 * np.arange(20), kinds.kind
    yaw = 0.4 * t + 2.5  # over 180 degrees
    messages = []
    for n, (x, h) in enumerate(zip(t, yaw, strict=True)):
        q = kinds.quaternion(0.0, 0.0, np.sin(0.5 * h), np.cos(0.5 * h))
        q = {0: kinds.quaternion(0.0, 0.0, 0.0, 0.0), 8: kinds.quaternion(*[np.nan] * 4)}.get(n, q)
        covariance = np.array([-1.0 if n == 12 else 0.1, *[0.0] * 8])
        none = np.zeros(9)
        messages.append((x, k["Imu"](kinds.header(x), q, covariance, kinds.vector(), none, kinds.vector(), none)))
    file = write(tmp_path / "a", kinds, {"/imu": messages})
    with logged("3 of 20 have no orientation and are gaps"):
        (found,) = read(file, {"chassis.slip": "/imu.orientation.heading"}, lambda name: "rad")
    assert np.flatnonzero(np.isnan(found.values)).tolist() == [0, 8, 12]
    known = ~np.isnan(found.values)
    assert found.values[known] == pytest.approx(yaw[known], abs=1e-9)
    texts = {x: json.dumps({"v": None if x < 0.25 else x}).encode() for x in t}
    file = write_mcap(tmp_path / "b.mcap", ("/v", "json", ("V", "jsonschema", b"{}"), texts))
    with logged("."):
        assert read(file, {"chassis.slip": "/v"}, UNITS.get)[0].values == pytest.approx(t[3:])
    assert contents(file)["/v"]["numbers"] == ["/v.v"]
    frame = kinds.kind["TransformStamped"]
    moves = [
        (x, k["TFMessage"]([
            frame(kinds.header(x + dx, "odom"), "b", k["Transform"](kinds.vector(x + dx), kinds.quaternion()))
            for dx in (0.0, 0.05)
        ]))
        for x in t
    ]  # fmt: skip
    with logged("."):
        (found,) = read(
            write(tmp_path / "c", kinds, {"/tf": moves}),
            {"chassis.slip": "/tf.transforms[b].transform.translation.x"}, UNITS.get,
        )  # fmt: skip
    assert found.t == pytest.approx(found.values, abs=1e-9)
    assert len(found.t) == 40


def test_elements_have_numbers_or_names(kinds, tmp_path):
    """Two nodes publish their joints in one topic; transforms are named by their frames."""
    t = 0.1 * np.arange(6)
    joints = [(x, kinds.joints(x, *((["l", "r"], [x, -x]) if k % 2 else (["arm"], [9.0])))) for k, x in enumerate(t)]
    frame = kinds.kind["TransformStamped"]
    move = {name: kinds.kind["Transform"](kinds.vector(x), kinds.quaternion()) for name, x in (("a", 1.0), ("b", 2.0))}
    moves = [
        (x, kinds.kind["TFMessage"]([frame(kinds.header(x + 0.5, "odom"), name, move[name]) for name in order]))
        for x, order in zip(t, ("ab", "ba") * 3, strict=True)
    ]
    file = write(tmp_path / "a", kinds, {"/joints": joints, "/tf": moves})
    columns = {
        "chassis.speed": "/joints.velocity[r]", "chassis.force": "/joints.velocity[0]",
        "chassis.slip": "/tf.transforms[b].transform.translation.x",
    }  # fmt: skip
    columns["chassis.force"] = "/joints.velocity[arm]"
    right, arm, moved = read(file, columns, UNITS.get)
    assert right.t == pytest.approx(t[1::2], abs=1e-9)
    assert right.values == pytest.approx(-t[1::2])
    assert (arm.t.tolist(), set(arm.values)) == (pytest.approx(t[::2], abs=1e-9), {9.0})
    assert (set(moved.values), moved.t[0]) == ({2.0}, pytest.approx(0.5, abs=1e-9))
    listed = contents(file)
    assert listed["/joints"]["numbers"] == ["/joints.velocity[arm]"]
    assert "/tf.transforms[b].transform.rotation.heading" in listed["/tf"]["numbers"]
    texts = {x: json.dumps({"a": [1, 2, x], "on": True, "label": "x"}).encode() for x in t}
    file = write_mcap(tmp_path / "b.mcap", ("/x", "json", ("X", "jsonschema", b"{}"), texts))
    assert read(file, {"chassis.speed": "/x.a[2]:km/h"}, UNITS.get)[0].values == pytest.approx(t / 3.6)
    assert read(file, {"chassis.slip": "/x.on"}, UNITS.get)[0].values.tolist() == [1.0] * 6
    for column in ("/x.a", "/x.a[3]", "/x.label", "/x"):
        with pytest.raises(BadInput, match="has no number"):
            read(file, {"chassis.slip": column}, UNITS.get)


def test_quaternions_become_angles(kinds, tmp_path):
    """Heading beyond half a turn, nose down 0.2 rad, right side down 0.1 rad: q = q_z q_y q_x."""
    t, headings = 0.1 * np.arange(50), 0.15 * np.arange(50)
    (cp, sp), (cr, sr) = ((cos(a), sin(a)) for a in (0.1, 0.05))
    poses = []
    for x, h in zip(t, headings, strict=True):
        c, s = cos(0.5 * h), sin(0.5 * h)
        q = c * cp * sr - s * sp * cr, c * sp * cr + s * cp * sr, s * cp * cr - c * sp * sr, c * cp * cr + s * sp * sr
        poses.append((x, kinds.quaternion(*(2.0 * part for part in q))))  # of any length
    file = write(tmp_path / "a", kinds, {"/q": poses})
    names = {"chassis.slip": "/q.heading", "chassis.speed": "/q.pitch", "chassis.force": "/q.roll"}
    heading, pitch, roll = read(file, names, lambda name: "deg")
    assert heading.values == pytest.approx(np.degrees(headings), abs=1e-9)
    assert pitch.values == pytest.approx(np.full(50, np.degrees(0.2)), abs=1e-9)
    assert roll.values == pytest.approx(np.full(50, np.degrees(0.1)), abs=1e-9)
    assert not heading.assumed
    with pytest.raises(BadInput, match=r"'/q\.heading' of chassis\.speed"):
        read(file, {"chassis.speed": "/q.heading"}, UNITS.get)


def test_fixes_become_metres_from_the_first(kinds, tmp_path):
    """Radii of curvature of the ellipsoid of GPS at 48 degrees; two messages come before the first fix."""
    pytest.importorskip("pyproj")
    e2, a = 0.00669437999014, 6378137.0
    w = sqrt(1.0 - e2 * sin(radians(48.0)) ** 2)
    k, fix = kinds.kind, kinds.kind["NavSatFix"]
    places = [(0.0, 0.0), (0.0, 0.0), (48.0, 11.0), (48.0 + np.degrees(30.0 * w**3 / (a * (1.0 - e2))), 11.0)]
    places.append((48.0, 11.0 + np.degrees(-20.0 * w / (a * cos(radians(48.0))))))
    messages = [
        (0.1 * n, fix(kinds.header(0.1 * n), k["NavSatStatus"](0 if n > 1 else -1, 1), *place, 0.0, np.zeros(9), 0))
        for n, place in enumerate(places)
    ]
    file = write(tmp_path / "a", kinds, {"/fix": messages})
    east, north = read(file, {"chassis.slip": "/fix.east", "chassis.speed": "/fix.north"}, lambda name: "m")
    assert east.values[2:] == pytest.approx([0.0, 0.0, -20.0], abs=1e-4)
    assert north.values[2:] == pytest.approx([0.0, 30.0, 0.0], abs=1e-4)
    assert np.isnan([east.values[:2], north.values[:2]]).all()
    texts = {0.1 * n: json.dumps({"latitude": a, "longitude": b}).encode() for n, (a, b) in enumerate(places[2:])}
    bare = write_mcap(tmp_path / "b.mcap", ("/gps", "json", ("foxglove.LocationFix", "jsonschema", b"{}"), texts))
    (of_bare,) = read(bare, {"chassis.speed": "/gps.north"}, lambda name: "m")
    assert of_bare.values == pytest.approx(north.values[2:], abs=1e-9)


def test_a_drive_takes_a_column(kinds, tmp_path):
    """A factor makes a speed one of a sprocket, a start leaves out what was before."""
    t = 0.5 * np.arange(9)
    command = kinds.kind["Twist"]
    speeds = [(x, command(kinds.vector(0.2 * x), kinds.vector())) for x in t]
    write(tmp_path / "a", kinds, {"/cmd_vel": speeds, "/joints": [(x, kinds.joints(x, ["l"], [3.0])) for x in t]})
    table = {"drive": {"left": {"speed_points": "a:/cmd_vel.linear.x*1e+1@12e-1"}, "right": {}}, "driver": {}}
    table["drive"]["right"]["speed_points"] = "a/a.mcap:/joints.velocity[l]:rpm"
    table["driver"]["speed_points"] = "a/a.mcap:/cmd_vel.linear.x:km/h"
    read_files(table, tmp_path, "mine.toml")
    left, right = (np.array(table["drive"][side]["speed_points"]) for side in ("left", "right"))
    assert left == pytest.approx(np.stack([np.maximum(t[2:] - 1.2, 0.0), 2.0 * t[2:]], axis=1))
    assert right == pytest.approx(np.stack([t, np.full(9, 3.0 * 2.0 * np.pi / 60.0)], axis=1))
    assert np.array(table["driver"]["speed_points"])[:, 1] == pytest.approx(0.2 * t / 3.6)
    for text, told in (
        ("a", "name a column"),
        ("a:/cmd_vel.angular", "has no number"),
        ("a:/x", "has no topic of '/x'"),
    ):
        with pytest.raises(BadInput, match=rf"mine.toml: drive.speed_points = '\S+': \S+ ?{told}|{told}"):
            read_files({"drive": {"speed_points": text}}, tmp_path, "mine.toml")


def test_show_tells_how_points_go_on():
    given = {"speed.points": "0 1", "interpolation": "hold", "steering.torque.points": "0 1", "mode": "speed"}
    told = inventory._points(SimpleNamespace(parameters=given | {"steering.interpolation": "linear"}))
    assert told == ", speed holds from point to point, steering.torque is linear between points"


def test_commands_hold_and_measured_speeds_are_linear(kinds, tmp_path, monkeypatch):
    """By the type of their messages, where the scene does not say; points of a setting are no commands."""
    twist = kinds.kind["Twist"](kinds.vector(0.3), kinds.vector())
    stamped = kinds.kind["TwistStamped"](kinds.header(0.5), twist)
    measured = kinds.kind["TwistWithCovarianceStamped"](
        kinds.header(0.5), kinds.kind["TwistWithCovariance"](twist, np.zeros(36))
    )
    joints = kinds.joints(0.5, ["l"], [3.0])
    write(tmp_path / "a", kinds, {"/c": [(0.5, twist)], "/s": [(0.5, stamped)], "/m": [(0.5, measured)],
                                  "/j": [(0.5, joints)]})  # fmt: skip
    columns = {"/c.linear.x": "hold", "/s.twist.linear.x*2@0.1": "hold", "/m.twist.twist.linear.x": "linear",
               "/j.velocity[l]": "linear"}  # fmt: skip
    monkeypatch.chdir(tmp_path)
    for column, way in columns.items():
        asked = [f"drive.speed_points='a:{column}'"]
        assert load("straight", "rigid", asked).drive.interpolation == way
        assert load("straight", "rigid", [*asked, "drive.interpolation='linear'"]).drive.interpolation == "linear"
    drive = {"mode": "speed", "speed_points": "a:/c.linear.x"}
    Path("of_bag.toml").write_text(toml_lines({**read_scene("straight")[1], "drive": drive}))
    scene = load("of_bag.toml")
    assert scene.resolved()["drive"]["interpolation"] == "hold"
    assert load("of_bag.toml", None, ["drive.speed_points=[[0, 1]]"]).drive.interpolation == "linear"
    one_side = load("of_bag.toml", None, ["drive.left.speed_points=[[0, 1]]"]).drive
    assert (one_side.left.interpolation, one_side.right.interpolation) == ("linear", "hold")
    both = load("straight", None, ["drive={interpolation='hold', left={speed_points=[[0, 1]]}}"]).drive
    assert both.left.interpolation == "hold"
    Path("again.toml").write_text(scene_text("of_bag.toml"))
    assert {**load("again.toml").resolved(), "name": "of_bag"} == scene.resolved()
    with pytest.raises(BadInput, match="drive has commands beside other points: interpolation = says how they go on"):
        load("of_bag.toml", None, ["drive.mode='controller'", "drive.brake_points=[[0, 1]]"])
    with pytest.raises(BadInput, match="interpolation = 'hold' needs speed_points or needs torque_points or needs"):
        load("straight", None, ["drive.interpolation='hold'"])


def test_what_is_not_asked_for_is_not_unpacked(tmp_path):
    """Another topic has no definition, and its chunks are damaged; in the same chunks the damage is told."""
    texts = {t: b'{"v": 1.0}' for t in (0.0, 0.1)}
    images = {t: bytes(40_000) for t in (1.0, 1.1)}
    for size, is_read in ((20_000, True), (1 << 20, False)):
        channels = ("/image", "cdr", None, images), ("/v", "json", ("V", "jsonschema", b"{}"), texts)
        file = write_mcap(tmp_path / "a.mcap", *channels, chunk_size=size, compression=0)
        content = bytearray(file.read_bytes())
        content[content.index(bytes(40_000)) + 20_000] = 1
        file.write_bytes(content)
        if is_read:
            assert read(file, {"chassis.slip": "/v"}, UNITS.get)[0].values.tolist() == [1.0, 1.0]
        else:
            with pytest.raises(LogUnreadable, match="is damaged") as told:
                read(file, {"chassis.slip": "/v"}, UNITS.get)
            assert "recover" not in str(told.value)


def test_a_database_without_definitions_has_those_of_humble(run, kinds, tmp_path):
    file = write(tmp_path / "a", kinds, odometry(kinds), "SQLITE3")
    for kind in ("nav_msgs/msg/Odometry", "their_msgs/msg/Odometry"):
        base = sqlite3.connect(file)
        with base:
            base.execute("DELETE FROM message_definitions")
            base.execute("UPDATE topics SET type = ?", (kind,))
        base.close()
        if kind.startswith("nav"):
            with logged("Humble"):
                assert read(file.parent, COLUMN, UNITS.get)[0].values == pytest.approx(V_TEST, abs=1e-12)
        else:
            with pytest.raises(BadInput, match="no definition of its type 'their_msgs/msg/Odometry'"):
                read(file, COLUMN, UNITS.get)


FLOATS = {t: struct.pack("<Id", 256, t) for t in (0.0, 0.1, 0.2)}
FLOAT = "std_msgs/msg/Float64", "ros2msg", b"float64 data"
CHANNELS = {
    "/whole": ("cdr", FLOAT, FLOATS),
    "/idl": ("cdr", ("a/msg/B", "ros2idl", b"module a { module msg { struct B { double data; }; }; };"), FLOATS),
    "/none": ("cdr", ("a/msg/B", "ros2msg", b""), FLOATS),
    "/part": ("cdr", ("a/msg/B", "ros2msg", b"c/Inner data"), FLOATS),
    "/text": ("cdr", ("std_msgs/msg/String", "ros2msg", b"string data"), {0.0: b"\0\1\0\0\2\0\0\0a\0"}),
    "/short": ("cdr", FLOAT, {0.0: b"\0\1\0\0\1"}),
    "/proto": ("protobuf", ("a.B", "protobuf", b""), FLOATS),
    "/long": ("cdr", ("a/msg/B", "ros2msg", b"string[20000] data"), FLOATS),
    "/open": ("json", ("a", "jsonschema", b"{}"), {0.0: b'{"v": '}),
    "/empty": ("cdr", FLOAT, {}),
}
FAULTS = {
    "/none": "is not read: the file has no definition of its type 'a/msg/B'",
    "/part": "is not read: the file has no definition of its type 'c/msg/Inner'",
    "/text.data": "has no number '/text.data': /text has no numbers",
    "/short": "cannot be read: Could not deserialize 'std_msgs/msg/Float64'",
    "/proto": "its messages are 'protobuf', and cdr, ros1 and json are read",
    "/long": "its type has an array of a fixed size of 10000 or more",
    "/open.v": "cannot be read: Expecting value",
    "/empty.data": "has no number '/empty.data': /empty has no messages",
    "/else": "has no topic of '/else': it has /empty, /idl, ",
}


def test_what_is_not_read_is_one_sentence(run, cotrack, tmp_path):
    pytest.importorskip("rosbags")
    write_mcap(tmp_path / "a.mcap", *((topic, *about) for topic, about in CHANNELS.items()))
    for column, told in FAULTS.items():
        status, out, err = cotrack("compare", run.log, "a.mcap", "--map", f"chassis.speed={column}")
        assert (status, out, err.count("\n")) == (2, "", 1), err
        assert told in err
    for column in ("/whole", "/idl.data"):
        assert "0.2" in cotrack.done("compare", run.log, "a.mcap", "--map", f"chassis.speed={column}")
    out = cotrack.done("log", "info", "a.mcap")
    assert (
        "/whole: std_msgs/msg/Float64, cdr, 3 messages; 10 Hz, received 0 to 0.2 s, no header.stamp\n  .data\n" in out
    )
    assert "/empty: std_msgs/msg/Float64, cdr, 0 messages\n  no numbers\n" in out
    assert out.endswith("beside a run: cotrack plot RUN.mcap SIGNAL --with a.mcap --map SIGNAL=/whole.data\n")
    topics = json.loads(cotrack.done("log", "info", "a.mcap", "--json"))["topics"]
    assert {topic for topic, one in topics.items() if one["fault"]} == {
        "/none",
        "/part",
        "/short",
        "/proto",
        "/long",
        "/open",
    }


def test_a_robot_at_rest_is_read(tmp_path):
    """Messages that compress to a byte each, and constants of a type, which are no columns."""
    about = "std_msgs/msg/Float64", "ros2msg", b"float64 data\nuint8 KIND=3"
    pytest.importorskip("rosbags")
    messages = {1e-3 * k: struct.pack("<Id", 256, 2.0) for k in range(20_000)}
    file = write_mcap(tmp_path / "a.mcap", ("/v", "cdr", about, messages))
    assert file.stat().st_size < 500_000
    with logged("."):
        assert set(read(file, {"chassis.slip": "/v"}, UNITS.get)[0].values) == {2.0}
    assert contents(file)["/v"]["numbers"] == ["/v.data"]


def test_a_database_whose_path_means_another_one_is_refused(run, kinds, tmp_path):
    """rosbags opens ``run1.db3`` for ``run%31.db3``."""
    file = write(tmp_path / "a", kinds, odometry(kinds), "SQLITE3")
    for name in ("run1.db3", "run%31.db3"):
        shutil.copy(file, tmp_path / name)
    with logged("."):
        read(tmp_path / "run1.db3", COLUMN, UNITS.get)
    with pytest.raises(BadInput, match="rename it"):
        read(tmp_path / "run%31.db3", COLUMN, UNITS.get)


@pytest.mark.parametrize("kind", ["mcap", "db3", "bag"])
def test_a_bag_that_was_cut_off_is_one_sentence(run, kinds, cotrack, tmp_path, kind):
    if kind == "bag":
        file = write_ros1(tmp_path / "m.bag", odometry)
    else:
        file = write(tmp_path / "m", kinds, odometry(kinds), {"mcap": "MCAP", "db3": "SQLITE3"}[kind])
    content = file.read_bytes()
    for kept in (len(content) - 30 * (kind == "mcap") - 5000 * (kind != "mcap"), len(content) // 2):
        file.write_bytes(content[:kept])
        for command in (
            ("compare", run.log, file, "--map", "chassis.speed=/odom.twist.twist.linear.x"),
            ("log", "info", file),
        ):
            status, out, err = cotrack(*command)
            assert (status, out, err.count("\n")) == (2, "", 1), (kept, err)
            assert err.startswith(f"cotrack: {file}") or f"the log {file}" in err, err
