"""Sentences of logs and of files beside a run: what causes each, and its essential part; other tests hold kinds alone.

``...`` in a sentence stands for any text.
"""

import json
import re
import struct
import sys
import zipfile

import numpy as np
import pytest
import rasterio
from foreign_drive import brake_fmu, braked, changed, rig
from foreign_fmus import UNITS as SI
from gain_fmus import gain_fmu, in_unit, with_maximum, with_units
from mcap.writer import Writer
from measured_files import (
    SPEED,
    UNITS,
    T,
    measured_run,
    over_angle,
    scaled,
    signal,
    waveform,
    write,
    write_mf4,
    write_tdms,
)
from mutated import Content, altered
from rasterio.transform import Affine
from recorded import STEP, chunked_log, disk, small_log, spans
from rewritten_logs import rewritten, sealed_log
from short_runs import RIG, chain_log, rig_log, simulated
from ssd_texts import MILLIMETRES, bound, component, connection, connectors, document, packed, system, values
from survey_files import ROWS, SURFACE, asc, crg, gap, read_map, tif
from wired_logs import TOPICS as WIRED
from wired_logs import WIRES

from orchestrator.execution import replay_model
from orchestrator.execution.resume import branched_scene, resume
from orchestrator.execution.simulate import simulate
from orchestrator.files import budget
from orchestrator.files.columns import csv_lines
from orchestrator.log import measured_formats, schema
from orchestrator.log.export import export, to_arrow, to_pandas
from orchestrator.log.log_metadata import FORMAT
from orchestrator.log.message_records import PREFIX
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.log.tools import recover, verify
from orchestrator.results.measured_record import read
from orchestrator.scene import survey_files
from orchestrator.scene.assembly import assemble
from orchestrator.scene.scene import load
from orchestrator.scene.ssp_scene import load_ssp

MADE = {
    "small": small_log, "chunked": chunked_log, "sealed": sealed_log, "chain": chain_log, "rigged": rig_log,
    "run": measured_run, "gain": gain_fmu, "brake": brake_fmu,
}  # fmt: skip
small, chunked, sealed, chain, rigged, run, gain, brake = (
    pytest.fixture(scope="module", name=name)(make) for name, make in MADE.items()
)


class Given:
    """Fixtures by name, and the folder ``p`` of a test."""

    def __init__(self, request):
        self._request = request

    def __getattr__(self, name):
        return self._request.getfixturevalue("tmp_path" if name == "p" else name)


def told(given, cause):
    """Answer of a cause, its error, or the sentences of a verdict, as text."""
    try:
        answer = cause(given)
    except (ValueError, LookupError, RuntimeError, OSError) as refusal:
        return str(refusal).replace("\n", "TWO LINES")
    return answer if isinstance(answer, str) else "\n".join(answer.sentences)


def cause(act):
    """Let a function of what is given and more be called with the rest alone."""
    return lambda *more, **named: lambda g: act(g, *more, **named)


@cause
def refused(g, *words):
    """Sentence of a command about logs by kind, a measured record and an FMU."""
    (g.p / "m.csv").write_text("t,v\n5,1\n5.5,2\n")
    files = {"CHAIN": lambda: g.chain, "RIG": lambda: g.rigged, "RUN": lambda: g.run.log, "FMU": lambda: g.drive}
    for key, file in files.items():
        words = [word.replace(key, str(file())) if key in word else word for word in words]
    return g.cotrack.refused(*words)


def after(*begin):
    return lambda *words: refused(*begin, *words)


# --- logs: what they do not hold, damage, what cannot be recorded ------------------------------------


def opened(path, ask):
    with Log(path, unfinished=True) as log:
        ask(log)


def look(path):
    opened(path, str)


def asked(ask):
    return lambda g: opened(g.small, ask)


@cause
def described(g, ask, content=b"", **topics):
    """A log of a vehicle or a track alone is asked for a signal."""
    names = topics or {"chassis": ("turning.z", "yaw", "tension.min", "tension.max", "x")}
    about = {f"/{one}/{'links' if topics else 'out'}": [(name, "1") for name in own] for one, own in names.items()}
    with Recorder(g.p / "a.mcap", about, {"chassis.modelDescription.xml": content}, {}) as recorder:
        recorder.close("ok", "", 0)
    opened(g.p / "a.mcap", lambda log: log.signal(ask))


XML = b'<m><ScalarVariable name="turning.z" description="Its yaw rate, world"/></m>'
FORCE = {"track": (*(f"joint[4].force.{axis}" for axis in "xyz"), "joint[4].force_peak")}


@cause
def file_of(g, content, ask=look):
    (g.p / "a.mcap").write_bytes(content)
    return ask(g.p / "a.mcap")


@cause
def edited(g, change, ask=verify, old_seal=False, kind="small"):
    """A content is changed, and all checksums are made again."""
    content = Content(getattr(g, kind))
    change(content)
    return ask(content.write(g.p / "edited.mcap", old_seal=old_seal))


@cause
def changed_bytes(g, change, ask=verify):
    (g.p / "bad.mcap").write_bytes(change(g.chunked.read_bytes()))
    return ask(g.p / "bad.mcap")


def flipped(data, at):
    return data[:at] + bytes([data[at] ^ 4]) + data[at + 1 :]


def without_chunk(data):
    begin, end, *_ = spans(data)[1]
    return data[:begin] + data[end:]


def seal_of(kind, name, made):
    """A content is changed by other software."""

    def change(of, named, content):
        return made(content) if (of, named) == (kind, name) else content

    return lambda g: verify(rewritten(g.sealed, g.p / "edited.mcap", change=change))


def topic_rows(change):
    def made(content):
        number, rows, times = content.chunks[0][0]
        content.chunks[0][0] = number, *change(rows, times)
        content.hash_again()

    return made


def later(rows):
    """Records that say another time than their messages."""
    rows = rows.copy()
    rows[:, 15] ^= 1
    return rows


def nameless(content):
    next(iter(content.channels.values()))[2]["names"] = "[]"


def read_first(path):
    opened(path, lambda log: log.read(next(iter(log.topics))))


def negative(content):
    content.chunks[0][0][1][0, PREFIX + 1 : PREFIX + 9] = list(np.float64(-1.0).tobytes())
    del content.metadata["closing"]


def unconnected(g, topics=WIRED):
    ways = [("a", ["x", "z"], "b", ["x", "y"]), ("b", ["f", "g"], "a", ["f", "g"]), ("a", ["z"], "a", ["w"])]
    keys = "source", "outputs", "target", "inputs"
    connections = [dict(zip(keys, one, strict=True)) for one in ways]
    table = {"instances": [{"name": "a"}, {"name": "b"}], "connections": connections}
    with Recorder(g.p / "a", topics, {"system.json": json.dumps(table).encode()}, {}, wires=WIRES) as log:
        log.close("ok", "", 0)
    return verify(g.p / "a")


@cause
def bag(g, kept, ask):
    """A file of other software, whole or cut off."""
    file = g.p / "bag.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream, chunk_size=500)
        writer.start(profile="ros2", library="libmcap 1.2")
        for k in range(7):
            kind = writer.register_schema("std_msgs/msg/Float64", "ros2msg", b"float64 data")
            channel = writer.register_channel(f"/wheel{k}/speed", "cdr", kind)
            for t in range(0, 10**9, 10**7):
                writer.add_message(channel, t, struct.pack("<Id", 256, 1.0), t)
        writer.finish()
    file.write_bytes(file.read_bytes()[: int(kept * file.stat().st_size)])
    return ask(file)


BAG = (
    "is an MCAP file of other software, no log of cotrack; 'cotrack log info' lists its numbers, which serve as"
    " measured data: profile 'ros2', library 'libmcap 1.2', topics /wheel0/speed (std_msgs/msg/Float64, cdr), "
)


@cause
def recording(g, *ask, topics=None, **options):
    """A recorder is opened and asked; ``ask``: arguments of ``write``."""
    about = topics or {"/a/out": [("x", "m"), ("y", "m")]}
    with Recorder(g.p / "a.mcap", about, {}, {}, **options) as recorder:
        if not ask:
            recorder.close("ok", "", 0)
        recorder.write("/a/out", *(ask or (0, 0.0, 0.1, np.zeros(2))))


@cause
def joined(g, *arrays):
    topics = {"/a/out": [("x", "m")], "/b/out": [("y", "m"), ("z", "m")]}
    with Recorder(g.p / "a.mcap", topics, {}, {}) as recorder:
        recorder.write(recorder.join_topics([], [*topics]), 0, 0.0, STEP, *arrays)


def on_a_full_disk(g):
    with disk(0):
        Recorder(g.p / "a.mcap", {}, {}, {})


def onto(g, name, ask=lambda path: Recorder(path, {}, {}, {})):
    (g.p / "file").write_text("no log")
    ask(g.p / name)


@cause
def missing(g, library, ask):
    """A library is not installed."""
    g.monkeypatch.setitem(sys.modules, library, None)
    return ask(g)


PICTURE = ("chassis.speed", "left_track.link[1].tension")


@cause
def closed(g, ask, *status):
    with Recorder(g.p / "a.mcap", {"/a/out": [("x", "m")]} if status else {}, {}, {}) as recorder:
        recorder.close(*(status or ("ok", "", 0)))
    return ask(g.p / "a.mcap")


LOGS = (
    (asked(lambda log: log.signal("chassis.sped")), "has no signal 'chassis.sped'; did you mean 'chassis.speed'?"),
    (asked(lambda log: log.read("/chassis/outs")), "has no topic '/chassis/outs'; did you mean '/chassis/out'"),
    (asked(lambda log: log.select({"/left/out": [0]})), "has no topic '/left/out'"),
    (asked(lambda log: log.attachment("scene.toml")), "has no attachment"),
    (described("chassis.yaw_rate", XML), "'chassis.yaw_rate'; did you mean 'chassis.turning.z'?"),
    (described("chassis.yaw_rate", XML[:-1]), "did you mean 'chassis.yaw'?"),
    (described("chassis.yaw_rate"), "did you mean 'chassis.yaw'?"),
    (described("tension"), "did you mean 'chassis.tension.min' or 'chassis.tension.max'"),
    (described("track.joint[4].force", **FORCE), "it has the components .x, .y, .z; 'track.joint[4].force.*'"),
    (file_of(b""), "is not a log"), (file_of(b"t,x\n0,1\n"), "is not a log"),
    (file_of(b"\x89MCAP1\r\n" * 9), "is not a log"),
    (lambda g: opened(g.p / "none.mcap", str), "the log ... cannot be read: no such file or directory"),
    (edited(lambda content: content.metadata.update({FORMAT: {"version": "3"}}), look),
     "edited.mcap has format 3 of a newer cotrack: this one reads formats 1 to 2"),
    (lambda g: verify(g.small), "is whole: 5 topics, 425 messages, 100 steps\nthe run ended with status ok\nseal "),
    (closed(verify, "failed", "Newton did not converge at t = 0.3 s", 0), "status failed: Newton did not"),
    (changed_bytes(lambda data: flipped(data, spans(data)[1][0] + 100)), "the chunk at byte ... is damaged ("),
    (changed_bytes(lambda data: flipped(data, data.index(b"<fmiModel"))), "attachment 'chassis.modelDescription.xml'"),
    (changed_bytes(lambda data: flipped(data, len(data) - 40)), "the checksum over the indexes does not hold"),
    (changed_bytes(lambda data: data[: len(data) // 2]), "was cut off at byte ...the run was cut off"),
    (changed_bytes(lambda data: data[:-9]), "the end of the file is missing or damaged"),
    (changed_bytes(without_chunk), "/chassis/out: step ... 1501 were recorded"),
    (changed_bytes(lambda data: data.replace(b"small", b"smell", 1), lambda path: recover(path, path.with_name("b"))),
     "holds all ... messages, but names or metadata may be damaged"),
    (changed_bytes(lambda data: data[:60_000], lambda path: recover(path, path.with_name("b"))),
     "b holds ... messages, to t = ... s; the rest is lost\nsealed anew; ...bad.mcap had no seal"),
    (changed_bytes(lambda data: data[:100], lambda path: recover(path, path.with_name("b"))), "nothing could be"),
    (edited(negative, lambda path: recover(path, path.with_name("saved.mcap"))), "cannot be recorded at t = -1"),
    (edited(lambda content: content.metadata["closing"].update(warnings="7")), "is cut off or damaged"),
    (edited(topic_rows(lambda rows, t: (np.repeat(rows, 2, axis=0), np.repeat(t, 2))), read_first), "are not in"),
    (edited(topic_rows(lambda rows, t: (later(rows), t))), "times of records and messages differ near t = 0 s"),
    (edited(nameless), "is cut off or damaged"),
    (edited(lambda content: content.attachments.update({"system.json": b"7"})), "'system.json' is no JSON object"),
    (unconnected, "takes 'y' from 'y' of /a/out, which system.json does not connect"),
    (lambda g: unconnected(g, {one: about for one, about in WIRED.items() if one != "/b/out"}),
     "/a/in is wired to /b/out, which lacks what it needs"),
    (bag(1.0, look), BAG), (bag(0.6, look), BAG),
    (bag(1.0, verify), BAG), (bag(0.6, lambda path: recover(path, path.with_name("b"))), BAG),
    (seal_of("attachment", "scene.json", bytes.upper), "is not as it was sealed: the attachment 'scene.json' is"),
    (seal_of("attachment", "scene.json", lambda _: None), "the attachment 'scene.json' is missing"),
    (seal_of("attachment", "note.txt", lambda _: b"x"), "the attachment 'note.txt' is added"),
    (seal_of("metadata", "run", lambda entries: entries | {"step": "1"}), "the record 'run' is changed"),
    (seal_of("metadata", "run", lambda _: None), "the record 'run' is missing"),
    (seal_of("metadata", "closing", lambda entries: entries | {"status": "perfect"}), "its closing record is changed"),
    (seal_of("metadata", "closing", lambda entries: {k: v for k, v in entries.items() if k != "seal"}), "has lost"),
    (seal_of("message", "/chassis/out", lambda data: flipped(data, len(data) - 3)), "the record of /chassis/out is"),
    (seal_of("message", "/events", lambda data: data.replace(b"lifts", b"drops")), "the text of /events is changed"),
    (seal_of("channel", "/chassis/out", lambda about: about | {"a": "b"}), "the description of /chassis/out is"),
    (recording(topics={"/a/out": [("x", "m"), ("x", "m")]}), "listed twice"),
    (recording(every={"/a/out": 0}), "every 0"),
    (recording(0, 0.0, 0.1, np.zeros(1)), "has 2 variables, not 1"),
    (joined(np.zeros(1), np.zeros(1)), "/b/out has 2 variables, not 1"),
    (recording(0, -0.1, 0.1, np.zeros(2)), "begins at 0"),
    (recording(), "is closed"),
    (lambda g: schema.layout([f"x{i}" for i in range(8001)]), "holds 8000 variables and families, not 8001"),
    (on_a_full_disk, "the log ...a.mcap cannot be written: file too large"),
    (lambda g: onto(g, "file/a.mcap"), "the log ...file/a.mcap cannot be written: "),
    (lambda g: onto(g, "."), "it is a directory"), (lambda g: onto(g, "file"), "there is a file that is no log"),
    (lambda g: Recorder("/dev/null", {}, {}, {}), "it is a device or a pipe, which cannot be read again"),
    (lambda g: export(g.small, g.p, ["chassis.sped"]), "did you mean 'chassis.speed'"),
    (lambda g: export(g.small, g.p, topics=["/chassis/inn"]), "has no topic"),
    (lambda g: export(g.small, g.p / "a.csv", PICTURE), "recorded at different times"),
    (lambda g: opened(g.small, lambda log: to_pandas(log, *PICTURE)), "recorded at different times"),
    (lambda g: onto(g, "file/a.csv", lambda path: export(g.small, path, ["chassis.speed"])), "cannot be written"),
    (closed(lambda path: export(path, path.with_name("csv"))), "holds nothing to export"),
    (missing("pyarrow", lambda g: opened(g.small, lambda log: to_arrow(log, "chassis.speed"))),
     "pyarrow is not installed: pip install -c constraints.txt -e '.[analysis]' in the clone"),
)  # fmt: skip


# --- replays and resumptions -------------------------------------------------------------------------


@cause
def replayed(g, change, *options):
    """A log with another system.json or scene.json is replayed."""
    replay_model.open_replay(altered(g.chain, g.p / "forged.mcap", change), "chain", None).__enter__()


def first(**change):
    return replayed(lambda system, scene: system["instances"][0].update(change))


replay, resumed = after("replay", "CHAIN", "--component", "chain"), after("resume", "RIG", "-o", "new.mcap")


def another_build(g):
    content = Content(g.rigged)
    table = json.loads(content.attachments["system.json"])
    table["instances"][0]["sha256"] = "0" * 64
    content.attachments["system.json"] = json.dumps(table).encode()
    resume(content.write(g.p / "other.mcap"), g.p / "new.mcap")


def without_checkpoints(g):
    log = simulated(g.p / "none.mcap", "rig", "rigid", *RIG, "run.checkpoints=false")
    resume(log, g.p / "new.mcap")


def another_size(g):
    short = ("run.stop=0.02", "run.checkpoints=0.01", "chain.links=8", "expect={}")
    chain = simulated(g.p / "chain.mcap", "hanging_chain", "flexible", *short)
    resume(chain, g.p / "new.mcap", 0.01, settings=["chain.links=9"])


def branch(name, setting):
    return lambda g: branched_scene(load(name), [setting], "scene.json")


REPLAYS_AND_RESUMPTIONS = (
    (replayed(lambda system, scene: system.update(instances=7)), "system.json: instances = 7"),
    (replayed(lambda system, scene: system["instances"].append(system["instances"][0])), "two instances have one name"),
    (first(name="track"), "no component 'chain': one of track"),
    (replayed(lambda system, scene: system["instances"][0].pop("sha256")), "was stepped without an FMU"),
    (first(parameters={"x": 10**400}), "parameters"),
    (first(sha256="0" * 64), "another build of 'TrackFlexible.fmu': name an FMU with --with"),
    (replayed(lambda system, scene: scene.update(vehicle="/etc/passwd")), "scene.json: vehicle = '/etc/passwd'"),
    (replayed(lambda system, scene: scene["run"].update(step=10**400)), f"run.step = {str(10**400)[:5]}"),
    (replayed(lambda system, scene: scene.update(assembly=["x"])), "assembly = ['x']"),
    (replayed(lambda system, scene: scene.clear()), "assembly = None"),
    (refused("replay", "CHAIN", "--component", "left_track"), "no component 'left_track'"),
    (replay("--with", "none.fmu"), "no FMU 'none.fmu'"),
    (replay("--set", "vehicle.gravitty=1"), "unknown key 'vehicle.gravitty'"),
    (replay("--set", "vehicle.gravity"), "must be KEY=VALUE"),
    (replay("--set", "vehicle.gravity=10", "--with", "mine.fmu"), "says nothing about --with mine.fmu"),
    (replay("--set", "vehicle.gravity=10", "--from", "9"), "from 9 to inf: the run is recorded from 0 to 0.02 s"),
    (replay("--with", "rigid", "--picture", "x.nothing"), "x.nothing"),
    (resumed("--at", "0.01"), "--at 0.01: the first checkpoint of ... is at 0.02 s"),
    (resumed("--stop", "0.02"), "stop = 0.02 s is before the checkpoint at 0.06 s"),
    (resumed("--stop", "0.0705"), "must be a multiple of step"),
    (refused("resume", "RIG", "-o", "RIG"), "cannot be written: it is a file that is read"),
    (without_checkpoints, "has no checkpoint to go on from"), (another_build, "made by another build of 'TrackRigid"),
    (another_size, "with --set chain.links=9 the state of 'chain' has another size"),
    (resumed("--set", "run.step=0.5 ms"), "run.step stays as it is"),
    (resumed("--set", "run.links=1"), "run.links stays as it is"),
    (resumed("--set", "track.link_outputs=all"), "track.link_outputs stays as it is"),
    (resumed("--set", "idler_drive.mode=speed"), "idler_drive.mode stays as it is"),
    (branch("climb", "ground.grade=0.3"), "ground.grade stays as it is: the states of the parts count from the place"),
    (branch("soft_ground", "start.position=[1, 0, 0]"), "start.position stays as it is: the states of the parts count"),
)  # fmt: skip


# --- measured records --------------------------------------------------------------------------------


@cause
def csv(g, text, column="v", clock=None):
    (g.p / "m.csv").write_bytes(text.encode("latin-1") if "\xb0" in text else text.encode())
    read(g.p / "m.csv", {"chassis.speed": column}, UNITS.get, clock)


def named(file, content):
    return lambda g: read((g.p / file, (g.p / file).write_bytes(content))[0], {"chassis.speed": "v"}, UNITS.get)


@cause
def compared(g, columns, t=0.0, v=SPEED, **options):
    columns_of = zip((T + t).tolist(), np.broadcast_to(v, T.shape).tolist(), strict=True)
    rows = "\n".join(f"{a!r},{b!r}" for a, b in columns_of)
    (g.p / "m.csv").write_text(f"t,v\n{rows}\n")
    g.run.compare_measured(g.p / "m.csv", columns, **options)


@cause
def parquet(g, columns, column="v", clock=None):
    arrow, tables = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    tables.write_table(arrow.table(columns), g.p / "m.parquet")
    read(g.p / "m.parquet", {"chassis.speed": column}, UNITS.get, clock)


@cause
def mdf(g, *groups, column="v"):
    """Groups: a name, and names of channels with numbers, or signals."""
    t = np.arange(3.0)
    made = [(name, [one() if callable(one) else signal(one, t, t, "m/s") for one in own]) for name, own in groups]
    write_mf4(g.p / "m.mf4", made)
    read(g.p / "m.mf4", {"chassis.speed": column}, UNITS.get)


def letters():
    return signal("s", np.arange(3.0), np.array([b"a", b"b", b"c"]), "", encoding="utf-8")


def old_mdf(g):
    with pytest.importorskip("asammdf").MDF(version="3.30") as file:
        file.append([signal("v", np.arange(3.0), np.arange(3.0), "m/s")])
        file.save(g.p / "old.mdf", overwrite=True)
    read(g.p / "old.mdf", {"chassis.speed": "v"}, UNITS.get)


@cause
def tdms(g, *segments, columns=None, clock=None):
    """Segments of channels: group, name, values, properties."""
    write_tdms(g.p / "m.tdms", segments)
    read(g.p / "m.tdms", columns or {"chassis.speed": "v"}, UNITS.get, clock)


@cause
def limited(g, kind, key, most):
    file = write(g.p / f"m.{kind}", 5.0 * STEP * np.arange(301), np.arange(301.0))
    g.monkeypatch.setattr(measured_formats, key, most)
    read(file, {"chassis.speed": "v"}, UNITS.get)


@cause
def lines_of(g, most, lines, text="t\tv\n\n1\t2\n"):
    (g.p / "a.csv").write_text(text)
    [*csv_lines(g.p / "a.csv", most, lines)]


MAP, options = ("--map", "chassis.speed=v"), after("compare", "RUN", "m.csv")
EARLY = "m.csv, line 2: 't' must be a number or empty, not "
NT = 0.01 * np.arange(4)
DATE = np.datetime64("2026-11-28T10:00:00")
V, W = waveform(NT, "m/s", wf_start_time=DATE), waveform(NT, "m/s")


def again(**change):
    return tdms([("g", "v", NT, V)], [("g", "v", NT, V | change)])


def untold(g):
    """Properties that are not as National Instruments describes them are not guessed."""
    g.monkeypatch.setattr(measured_formats, "segment_properties", lambda stream: {})
    tdms([("g", "v", NT, W)])(g)


MEASURED_RECORDS = (
    (csv("t,v\n0,1\n", "w"), "m.csv has no column 'w': it has t, v"), (csv(""), "m.csv has no column 'v': it has none"),
    (csv("v,F\n0,1\n"), "m.csv has no column 't' or 'time', its first line names v, F: clock = COLUMN names the time"),
    (csv("t,v [km/h],v [m/s]\n0,1,1\n"), "m.csv has 2 columns 'v': name one as in the file, of 'v [km/h]', "),
    (csv("t,v [kN]\n0,1\n"), "m.csv: column 'v' of chassis.speed: 'kN' does not convert to m/s"),
    (csv("t,v\n0,1\n", "v:knts"), "m.csv: column 'v' of chassis.speed: 'knts' is no known unit: did you mean 'knots'"),
    (csv("t,v\n0,1\n1,abc\n"), "m.csv, line 3: 'v' must be a number or empty, not 'abc'"),
    (csv("t;v\n0;1,5\n"), "m.csv, line 2: 'v' must be a number or empty, not '1,5'; decimals have a point: 0;1.5"),
    (csv("t,v\ns,km/h\n0,1\n"), f"{EARLY}'s'; units belong into the first line, without a line of their own: t [s],v"),
    (csv("t,v,n\n[s],[km/h],1/min\n0,3.6,0\n"), f"{EARLY}'[s]'; units belong ...: t [s],v [km/h],n [1/min]"),
    (csv("t [kg],v\n0,1\n"), "m.csv: column 't': 'kg' does not convert to s"),
    (csv("t,v\n0,\n0.5,nan\n"), "m.csv: column 'v' holds no number"),
    (csv("t,v\n0,1\n\n1\n"), "m.csv, line 4: there are 1 cells, and none for 'v'"),
    (csv("t,v\n0,1\n2,1\n\n1.5,1\n"), "m.csv, line 5: the clock 't' must increase: 1.5 s after 2 s"),
    (csv("t,v\n0,1\n0,1\n"), "m.csv, line 3: the clock 't' must increase: 0 s after 0 s"),
    (csv("t,v\n0,1\n,1\n"), "m.csv, line 3: the clock 't' must be a number below 1e+12 s"),
    (csv("t,v\n"), "m.csv holds no line of numbers below its header"),
    (csv("t;v [km/h]\n0,0;3,6\n"), f"{EARLY}'0,0'; decimals have a point: 0.0;3.6"),
    (csv("t,v [km/h]\n0,0,3,6\n"), "m.csv, line 2: there are 4 cells, and 2 columns; decimals have a point: 0.0,3.6"),
    (csv("t,v [km/h]\n0,3,6\n"), "line 2: there are 3 cells, and 2 columns; ... a cell that holds a comma quotes"),
    (csv("Logger 7, of the bench\nrate;100\n\nt [s];v [km/h]\n0;3.6\n"),
     "has no column 'v': it has Logger 7, of the bench; line 4 names all that is asked for: delete the lines above it"),
    (csv("t,v [km/h]\n2026-11-28T00:00:00.000Z,3.6\n"), f"{EARLY}'2026-...; a clock counts seconds, ...day: 0,3.6"),
    (csv("t;v\n28.11.2026 10:01:02,5;1\n"), "of the day: 36062.5;1"),
    (csv("t,v\n0,1\n1,1\n2,1\nend\n"), "m.csv, line 5: 't' must be a number or empty, not 'end'"),
    (csv("t [s],v [km/h],\xb0\n0,3.6,1\n"), "m.csv cannot be read: it is no text in UTF-8 (byte 0xb0 at 15): save"),
    (csv("t [s],v\n0,1_000\n"), "line 2: 'v' must be a number or empty, not '1_000'"),
    (csv("t [s],v\n0,\u0661\u0662\n"), "line 2: 'v' must be a number or empty, not '\u0661\u0662'"),
    (csv('t [s],v\n0,"1.5\n'), "line 2: a quote does not end with its cell"),
    (csv('t [s],v\n0,"1"5\n'), "line 2: a quote does not end with its cell"),
    (csv("t,v\n0,1\n10,1\n20,1\n"), "the clock 't' counts whole numbers, of s or ms: clock = COLUMN:s or COLUMN:ms"),
    (lambda g: read(g.p / "none.csv", {}, UNITS.get), "none.csv cannot be read: No such file"),
    (named("bus.blf", b"LOGG\x90\xff"), "bus.blf cannot be read: ... these are read, by suffix: .csv, .parquet, .mf4"),
    (compared({"chassis.speed": "v"}, 5.0), "'v', 5 to 7 s on the clock of the run, and 'chassis.speed', 0 to 2 s"),
    (compared({"chassis.speed": "v"}, 5.0, shift=-5.0, start=3.0), "'chassis.speed' was not recorded between 3 and"),
    (compared({"speed": "v"}), "no signal 'speed'; did you mean 'chassis.speed'"),
    (compared({"chassis.speed": "v"}, v=1.0, shift="find"), "no shift can be found: no mapped signal varies in the"),
    *((missing(library, named(f"m.{kind}", b"x")), f"{library} is not installed: pip install ...'.[measured]'")
      for library, kind in (("pyarrow", "parquet"), ("asammdf", "mf4"), ("nptdms", "tdms"), ("rosbags", "bag"))),
    (options(), "a measured record needs --map SIGNAL=COLUMN, for example"),
    (options(*MAP, "--shift", "late"), "shift late: must be a number of s, or 'find'"),
    (options("--map", "v=chassis.speed"), "'v' is no signal of the run, but 'chassis.speed' is: the map is"),
    (options(*MAP, "--from", "2", "--to", "1"), "from 2 to 1: the first instant must not be after the last"),
    (options(*MAP, "--bits"), "--different, --align, --bits and -o are for two logs"),
    (options("--map", "v"), "--map v: must be SIGNAL=COLUMN or SIGNAL=COLUMN:UNIT"),
    (options(*MAP, "--map", "chassis.speed=w"), "--map chassis.speed=w: 'chassis.speed' has a column already, 'v'"),
    (options(*MAP, "--shift", "-5", "--allow", "speed=1"), "--allow speed=1: no observable 'speed': one of"),
    (refused("compare", "RUN", "RUN", "--shift", "1"), "which is not given"),
    (refused("plot", "RUN", "chassis.speed", *MAP), "which is not given"),
    (lines_of(8, 3), "it has more than 8 bytes"), (lines_of(9, 2), "it has more than 2 lines"),
    (lines_of(1 << 20, 3, f"t{',v' * (budget.CSV_LINE // 2)}\n"), "line 1 has more than 65536 characters"),
    (parquet({"t": [0.0, 0.5], "s": ["x", "y"]}, "s"), "column 's' holds no numbers, but string"),
    (parquet({"t": [0.0, 0.5], "w": [[1.0], []]}, "w"), "column 'w' holds no numbers, but list<element: double>"),
    (parquet({"t": [0.0, -0.5], "v": [1.0, 2.0]}), "row 2: the clock 't' must increase: -0.5 s after 0 s"),
    (parquet({"t": [0, 10], "v": [1.0, 2.0]}), "the clock 't' counts whole numbers, of s or ms: clock = COLUMN:s or"),
    (mdf(("CAN1", ["CAN_DataFrame.ID"]), ("", ["x"])), "no column 'v': it has ...; raw CAN frames are decoded first"),
    (mdf(("", [letters]), column="s"), "column '0/s' holds no numbers, but |S1 of 1 dimensions"),
    (mdf(("fast", ["n"]), ("slow", ["n"]), column="n"), "has 2 columns 'n': name one as in the file, of 'fast/n'"),
    (mdf(("bench", [over_angle])), "m.mf4: the group 'bench' of 'v' has no clock"),
    (old_mdf, "old.mdf is MDF 3.30: save it as MDF 4"),
    (tdms([("g", "v", NT, V)], clock="t"), "its columns have times of their own, so that it takes no clock"),
    (tdms([("g", "v", NT, V), ("c", "time", NT, {}), ("c", "w", NT, {})],
          columns={"chassis.speed": "v", "chassis.force": "w"}),
     "columns with times of their own and others do not share a clock"),
    (tdms([("c", "time", NT, {}), ("c", "x", NT[:3], {})], columns={"chassis.speed": "x"}),
     "column 'x' has 3 samples, and its clock 4"),
    (tdms([("c", "time", NT[:2], {}), ("c", "s", ["p", "q"], {})], columns={"chassis.speed": "s"}), "'c/s' holds no"),
    (again(wf_start_time=DATE + np.timedelta64(5, "s")), "'g/v' was armed again, wf_start_time changes: save each"),
    (again(wf_increment=0.5), "'g/v' was armed again, wf_increment changes"),
    (again(wf_start_offset=0.5), "'g/v' was armed again, wf_start_offset changes"),
    (again(unit_string="km/h"), "'g/v' was armed again, unit_string changes"),
    (tdms([("g", "v", NT, W), ("g", "w", NT, V)]), "'g/v' has no wf_start_time, and other channels have one"),
    (untold, "'g/v' is not read, because wf_start_offset of its segments cannot be known"),
    (tdms([("g", "v", NT, W | {"wf_xunit_string": "Hz"})]), "'g/v' is over Hz, not over time in s"),
    (tdms([("g", "v", NT, W | scaled("Reciprocal"))]), "'g/v' has a scale of type 'Reciprocal', which is not known"),
    *((limited(kind, "MEASURED_SAMPLES", 300), "cannot be read: a column has 301 samples, and 300 are allowed")
      for kind in ("parquet", "mf4", "tdms")),
    *((limited(kind, "MEASURED_BINARY", 100), "it has more than 100 bytes") for kind in ("parquet", "mf4", "tdms")),
)  # fmt: skip


# --- heights of surveys and roads --------------------------------------------------------------------


@cause
def survey(g, make, **keys):
    path = make(g.p)
    before = g.capfd.readouterr()
    try:
        read_map(path, **keys)
    finally:
        assert g.capfd.readouterr() == ("", ""), before


def written(path, content):
    path.write_bytes(content)
    return path


def replaced(path, old, new):
    return written(path, path.read_bytes().replace(old, new))


def stored(**about):
    def more(made):
        for key, value in about.items():
            setattr(made, key, value)

    return more


def geographic(p):
    (p / "c.prj").write_text(rasterio.CRS.from_epsg(4326).to_wkt(version="WKT1_ESRI"))
    return asc(p / "c.asc")


def small_limit(g):
    g.monkeypatch.setattr(survey_files, "MEASURED", 100)
    read_map(asc(g.p / "a.asc"))


def tiff(**keys):
    return lambda p: tif(p / "a.tif", **keys)


def grid(old=b"", new=b"", **keys):
    return lambda p: replaced(asc(p / "a.asc", **keys), old, new) if old else asc(p / "a.asc", **keys)


def road(**keys):
    return lambda p: crg(p / "a.crg", **keys)


def text_of_road(change):
    return lambda p: written(p / "b.crg", change(crg(p / "a.crg").read_text()).encode())


MARK = "ground.heightmap.heights = '...': line 2, column 3 is"
DAMAGED, PLACES = "is damaged, or no file of its suffix", "has places in degrees, feet"
SOUND = "is no sound OpenCRG road"
NUMBERED = ["long section 1,m", "long section 3,m"]


HEIGHTS = (
    (survey(tiff(rows=gap(-7.0), nodata=-7.0)), f"{MARK} -7, a mark of no data, and so are 1"),
    (survey(tiff(rows=gap(np.nan))), f"{MARK} nan, a mark of no data, and so are 1 more:"),
    (survey(tiff(rows=gap(-3.4028235e38, "f4"))), f"{MARK} -3.4...a mark of no data"),
    (survey(tiff(rows=gap(-32768, "i2"))), f"{MARK} -32768, a mark"),
    (survey(tiff(more=lambda made: made.write_mask(ROWS.max() != ROWS))),
     "line 1, column 3 is 5, a mark of no data: fill or cut the gaps"),
    (survey(grid(rows=gap(-9999.0))), f"{MARK} -9999, a mark of no data, and so are 1 more"),
    (survey(grid(rows=gap(77.5), mark="77.5")), f"{MARK} 77.5, a mark"),
    (survey(tiff(crs="EPSG:4326")), f"{PLACES}, Web Mercator or unknown: project it"),
    (survey(tiff(crs="EPSG:3857")), PLACES), (survey(tiff(crs="EPSG:4978")), PLACES),
    (survey(tiff(crs="EPSG:2225")), PLACES),
    (survey(geographic), PLACES),
    (survey(tiff(more=stored(units=("fathoms of old",)))), "'fathoms' is no known unit: convert its heights to m"),
    (survey(tiff(transform=Affine(2, 0.1, 0, 0.1, -3, 0))), "rows do not run from west to east: turn it"),
    (survey(tiff(count=2)), "must have one band of numbers: take the heights alone"),
    (survey(tiff(rows=ROWS.astype(complex))), "must have one band of numbers"),
    (survey(tiff(rows=np.zeros((500, 401)))), "has 401 x 500 points, must have 1 to 200000: cut it or make it coarser"),
    (survey(tiff(transform=Affine(2, 0, 500e3, 0, -3, 5300e3))),
     "y = 5299990 m, beyond 1e+06 m: ground.heightmap.corner = [x, y] places"),
    (survey(tiff(), spacing=[2, 2]), "spacing = [2, 2] m contradicts that of the file, [2, 3]: leave it out"),
    *((survey(tiff(), spacing=one), "spacing must be two lengths above 0") for one in (2, [1], [0, 1], ["2 kg", 1])),
    (survey(tiff(crs=None, transform=None), corner=[0, 0]), "has no places: give ground.heightmap.corner and"),
    (survey(tiff(tiled=True, blockxsize=4096, blockysize=4096, compress="deflate")), "its blocks have more than"),
    (small_limit, "it has more than 100 bytes"),
    (survey(lambda p: written(p / "a.tif", b"<VRTDataset/>")), DAMAGED),
    (survey(lambda p: written(p / "a.tif", b"")), DAMAGED),
    (survey(lambda p: asc(p / "a.asc").rename(p / "b.tif")), DAMAGED),
    (survey(lambda p: tif(p / "a.tif").rename(p / "b.asc")), "where a number must be"),
    (survey(lambda p: written(p / "a.tif", tif(p / "b.tif").read_bytes()[:-20])), "is damaged"),
    (survey(grid(b"nrows 4", b"nrows 5")), "has 20 heights, and its header says 5 columns x 5"),
    (survey(grid(b"ncols 5", b"ncols 4")), "has 20 heights, and its header says 4 columns x 4"),
    (survey(grid(size="cellsize -2")), "must have one cellsize, or dx and dy, above 0"),
    (survey(grid(size="cellsize 2\ndx 2\ndy 3")), "must have one cellsize, or dx and dy, above 0"),
    (survey(grid(size="cellsize 2\nCELLSIZE 3")), "gives cellsize twice"),
    (survey(grid(where="xllcorner 699\nxllcenter 700\nyllcorner 2")), "gives xllcorner twice"),
    (survey(grid(b"2.5", b"two")), "has 'two...' where a number must be"),
    (survey(lambda p: p / "none.tif"), "cannot be read: No such file"),
    (survey(road(head=["$", "$ROAD_CRG_FILE", "other.crg"])), "refers to another file by $ROAD_CRG_FILE: name that"),
    (survey(road(names=NUMBERED, z=SURFACE[:, :2])), "long section numbers must be 1"),
    (survey(road(), spacing=[0.001, 0.01]), "has 201 x 4001 points, must have 1 to 200000: give a larger"
                                            " ground.heightmap.spacing, [0.001, 0.01] m now"),
    (survey(road(), spacing=[0, 1]), "spacing must be two lengths above 0"),
    (survey(road(mods=["SCALE_LENGTH = -1"])), f"{SOUND}: modifier scale_length must be positive"),
    (survey(road(z=SURFACE[:-2], head=["REFERENCE_LINE_END_U = 4"])),
     "ends at u = 3 m, and its header says 4 m: it was cut off"),
    (survey(road(z=gap(np.nan, rows=SURFACE))), "cross section 2, long section 3 is nan, a mark of no data: fill or"),
    (survey(road(z=np.where(np.arange(9)[:, None] == 2, np.nan, SURFACE))), f"{SOUND}: 1 cross section(s) contain"),
    (survey(text_of_road(lambda text: text.replace("LONG_SECTION_V_INCREMENT = 0.5\n", ""))),
     "lacks LONG_SECTION_V_INCREMENT: add it to"),
    (survey(text_of_road(lambda text: text[:-30])), SOUND),
    (survey(text_of_road(lambda text: "no road")), f"{SOUND}: no"),
    (survey(text_of_road(lambda text: "")), f"{SOUND}: no"),
    *((missing(module, survey(lambda p, file=file: p / file)), f"{module} is not installed: pip install ...'.[survey]'")
      for file, module in (("a.tif", "rasterio"), ("a.crg", "pyopencrg"))),
)  # fmt: skip


# --- archives of the standard SSP --------------------------------------------------------------------


def archive(top, after="", **options):
    return lambda g: refused_archive(g, document(top, after, **options))


def refused_archive(g, ssd, **files):
    load_ssp(packed(g.p / "t.ssp", ssd, **{"resources/gain.fmu": g.gain} | files), None, ())


def value(**given):
    return bounded(bound(values(**given)))


@cause
def bounded(g, binding, after=""):
    """A value is given to an FMU whose k has a maximum."""
    ssd = document(system(component("s", binding, "resources/b.fmu")), after)
    refused_archive(g, ssd, **{"resources/b.fmu": with_maximum(g.gain, g.p / "b.fmu")})


def in_units(one, other):
    elements = component("s", connectors(f"y output {one}")) + component("g", connectors(f"u input {other}"))
    return archive(system(elements, connection("s.y", "g.u")), MILLIMETRES)


def brackets(g):
    ssd = document(system(component("s", in_unit("[m]"), "resources/m.fmu")))
    refused_archive(g, ssd, **{"resources/m.fmu": with_units(g.gain, g.p / "mm.fmu", "mm", "")})


def circle():
    inner = system("", connection("in", "out"), connectors("in input", "out output"), name="inner")
    return system(inner + component("g"), connection("inner.out", "inner.in") + connection("inner.out", "g.u"))


ONE, TWO = component("a"), component("a") + component("b")
K = '<ssv:Parameter name="k"><ssv:Real value="3.0"/></ssv:Parameter>'
TWICE = bound(values(k=("Real", 2.0)).replace("</ssv:Parameters>", f"{K}</ssv:Parameters>"))
ITEMS, REAL = "must be one of 1 low, 2 high, 3 road", "must be one finite Real"


ARCHIVES = (
    (value(k=("Real", "1_000")), REAL), (value(k=("Binary", "3")), REAL), (value(k=("Boolean", "yes")), "a Boolean"),
    (value(k=("String", "3")), "'s.k' must be of type Real"),
    (value(k=("Real", 5.5)), "= 5.5 (Real): 's.k' must be up to 5.0"),
    (value(k=("Integer", 6)), "= 6 (Integer): 's.k' must be up to 5.0"),
    (value(whole=("Integer", 3_000_000_000)), f"'s.whole' must be {-2**31} to {2**31 - 1}"),
    (bounded(TWICE), "parameter 'k': it is given twice"),
    (value(gear_start=("Integer", 6)), f"= 6 (Integer): 's.gear_start' {ITEMS}"),
    (value(gear_start=("Enumeration", "reverse")), f"= 'reverse' (Enumeration): 's.gear_start' {ITEMS}"),
    (bounded(in_unit("furlong")), "in 'furlong': the unit 'furlong' is not defined"),
    (bounded(in_unit("m", "mm")), "in 'm': the unit 'm' is not defined"),
    (brackets, "in '[m]': the unit 'm' is not defined"),
    (in_units("m", "s"), "'g.u' has the unit 's', and 's.y' the unit 'm'"),
    (in_units("m", "furlong"), "'g.u' has the unit 'furlong', which is not defined"),
    (archive(system(ONE), experiment='startTime="2" stopTime="1"'), "ends at 1 s, not after its start at 2 s"),
    (archive(system(ONE), experiment='stopTime="INF"'), "its DefaultExperiment must have finite numbers"),
    (archive(system("")), "its system has no components"), (archive(""), "has no system"),
    (archive(system(TWO, connection("a.y", "b.y"))), "they are output and output: one must give"),
    (archive(system(ONE, connection("a.y", "c.u"))), "no component 'c', which a connection names"),
    (archive(system(TWO, connection("a.gear", "b.gear_start"))), "'b.gear_start' is a parameter: 'a.gear' cannot"),
    (archive(system(ONE + '<ssd:SignalDictionaryReference name="b" dictionary="bus"/>')), "signal dictionary 'bus'"),
    (archive(circle()), "goes round in a circle"),
)  # fmt: skip


# --- FMUs of the user --------------------------------------------------------------------------------


@cause
def unfit(g, change):
    """The drive with other variables in its description."""
    units = {**SI, "Nm": SI["N.m"]}
    simulate(rig(changed(g.drive, g.p / "other.fmu", change, units)), g.p / "rig.mcap")


def as_other(name, **about):
    return lambda each: each._replace(**about) if each.name == name else each


@cause
def fmu(g, *files, lost=(), change=None):
    """The drive with other files."""
    with zipfile.ZipFile(g.p / "b.fmu", "w", zipfile.ZIP_DEFLATED) as made, zipfile.ZipFile(g.drive) as source:
        for name in source.namelist():
            if not name.startswith(tuple(lost)):
                content = source.read(name)
                made.writestr(name, content.replace(*change) if change and name.endswith(".xml") else content)
        for name, content in files:
            made.writestr(name, content)
    simulate(rig(g.p / "b.fmu"), g.p / "rig.mcap")


def text_as_fmu(g):
    (g.p / "text.fmu").write_text("no archive")
    simulate(rig(g.p / "text.fmu"), g.p / "rig.mcap")


run_with = after("run", "rig", "--track", "rigid", "--stop", "2 ms", "--json", "--set", "expect={}")


def parameter(text):
    return run_with("--replace", "drive=FMU", "--set", f"fmu.drive.parameters.{text}")


def wired(text):
    return lambda g: simulate(braked(g.drive, g.brake, text), g.p / "rig.mcap")


def demanded(**settings):
    return lambda g: assemble(rig(**{key.replace("__", "."): one for key, one in settings.items()}))


def fixed_steps(g):
    with zipfile.ZipFile(g.drive) as source, zipfile.ZipFile(g.p / "fixed.fmu", "w") as fixed:
        for name in source.namelist():
            fixed.writestr(name, source.read(name).replace(b'StepSize="true"', b'StepSize="false"'))
    simulate(rig(g.p / "fixed.fmu", **{"run.variable": {"tolerance": 1e-3, "estimate": "power"}}), g.p / "rig.mcap")


VX = "sprocket.velocity.x"
OTHER = f"rig.toml: fmu.drive.file = '...other.fmu'...: output '{VX}'"
TO_ENGINE = ["engine.y -> drive.torque.demand"]


FMUS_OF_THE_USER = (
    (unfit(lambda each: None if each.name == VX else each), f"no output '{VX}', which goes to track.{VX}: did you"),
    (unfit(as_other(VX, causality="local")), f"'{VX}' is of causality local, but goes to track.{VX}: output"),
    (unfit(as_other(VX, kind="Integer", start=0)), f"{OTHER} is of type Integer, and a Real is needed"),
    (unfit(as_other("sprocket.torque.y", unit="N")), "'sprocket.torque.y' has the unit 'N', and 'N.m' is needed"),
    (unfit(as_other("sprocket.force.x", unit="kip")), "has the unit 'kip', which the FMU does not define, and 'N' is"),
    (lambda g: simulate(rig(g.p / "none.fmu"), g.p / "rig.mcap"), "rig.toml: fmu.drive.file: there is no FMU "),
    (text_as_fmu, "is not an FMU: it is not a zip archive"),
    (fmu(change=(b'"2.0"', b'"3.0"')), "bad modelDescription.xml"), (fmu(lost=["binaries"]), "has no binary for "),
    (fmu(change=(b'"angle"', b'"speed"')), "has a variable 'speed', and there is another one of that name in its log"),
    (fmu(("a/" * 200 + "x", b"x")), "a file in it has a name of more than 1024 characters or 64 folders"),
    (fmu(("resources/../../up", b"x")), "it holds a file outside of it, 'resources/../../up'"),
    (fmu(*((f"resources/{k}", bytes(1 << 24)) for k in range(4))), "is not unpacked: it unpacks to more"),
    (fixed_steps, "it takes equal communication steps only"),
    (run_with("--replace", "drve=a.fmu"), "fmu.drve: no such part, and no connection names it: did you mean 'drive'?"),
    (run_with("--replace", "drive"), "--replace drive: must be NAME=FMU, the name of a part and a file"),
    (run_with("--set", "fmu.drive.fil=a.fmu"), "rig.toml: unknown key 'fmu.drive.fil': did you mean 'fmu.drive.file'?"),
    (parameter("torqe=3"), "did you mean 'torque'?"), (parameter("torque=[1]"), "fmu.drive.parameters.torque"),
    (parameter("torque='high'"), "drive: parameter 'torque' = 'high': must be of type Real"),
    (parameter("manner=1.5"), "drive: parameter 'manner' = 1.5: must be of type Integer"),
    (wired("drive.steps -> track.slip"), "'track' is no FMU of the user; of our parts, only chassis.hitch.force"),
    (wired("drve.steps -> idler_drive.ticks"), "rig.toml: ...no component 'drve': did you mean 'drive'?"),
    (wired("track.slip -> drive.sprocket.force.x"), "the input has another connection"),
    (wired("track.link[1].tension -> idler_drive.pull"), "track: it has no output 'link[1].tension', which goes to"),
    (wired("track.status, idler_drive.ticks"), "must be 'instance.output -> instance.input'"),
    (demanded(drive={"demand": True, "speed": 3.0}), "speed = 3.0 needs demand = false, not true"),
    (demanded(drive={"demand_lag": 0.1}), "demand_lag = 0.1 needs demand = true, not false"),
    (demanded(fmu__engine={"file": "e.fmu"}, connections=TO_ENGINE), "drive has this input only with drive.demand ="),
)  # fmt: skip

SAID = (*LOGS, *REPLAYS_AND_RESUMPTIONS, *MEASURED_RECORDS, *HEIGHTS, *ARCHIVES, *FMUS_OF_THE_USER)


@pytest.mark.parametrize(("cause", "said"), SAID, ids=[said[-60:] for _, said in SAID])
def test_what_is_said(request, cause, said):
    text = told(Given(request), cause)
    assert re.search(".*".join(map(re.escape, said.split("..."))), text, re.DOTALL), text
    assert "TWO LINES" not in text
