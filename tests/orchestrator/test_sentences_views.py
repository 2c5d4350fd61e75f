"""Sentences of what is refused: by views, report, build and other commands, scenes and their files, and functions.

Each is one line that says what is wrong, of at most 400 characters and no text of a library.
"""

import re
import shlex
import struct
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from data_files import MAP, ROUGH, STEP, WAVES, read_file, write_parquet, write_tdms
from made_logs import of_columns, stretched
from matplotlib import image
from PIL import Image
from short_runs import hanging_log

from fmus.interface.model import InvalidParameter
from fmus.monolith.model import Monolith
from fmus.physics.chain.layout import scale_of_angles
from fmus.vehicles.tables import BadInput
from orchestrator import Run
from orchestrator.cli.common import message_and_status
from orchestrator.execution import monolithic
from orchestrator.execution import truth as truths
from orchestrator.scene.assembly import assemble
from orchestrator.scene.data_files import read_files
from orchestrator.scene.scene import load
from orchestrator.studies import error_runtime

LONG = "x" * 300
PIP = r"pip install -c constraints.txt -e "
ENDS = "its name must end in {}; a view can be"
# Logs by name: H of a hanging chain, E without any record of links, B that blew up, P of two plain signals.
COMMANDS = [
    ("view H -o x.tif", f"x.tif cannot be written: {ENDS.format('.png, .svg or .pdf')}"),
    ("view H -o x.rrd", f"x.rrd cannot be written: {ENDS.format('.png, .svg or .pdf')}"),
    ("view H --rerun -o x.png", f"x.png cannot be written: {ENDS.format('.rrd')}"),
    ("view H --foxglove -o nowhere/x.mcap", "there is no folder nowhere"),
    ("view H -o nowhere/a.png", "cannot be written"),
    ("view H -o .", "it is a directory"),
    ("view H --foxglove -o H", "cannot be written: it is a file that is read"),
    ("view H --rerun", "there is no display for the viewer"),
    ("view H --foxglove", "-o FILE says what is written"),
    ("view H --rerun --foxglove -o x.mcap", "one of them at a time"),
    ("view H -o x.mp4 --seen-from below", "one looks from one of right, top, corner"),
    ("view H -o x.mp4 --at 0", "--at is for pictures"),
    ("view H -o x.png --colour stress", "--colour is for films, stills (--seen-from), --rerun and --foxglove"),
    ("view H -o x.gif --colour sliding", "does not hold that; of its links it holds tension"),
    ("view H -o x.gif --colour red", "--colour red: links are coloured by one of tension, stress, ground"),
    ("view H -o x.png --above --seen-from top", "--seen-from is for films and stills"),
    ("view H -o x.png --seen-from top --at 0 --at 1", "a still shows one instant"),
    ("view H -o x.svg --seen-from top", "its name must end in .png"),
    ("view H -o x.png --seen-from top --at -1", "no instant"),
    ("view H -o x.png --at 0.03", "--at 0.03: links were recorded from 0 to 0.02 s"),
    ("view E -o x.png", "E.mcap holds no links to draw"),
    ("view P -o x.png", "P.mcap holds no links to draw"),
    ("view H -o x.png --above", "holds no 'chassis.yaw'"),
    ("view P -o x.png --above", "P.mcap holds no vehicle with the links of its tracks"),
    ("view B -o x.gif", "values of /chain/links are no finite numbers: there is nothing to show"),
    ("report none.mcap -o x.pdf", "must end in .html or .htm"),
    ("report none.mcap -o x", "must end in .html"),
    ("report none.mcap -o nowhere/x.html", "no folder"),
    ("report none.mcap -o folder.html", "is a directory"),
    ("report none.mcap -o x.html", "none.mcap"),
    ("report H P -o x.html", "different scenes"),
    ("report H -o x.html --sn '90 mm,1e6,5'", "sn = 90 mm,1e6,5: must be stress range, cycles and slope"),
    ("report P -o x.html --with no.csv --map a.x=v", "no.csv cannot be read: No such file or directory"),
    ("report P -o x.html --with m.csv", "a measured record needs --map SIGNAL=COLUMN"),
    ("report P -o x.html --shift 1", "--map, --clock and --shift belong to the file of a test, which is not given"),
    ("report P -o x.html --with m.csv --map a.speed=w", "m.csv has no column 'w': it has t, v"),
    ("report P -o x.html --with m.csv --map a.sped=v", "no signal 'a.sped'; did you mean 'a.speed'"),
    ("report P -o x.html --with m.csv --map a.speed=v --shift 99", "have no values in common"),
    ("compare P P --align a.speed=99", "P.mcap never passes 99"),
    ("compare P P --align a.way=1", "no signal 'a.way'"),
    *((f"compare P P --align {text}", f"align = {text}: must be time, travel or SIGNAL=VALUE")
      for text in ("way", "=1", "a.speed=", "a.speed=nan")),
    ("build hanging_chain -o x --set track.start=straight",
     "cannot build track_flexible_fmu: start = 'straight': must be one of rest, polygon, displaced"),
    ("build hanging_chain -o x --set track.elmnt=beam", "unknown key 'track.elmnt'"),
    ("build hanging_chain -o x --fmi 3", "--fmi 3 needs --native: pythonfmu, which makes Python FMUs, writes FMI 2.0"),
    ("build hanging_chain -o x --fmi 1 --native", "--fmi 1: there are FMUs of FMI 2 and 3"),
    ("log recover .", "the log . cannot be read: it is a directory"),
    ("resume .", "the log . cannot be read: it is a directory"),
    (f"run rig --log {LONG}.mcap", "file name too long"),
    (f"show {LONG * 9}", "no scene"),
    (f"show straight --set {LONG * 9}=1", "unknown key"),
    (f"show straight --set vehicle={LONG * 9}", "no vehicle"),
    (f"show straight --set run.{LONG * 9}.a=1", "unknown key"),
    ("run straight --set 'vehicle.road_wheel.x=[1e16, 0, 0, 0, 0]'", "must be -1000 to 1000 m"),
    ("run rig --set rig.axle_distance=1e16", "no belt lies round the wheels"),
]  # fmt: skip
# Modules that are not there, and commands that need them.
EXTRAS = [
    ("rerun", "view H --rerun -o x.rrd", f"rerun is not installed: {PIP}'.[view]'"),
    ("foxglove", "view H --foxglove -o x.mcap", f"foxglove is not installed: {PIP}'.[view]'"),
    ("imageio_ffmpeg", "view H -o x.mp4", f"imageio_ffmpeg is not installed: {PIP}'.[video]'"),
    ("plotly.offline", "report H -o x.html",
     f"cotrack: plotly is not installed: {PIP}'.[report]' in the clone of cotrack brings it"),
]  # fmt: skip


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    hanging, folder, t = hanging_log(tmp_path_factory), tmp_path_factory.mktemp("logs"), 0.1 * np.arange(11)
    return {
        "H": hanging,
        "E": stretched(hanging, folder / "E.mcap", []),
        "B": stretched(hanging, folder / "B.mcap", [0.0, 0.1], blown=0),
        "P": of_columns(folder / "P.mcap", {"a.speed": t, "a.x": t}, t, {"assembly": "chain"}),
    }


@pytest.mark.parametrize(("module", "command", "said"), [*((None, *row) for row in COMMANDS), *EXTRAS])
def test_a_command_refuses_in_a_sentence_and_writes_nothing(
    cotrack, tmp_path, logs, monkeypatch, module, command, said
):
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    if module:
        monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / "folder.html").mkdir()
    (tmp_path / "m.csv").write_text("t,v\n0,1\n0.5,2\n")
    status, out, err = cotrack(*(logs.get(word, word) for word in shlex.split(command)))
    assert (out, err.count("\n")) == ("", 1), err
    assert status == 2
    assert said in err
    assert len(err.replace(str(logs["H"]), "H")) <= 400
    assert [file.name for file in tmp_path.rglob("*") if file.is_file()] == ["m.csv"]


BENT = "[[0, 0.1], [0, 0.1], [0.2, 0]]"
# Settings of the scene straight.
SCENES = [
    (["ground.step={x=[3], rise=0}"], "rise = 0 m: a step needs a height, up or down"),
    ([STEP, "ground.half_round={x=[3.1], radius=0.2}"], r"step begins at x = 2\.98 m, before half_round ends at 3\.3"),
    (["ground.incline_start=2"], "incline_start needs grade or bank"),
    (["ground.grade=3"], r"ground\.grade = 3: must be -2 to 2"),
    ([WAVES, "ground.washboard.end=3"], "end = 3 m must be two waves or more beyond start = 1 m"),
    ([ROUGH, "ground.rough.band=[0.101, 0.102]"], "no multiple of 1/period, period = 200 m: longer period"),
    ([ROUGH, "ground.rough.period=5000"], "more than 6000 waves"),
    ([ROUGH, "ground.rough.isotropic=true", "ground.rough.correlated=true"], "exclude each other: a surface"),
    (["ground.rough={iso_class='D'}"], "start is missing: lanes begin at an x"),
    (["ground.rough={iso_class='D', isotropic=true}", "symmetric=true"], r"both sides, but ground\.rough differs"),
    (["ground.rough={iso_class='I', start=1}"], r"ground\.rough\.iso_class = 'I'"),
    (["ground.friction=[{x=[2, 1], factor=1}]"], r"x = \[2, 1\] m must be in order"),
    (["ground.friction=[{x=[1, 2]}]"], "needs one of factor and coefficient"),
    ([MAP, "ground.heightmap.heights=[[0, 1], [1]]"], "at least 2"),
    ([MAP, "ground.heightmap.heights=[[0, 1, 2], [1, 2]]"], "as many columns, not 2 and 3"),
    ([MAP, "ground.heightmap.heights=a.las"], r"must be a file \.csv, \.npy, \.png, \.tif, \.asc or \.crg"),
    ([MAP, "ground.heightmap.range=[0, 1]"], "the heights are numbers already"),
    ([WAVES, "symmetric=true"], r"same ground on both sides, but ground\.washboard differs"),
    ([ROUGH, "start.roll=180 deg"], r"ground\.rough needs start\.roll = 0"),
    # ten on one is the limit of slopes, along x and y, with the spacing of that way
    ([MAP.replace(BENT, "[[0, 0], [0, 0], [0, -9999]]")], "column 2 to the next line they change by .* m over 1 m"),
    ([MAP.replace(BENT, "[[0, 0], [0, 10.1]]")], "column 2 to the next line they change by 10.1 m over 1 m, no"),
    ([MAP.replace(BENT, "[[0, 40.1], [9.9, 49]]")], "column 1 to the next column they change by 40.1 m over 4 m"),
]  # fmt: skip


@pytest.mark.parametrize(("settings", "said"), SCENES)
def test_a_scene_is_refused_in_a_sentence(settings, said):
    with pytest.raises(BadInput, match=said) as refused:
        load("straight", "rigid", settings)
    assert "\n" not in str(refused.value)


def parquet(*columns):
    return lambda path: write_parquet(path, [("t", "s", [0.0, 0.5]), *columns])


def tdms(*starts):
    return lambda path: write_tdms(path, [(f"c{k}", "N m", np.arange(3.0), t, 0.5) for k, t in enumerate(starts)])


NO_PAIR = "must be two numbers$"
MARKS = ("-9999", "-32768.0", "1e20", "-3.4028235e38", "nan")
# Files of points: key, what is in them, sentence after both.
POINTS = [
    ("driver.points", "0,0\n2,-8.5\nend,of\n", f", line 3: {NO_PAIR}"),
    ("driver.points", "x,y\n0,0\n1\n", f", line 3: {NO_PAIR}"),
    ("driver.points", "x,3\n0,0\n", f", line 1: {NO_PAIR}"),
    ("driver.points", "1\n2\n", f", line 1: {NO_PAIR}"),
    ("driver.points", "x,y\nx,y\n", f", line 2: {NO_PAIR}"),
    ("driver.points", "1_0,2_0\n3,4\n", f", line 1: {NO_PAIR}"),
    ("driver.points", "0,0\n\u0661,2\n", f", line 2: {NO_PAIR}"),
    *(("driver.points", f"0,0\n1,{mark}\n", f", line 2: {re.escape(f'{float(mark):.7g}')} is a mark of no data: leave")
      for mark in MARKS),
    ("drive.left.speed_points", None, ": cannot be read: No such file"),
    ("drive.speed_points", "Time [s],n [Hz]\n0,0\n4,96\n",
     ": column 'n': 'Hz' does not convert to rad/s; an angle needs deg, rad or rev"),
    ("drive.speed_points", "n [rpm],Time [s]\n0,0\n4,96\n", ": column 'n': 'rpm' does not convert to s"),
    ("drive.speed_points", "t,speed (left)\n0,0\n4,96\n", ": column 'speed': 'left' is no known unit"),
    ("drive.torque_points", "t,M [kN]\n0,0\n4,96\n", ": column 'M': 'kN' does not convert to N m"),
]  # fmt: skip
FORMATS = [
    ("driver.speed_points", ".mat", lambda path: path.write_bytes(b"MATLAB\x80"),
     r": cannot be read: .* are read, by suffix: \.csv, \.parquet"),
    ("driver.speed_points", ".parquet", parquet(("v", "km/h", [0.0, 1.0]), ("w", "kg", [0.0, 1.0])),
     ": must have two columns, and has "),
    ("driver.speed_points", ".parquet", parquet(("v", "kg", [0.0, 1.0])), ": column 'v': "),
    ("driver.speed_points", ".parquet", parquet(("v", "km/h", [0.0, np.nan])), ", row 2: nan is a mark of no data"),
    ("drive.engine_points", ".tdms", tdms(0.0, 0.25), ": its two columns have times of their own that differ"),
    ("drive.engine_points", ".tdms", tdms(), ": must have two columns, and has none"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("key", "suffix", "content", "said"), [*((key, ".csv", *row) for key, *row in POINTS), *FORMATS]
)
def test_a_file_of_points_is_refused_in_a_sentence(tmp_path, key, suffix, content, said):
    file, raw = tmp_path / f"a{suffix}", f"a{suffix}"
    if callable(content):
        pytest.importorskip({".parquet": "pyarrow", ".tdms": "nptdms"}.get(suffix, "numpy"))
        content(file)
    elif content is not None:
        file.write_text(content, encoding="utf-8")
    for name in reversed(key.split(".")):
        raw = {name: raw}
    with pytest.raises(BadInput, match="^" + re.escape(f"mine.toml: {key} = '{file}'") + said):
        read_files(raw, tmp_path, "mine.toml")


def png_chunk(kind, content):
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


@pytest.fixture(scope="module")
def heights(tmp_path_factory):
    """Folder of files of heights that are none."""
    folder = tmp_path_factory.mktemp("heights")
    image.imsave(folder / "colour.png", np.zeros((3, 3, 3)))
    for name, text in (("text.csv", "1,2\n3,x\n"), ("ragged.csv", "1,2\n3\n"), ("no.png", "no image")):
        (folder / name).write_text(text)
    (folder / "cut.npy").write_bytes(b"\x93NUMPY")
    np.save(folder / "flags.npy", np.zeros((3, 3), dtype=bool))
    np.save(folder / "rows.npy", np.zeros((3, 3)))
    header = (folder / "rows.npy").read_bytes()[:128]
    (folder / "none.npy").write_bytes(header.replace(b"(3, 3), }  ", b"(3000, 0), }")[:128])
    (folder / "many.npy").write_bytes(header.replace(b"(3, 3), }      ", b"(3000, 3000), }"))
    (folder / "few.npy").write_bytes(header)
    marked = np.zeros((3, 4))
    marked[1:, 2] = -9999
    np.save(folder / "marked.npy", marked)
    Image.fromarray(np.zeros((2, 2), np.uint16)).save(folder / "small.png")
    small = (folder / "small.png").read_bytes()
    (folder / "text.png").write_bytes(small[:8] + png_chunk(b"tEXt", small[16:29]) + small[8:])
    larger = png_chunk(b"IHDR", b"\0\0\0\3" + small[20:29])
    (folder / "twice.png").write_bytes(small[:33] + larger + small[33:])
    return folder


@pytest.mark.parametrize(("name", "keys", "said"), [
    ("colour.png", {"range": [0, 51]}, "8 bits of colour, must be grey of 16: 8 bits make steps of 0.2 m"),
    ("colour.png", {}, r"an image needs ground\.heightmap\.range = \[black, white\]"),
    ("no.png", {"range": [0, 1]}, "is no PNG image"),
    ("text.csv", {}, "line 2: must be numbers"),
    ("ragged.csv", {}, "line 2: has 1 numbers, the first line 2"),
    ("cut.npy", {}, "is no array of numpy"),
    ("flags.npy", {}, "two-dimensional array of numbers"),
    ("missing.csv", {}, "cannot be read: No such file"),
    ("none.npy", {}, "has 0 x 3000 points, must have 1 to 200000"),
    ("many.npy", {}, "has 3000 x 3000 points, must have 1 to 200000"),
    ("few.npy", {}, "is a damaged array"),
    ("marked.npy", {}, "line 2, column 3 is -9999, a mark of no data, and so are 1 more: "),
    ("text.png", {"range": [0, 1]}, "it does not begin with its size"),
    ("twice.png", {"range": [0, 1]}, "is a damaged image: it says that it has 3 x 2 points too"),
])  # fmt: skip
def test_a_file_of_heights_is_refused_in_a_sentence(heights, name, keys, said):
    with pytest.raises(BadInput, match=said) as refused:
        read_file(heights / name, **keys)
    assert str(refused.value).startswith(f"mine.toml: ground.heightmap.heights = '{heights / name}'")


def monolith(element="cable", **options):
    assembly = assemble(load("hanging_chain", "flexible", (f"track.element={element}", "chain.links=8")))
    return Monolith(monolithic.parts_of(assembly), assembly.connections, **options)


def truth_of(scene, setting):
    return lambda: truths.truth(load(scene, "rigid", (setting,)))


NO_TRUTH = r"^truth: {}\.toml: {}: the monolith has tracks on hard ground"


@pytest.mark.parametrize(("call", "kind", "said"), [
    (lambda: Run("H").report("x.html", shift="find"), BadInput,
     "columns, shift and clock belong to measured, a file, which is not given"),
    (lambda: Run("H").report("x.html", measured="m.csv"), BadInput, r"m\.csv: no signal has a column"),
    (lambda: scale_of_angles(lambda s: s + 0.5, 1e-3, 1.5), ValueError, "the chain is too soft"),
    (lambda: monolith(integrator="adams", rtol=1.0), InvalidParameter, r"rtol = 1: must be between 1e-13 and 0\.1"),
    (lambda: monolith(integrator="euler"), InvalidParameter, "'euler': a monolith has runge_kutta and adams"),
    (lambda: monolith().begin_at(0.0, {}), InvalidParameter, "chain: the state that it is to begin with"),
    pytest.param(lambda: monolith("beam"), InvalidParameter, "element = 'beam': the monolith knows chains of cables",
                 marks=pytest.mark.long),
    (truth_of("soft_ground", "hitch=false"), BadInput, NO_TRUTH.format("soft_ground", r"ground\.soil")),
    (truth_of("step", "run.stop=1"), BadInput, NO_TRUTH.format("step", r"ground\.hull")),
    (truth_of("straight", "hitch.force=1"), BadInput, NO_TRUTH.format("straight", "hitch")),
    (truth_of("straight", "seats=['driver']"), BadInput, NO_TRUTH.format("straight", "seats")),
    (lambda: error_runtime.cases(True, "soft_ground"), BadInput, "the monolith"),
    (lambda: truths.truth(load("hanging_chain", "flexible", ("track.element=beam",))), BadInput,
     "^truth: track.element = 'beam': the monolith knows chains of cables"),
    (lambda: monolithic.states_at(load("hanging_chain"), 0.0205), BadInput, "must be a multiple of run.step"),
])  # fmt: skip
def test_a_function_refuses_in_a_sentence(call, kind, said, logs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("H").symlink_to(logs["H"])
    with pytest.raises(kind, match=said) as refused:
        call()
    assert "\n" not in str(refused.value)
    assert [file.name for file in tmp_path.iterdir()] == ["H"]


@pytest.mark.parametrize(("message", "module", "said"), [
    ("No module named 'google'", "google", f"protobuf (module google) is not installed: {PIP}"),
    ("No module named 'pydantic'", "pydantic", f"pydantic is not installed: {PIP}"),
    ("Numba needs NumPy 2.3 or less", "numba", "numba is installed but cannot be imported (Numba needs NumPy 2.3"),
    ("No module named 'scipy.linalg'", "scipy.linalg", "scipy is installed but cannot be imported (No module named"),
    ("cannot import name 'x'", "fmus.kernels.jit", "internal error"),
])  # fmt: skip
def test_a_package_is_named_as_it_is_installed(message, module, said):
    """Packages with other names, or that are there but do not fit another one; an error of ours is internal."""
    kind = ModuleNotFoundError if message.startswith("No module") else ImportError
    sentence, status = message_and_status(kind(message, name=module))
    assert sentence.startswith(said)
    assert status == (1 if module.startswith("fmus") else 2)
