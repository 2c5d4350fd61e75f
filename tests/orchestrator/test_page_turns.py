"""Turns, tooth orders, fatigue, shared legends and print of the page, computed again from the log."""

import base64
import html as markup
import re
import shutil
import subprocess
import sys
from importlib.resources import files

import numpy as np
import pytest
from packed import unpacked
from page_logs import embedded, page, signal, vehicle_log, vehicle_page, written
from view_logs import ran

from orchestrator.execution.log_report import report
from orchestrator.log.reader import Log
from orchestrator.results.page.chain import longest_constant
from orchestrator.results.page.embedded import quantity
from orchestrator.results.page.player import LONGEST, UNIT, above
from orchestrator.results.run_data import RunData
from orchestrator.results.units import hours, number

SPEEDS = [f"drive.{side}.speed_points=[[0.05,0],[0.7,{speed}]]" for side, speed in (("left", 6), ("right", 9))]
SIDES = ("left", "right")
vehicle = pytest.fixture(scope="module")(vehicle_log)
html = pytest.fixture(scope="module")(vehicle_page)


@pytest.fixture(scope="module")
def turning(tmp_path_factory):
    """Log of a vehicle of rigid links that drives off and turns to the left at 6 and 9 rad/s."""
    return ran(tmp_path_factory, "turn", "rigid", ["run.stop=2 s", *SPEEDS])


@pytest.fixture(scope="module")
def shown(turning):
    """Its page."""
    return page(turning)


@pytest.fixture(scope="module")
def record(turning):
    """Values of the log by signal, and of the chassis's time by "t"."""
    names = [f"chassis.chassis.{part}.{axis}" for part in ("velocity", "position") for axis in "xy"]
    names += ["chassis.yaw", "chassis.chassis.angular_velocity.z"]
    for side in SIDES:
        names += [f"{side}_track.{name}" for name in ("slip", "tension.max", "ground.force.x", "ground.force.y")]
        names += [f"{side}_drive.{name}" for name in ("torque", "speed", "energy.work")]
    with Log(turning) as log:
        values = {name: signal(log, name)[1] for name in names}
        return values | {"t": signal(log, "chassis.yaw")[0], "vehicle": log.table("scene.json")["vehicle"]}


def value(cell):
    """SI value of a quantity in a cell."""
    size, unit = re.fullmatch(r"(\S+) (.+)", cell.replace("\N{MINUS SIGN}", "-")).groups()
    return float(size) * (1e3 if unit[0] == "k" else 1e-3 if unit[:2] == "mm" else 1.0)


def ahead_and_left(record, name):
    c, s = np.cos(record["chassis.yaw"]), np.sin(record["chassis.yaw"])
    x, y = record[f"{name}.x"], record[f"{name}.y"]
    return c * x + s * y, c * y - s * x


def thrusts(record):
    return [ahead_and_left(record, f"{side}_track.ground.force")[0] for side in SIDES]


def test_the_tension_of_the_vehicle_table_is_that_of_the_standing_vehicle(vehicle, turning):
    """As keys.md says: the m113 starts with it in equilibrium, and with 13.5 % more as drawn."""
    for path, more in ((vehicle, 1.135), (turning, 1.0)):
        with Log(path) as log:
            wanted = log.table("scene.json")["vehicle"]["track"]["tension"]
            assert signal(log, "left_track.tension.mean")[1][0] / wanted == pytest.approx(more, abs=3e-3)


# --- turns -----------------------------------------------------------------------------------------


def curves_are_those_of(record, charts):
    left, right = thrusts(record)
    for key, place, values in (
        ("yaw-rate", 0, record["chassis.chassis.angular_velocity.z"]),
        ("moment", 0, 1e-3 * record["vehicle"]["track"]["lateral"] * (right - left)),
        ("thrust", 0, 1e-3 * left),
        ("thrust", 1, 1e-3 * right),
    ):
        drawn = unpacked(charts[key]["traces"][place]["y"])
        assert (drawn.min(), drawn.max()) == pytest.approx((values.min(), values.max()), rel=1e-6), key
    (trace,) = charts["radius"]["traces"]
    t, radius = unpacked(trace["t"]), unpacked(trace["y"])
    speed = np.hypot(*(record[f"chassis.chassis.velocity.{axis}"] for axis in "xy"))
    way, yaw = np.cumsum(speed * np.diff(record["t"], prepend=0.0)), np.unwrap(record["chassis.yaw"])
    for moment in (1.1, 1.4, 1.7):
        k = int(np.abs(t - moment).argmin())
        gone, turned = (np.ptp(np.interp([t[k] - 0.25, t[k] + 0.25], record["t"], each)) for each in (way, yaw))
        assert radius[k] == pytest.approx(gone / turned, rel=2e-3)
    assert np.isnan(radius[0]), "at rest there is no radius"


def table_is_that_of(record, html):
    table = re.search(r"<h3>By side</h3>.*?<tbody>(.*?)</tbody>", html, re.S)[1]
    (row,) = re.findall(r"<tr>(.*?)</tr>", table, re.S)
    cells = [markup.unescape(cell) for cell in re.findall(r"<td>(.*?)</td>", row, re.S)]
    what, start, end, moment, centre, _, thrust, slip, power = cells
    assert what == "<b>turn left</b>"
    inside = (record["t"] > float(start) - 1e-6) & (record["t"] < float(end) + 1e-6)
    means = [each[inside].mean() for each in thrusts(record)]
    rate = record["chassis.chassis.angular_velocity.z"][inside].mean()
    sideways = ahead_and_left(record, "chassis.chassis.velocity")[1][inside].mean()
    for cell, expected in (
        (moment, [record["vehicle"]["track"]["lateral"] * (means[1] - means[0])]),
        (centre, [-sideways / rate]),
        (thrust, means),
        (slip, [record[f"{side}_track.slip"][inside].mean() for side in SIDES]),
        (power, [np.ptp(record[f"{side}_drive.energy.work"][inside]) / np.ptp(record["t"][inside]) for side in SIDES]),
    ):
        assert [value(each) for each in cell.split("<br>")] == pytest.approx(expected, rel=1e-3)


def test_a_turn_is_that_of_the_log(turning, shown, record, scaled):
    curves_are_those_of(record, embedded(shown)["charts"])
    table_is_that_of(record, shown)
    with Log(turning) as log:
        scaled(log, "/left_track/out", "ground.force.x", 1.03)
    html = page(turning)
    for twin in (lambda: curves_are_those_of(record, embedded(html)["charts"]), lambda: table_is_that_of(record, html)):
        with pytest.raises(AssertionError):
            twin()


def shorts(content):
    return np.frombuffer(base64.b64decode(content), "<i2").reshape(-1, 2) * UNIT


def from_above_is_that_of(record, view, tracks):
    feet, arrows = shorts(view["feet"]), shorts(view["arrows"])
    assert view["counts"] == [len(feet)]
    row = int(np.abs(record["t"] - tracks[0].t[-1]).argmin())
    hull = [record[f"chassis.chassis.position.{axis}"][row] for axis in "xy"]
    assert unpacked(view["hull"]) == pytest.approx(hull, abs=1e-6)
    found = []
    for series in tracks:
        places, forces = (
            series.values[-1][[series.names.index(name.format(i + 1, axis)) for i in range(64) for axis in "xy"]]
            for name in ("joint[{}].position.{}", "link[{}].ground.force.{}")
        )
        pins = places.reshape(64, 2)
        found += zip(0.5 * (pins + np.roll(pins, -1, axis=0)) - hull, forces.reshape(64, 2), strict=True)
    assert view["largest"] == pytest.approx(max(np.hypot(*force) for _, force in found))
    for place, force in found:
        if np.hypot(*force) > 0.03 * view["largest"]:
            k = np.linalg.norm(feet - place, axis=1).argmin()
            assert feet[k] == pytest.approx(place, abs=0.02), "a link's middle is between its pins"
            assert arrows[k] == pytest.approx(force * LONGEST / view["largest"], abs=UNIT)


def test_links_from_above_stand_and_push_where_the_log_says(turning, record, scaled):
    with Log(turning) as log:
        tracks = [log.read(f"/{side}_track/links") for side in SIDES]
        from_above_is_that_of(record, above(RunData(log), np.array([2.0])), tracks)
        names = [f"link[{i + 1}].ground.force.y" for i in range(64)]
        most = max(names, key=lambda name: abs(tracks[0].values[-1, tracks[0].names.index(name)]))
        scaled(log, "/left_track/links", most, 1.03)
    with Log(turning) as log, pytest.raises(AssertionError):
        from_above_is_that_of(record, above(RunData(log), np.array([2.0])), tracks)


# --- tooth orders ----------------------------------------------------------------------------------


def orders_are_those_of(record, html):
    spans = r"(?:left )?(\S+) to (\S+) s(?:, right (\S+) to (\S+) s)?"
    note = re.search(f"constant speed, turn left, while [^:]*: {spans}", html)
    spans, peaks = (note.groups()[:2], note.groups()[2:] if note[3] else note.groups()[:2]), {}
    for chart, name in (("torque-orders", "drive.torque"), ("tension-orders", "track.tension.max")):
        drawn = embedded(html)["charts"][chart]
        for trace, side, (start, end) in zip(drawn["traces"], SIDES, spans, strict=True):
            assert trace["name"] == side
            inside = (record["t"] > float(start) - 1e-6) & (record["t"] < float(end) + 1e-6)
            t, speed = record["t"][inside], record[f"{side}_drive.speed"][inside]
            assert np.ptp(speed) < 0.03 * speed.mean()
            weights = np.sin(np.pi * np.arange(len(t)) / len(t)) ** 2
            passing = record["vehicle"]["sprocket"]["teeth"] * speed.mean() / (2.0 * np.pi)
            y = record[f"{side}_{name}"][inside] / (1e3 if "k" in drawn["y"] else 1.0)
            orders, amplitudes = unpacked(trace["t"]), unpacked(trace["y"])
            assert orders[-1] <= 8.0 < orders[-1] + orders[0]
            for k in (0, 3, len(orders) // 2, int(np.argmax(np.where(orders > 0.5, amplitudes, 0.0)))):
                waves = np.exp(-2j * np.pi * orders[k] * passing * (t - t[0]))
                own = 2.0 * abs(np.sum((y - y.mean()) * weights * waves)) / weights.sum()
                assert amplitudes[k] == pytest.approx(own, rel=2e-3, abs=1e-4 * float(amplitudes.max()))
            peaks[chart, side] = (own * (1e3 if "k" in drawn["y"] else 1.0), orders[k], orders[k] * passing)
    largest = max(peaks["torque-orders", side] for side in SIDES)
    sentence = re.search(r"Largest: ([\d.]+ k?N m) at order ([\d.]+), ([\d.]+) Hz, (left|right)\.", html)
    assert (value(sentence[1]), float(sentence[2]), float(sentence[3])) == pytest.approx(largest, rel=6e-3)


def test_orders_leave_out_the_ramps_of_the_sprocket():
    """The speed ramps until 1 s and from 4 s on, and ripples by 4 % as teeth pass: the flat part remains."""
    t = np.linspace(0.0, 6.0, 4801)
    speed = np.interp(t, [0.0, 1.0, 4.0, 6.0], [2.0, 12.0, 12.0, 2.0])
    rippling = speed * (1.0 + 0.04 * np.cos(2.0 * np.pi * 19.1 * t))
    window = longest_constant(t, rippling, 2.0 / 19.1)
    assert 1.0 - 0.01 < window.start < 1.0 + 2 * 2.0 / 19.1
    assert 4.0 - 2 * 2.0 / 19.1 < window.end < 4.0 + 0.03
    whole = longest_constant(t, np.full(4801, 12.0), 0.1)
    assert (whole.start, whole.end) == pytest.approx((0.0, 6.0), abs=2e-3)


def test_tooth_orders_are_those_of_the_log(turning, shown, record, scaled):
    orders_are_those_of(record, shown)
    with Log(turning) as log:
        scaled(log, "/left_drive/out", "speed", 1.03)
    with pytest.raises(AssertionError):
        orders_are_those_of(record, page(turning))


# --- fatigue ---------------------------------------------------------------------------------------


def pulsating(path, size=1.0, scene=None):
    """Log of two links: ten cycles of 200 MPa at the outer fibre of the second, of 50 MPa elsewhere."""
    t = np.linspace(0.0, 1.0, 401)
    wave = 25e6 * np.cos(20.0 * np.pi * t)
    links = {f"link[{i}].fibre.{fibre}": wave for i in (1, 2) for fibre in ("outer", "inner")}
    links["link[2].fibre.outer"] = 4.0 * size * wave
    links |= {f"link[{i}].tension": wave for i in (1, 2)}
    return written(path, {"a.travel": t, "a.tension.max": t}, t, scene, links=links)


def fatigue_is_as_computed(html):
    row = re.search(r'id="fatigue">.*?<tbody><tr>(.*?)</tr>', html, re.S)[1]
    cells = re.findall(r"<td>(.*?)</td>", row)
    damage = 10.0 * (200e6 / 100e6) ** 3 / 2e6
    assert cells[:3] == ["a", "link 2", "outer"]
    assert float(cells[3].split()[0]) == pytest.approx(1.0 / 3600.0 / damage, rel=1e-3)
    assert [float(cell.replace("\N{MINUS SIGN}", "-")) for cell in cells[4:7]] == pytest.approx([damage, damage, 10.0])
    assert cells[7:9] == [quantity(200e6, "Pa"), quantity(200e6 * (10.0 / 2e6) ** (1.0 / 3.0), "Pa")]
    assert "mean along a link at its outer and inner fibre" in html
    assert "Stress is recorded every 2.5 ms (run.links); with every second record alone the most damaged" in html
    outer, inner = embedded(html)["charts"]["damage"]["traces"]
    assert unpacked(outer["y"])[1] == pytest.approx(damage, rel=1e-3)
    assert unpacked(inner["y"]) == pytest.approx([damage / 64.0] * 2, rel=1e-3)


def test_fatigue_is_miners_sum(tmp_path, monkeypatch):
    pytest.importorskip("rainflow")
    fatigue_is_as_computed(page(pulsating(tmp_path / "a.mcap")))
    with pytest.raises(AssertionError):
        fatigue_is_as_computed(page(pulsating(tmp_path / "b.mcap", 1.03)))
    texts = [hours(value) for value in (0.0123456, 12.3456, 9519120.4, 1.414e7)]
    assert texts == ["0.01235 h", "12.35 h", "9.519e6 h", "1.414e7 h"]
    rigid = page(pulsating(tmp_path / "c.mcap", scene={"track": {"model": "rigid"}}))
    monkeypatch.setitem(sys.modules, "rainflow", None)
    for html, reason in ((page(tmp_path / "a.mcap"), "rainflow is not installed"), (rigid, "have no stress")):
        assert 'id="fatigue"' not in html
        assert reason in html


def test_a_report_takes_an_own_line(tmp_path, cotrack):
    pytest.importorskip("plotly")
    log = pulsating(tmp_path / "a.mcap")
    cotrack.done("report", log, "--sn", "90 MPa,1e6,5", "-o", tmp_path / "a.html")
    html = (tmp_path / "a.html").read_text()
    damage = 10.0 * (200.0 / 90.0) ** 5 / 1e6
    assert f"<td>{number(damage, 3)}</td>" in html
    assert "S-N line: 1e+06 cycles at a stress range of 90 MPa, slope 5." in html


# --- sections and legends --------------------------------------------------------------------------


def test_a_section_that_does_not_apply_is_not_there(html, shown):
    anchors = [f'<a href="#{key}">' for key in ("turn", "orders", "fatigue")]
    assert [anchor in html for anchor in anchors] == [False] * 3
    assert [anchor in shown for anchor in anchors] == [True, True, False]
    assert embedded(html)["player"]["above"] is None
    assert ['id="above"' in each for each in (html, shown)] == [False, True]


def test_charts_of_the_same_curves_share_a_legend(shown):
    charts = embedded(shown)["charts"]
    keys = re.findall(r'data-trace="([\w ]+)" data-charts="([^"]+)"', shown)
    assert ("left", "torque sprocket-speed power slip") in keys
    assert ("right", "torque-orders tension-orders") in keys
    shared = {key for _, charts_of_entry in keys for key in charts_of_entry.split()}
    assert {"wheels-0", "wheels-1"} <= shared
    for key in shared:
        names = [trace["name"] for trace in charts[key]["traces"]]
        assert {name for name, of in keys if key in of.split()} == {*names}
        assert not charts[key]["named"]
    assert charts["tension"]["named"], "a chart alone keeps its legend"
    assert charts["pitch"]["named"], "no other chart has its curves"


# --- print -----------------------------------------------------------------------------------------


def test_charts_are_drawn_for_the_zoom_of_the_print():
    style, code = (files("orchestrator.results.page").joinpath(f"page.{kind}").read_text() for kind in ("css", "js"))
    zoom = re.search(r"\.chart, .*zoom: ([\d.]+);", style)[1]
    assert f"zoom: {zoom}," in code
    assert "@page { size: A4;" in style


CHROMIUM = shutil.which("chromium")


@pytest.mark.long
@pytest.mark.skipif(not CHROMIUM, reason="needs Chromium")
def test_a_page_prints_on_twelve_sheets_of_a4(turning, tmp_path):
    pytest.importorskip("plotly")
    report(turning, tmp_path / "a.html")
    command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}"]
    command += ["--virtual-time-budget=15000", f"--print-to-pdf={tmp_path / 'a.pdf'}", (tmp_path / "a.html").as_uri()]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    sheets = (tmp_path / "a.pdf").read_bytes()
    assert 5 < len(re.findall(rb"/Type\s*/Page\b", sheets)) <= 12
    width, height = map(float, re.search(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", sheets).groups())
    assert (width, height) == pytest.approx((595.3, 841.9), abs=1.0)
