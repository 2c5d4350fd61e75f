"""Turns, tooth orders, fatigue, shared legends and print of the page, computed again from the log."""

import base64
import html as markup
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
from made_logs import written
from report_pages import embedded, page, signal, unpacked, vehicle_page
from short_runs import falling_log, ran

from orchestrator.execution.log_report import report
from orchestrator.log.reader import Log
from orchestrator.results import turning as measures
from orchestrator.results.analyses import spectrum
from orchestrator.results.page.chain import longest_constant
from orchestrator.results.page.embedded import quantity
from orchestrator.results.page.player import ARROW_LENGTH, UNIT, above
from orchestrator.results.run_data import RunData, Window
from orchestrator.results.units import hours, number

SPEEDS = [f"drive.{side}.speed_points=[[0.05,0],[0.7,{speed}]]" for side, speed in (("left", 6), ("right", 9))]
SIDES = ("left", "right")
vehicle = pytest.fixture(scope="module")(falling_log)
html = pytest.fixture(scope="module")(vehicle_page)


@pytest.fixture(scope="module")
def turning(tmp_path_factory):
    """Log of a vehicle of rigid links that drives off and turns to the left at 6 and 9 rad/s."""
    return ran(tmp_path_factory, "turn", "rigid", ["run.stop=2 s", *SPEEDS])


@pytest.fixture(scope="module")
def shown(turning):
    """Its page."""
    return page(turning)


def value(cell):
    """SI value of a quantity in a cell."""
    size, unit = re.fullmatch(r"(\S+) (.+)", cell.replace("\N{MINUS SIGN}", "-")).groups()
    return float(size) * (1e3 if unit[0] == "k" else 1e-3 if unit[:2] == "mm" else 1.0)


@pytest.mark.long
def test_the_tension_of_the_vehicle_table_is_that_of_the_standing_vehicle(vehicle, turning):
    """As keys.md says: the m113 starts with it in equilibrium, and with 13.5 % more as drawn."""
    for path, more in ((vehicle, 1.135), (turning, 1.0)):
        with Log(path) as log:
            wanted = log.table("scene.json")["vehicle"]["track"]["tension"]
            assert signal(log, "left_track.tension.mean")[1][0] / wanted == pytest.approx(more, abs=3e-3)


# --- turns -----------------------------------------------------------------------------------------


def test_curves_of_a_turn_are_those_of_the_log(turning, shown):
    charts = embedded(shown)["charts"]
    with Log(turning) as log:
        yaw, rate = (signal(log, f"chassis.{name}")[1] for name in ("yaw", "chassis.angular_velocity.z"))
        forces = [[signal(log, f"{side}_track.ground.force.{axis}")[1] for axis in "xy"] for side in SIDES]
        left, right = (x * np.cos(yaw) + y * np.sin(yaw) for x, y in forces)
        arm = log.table("scene.json")["vehicle"]["track"]["lateral"]
        times, speed = signal(log, "chassis.speed")[0], [signal(log, f"chassis.chassis.velocity.{x}")[1] for x in "xy"]
    for key, place, values in (
        ("yaw-rate", 0, rate), ("moment", 0, 1e-3 * arm * (right - left)),
        ("thrust", 0, 1e-3 * left), ("thrust", 1, 1e-3 * right),
    ):  # fmt: skip
        drawn = unpacked(charts[key]["traces"][place]["y"])
        assert (drawn.min(), drawn.max()) == pytest.approx((values.min(), values.max()), rel=1e-6), key
    (trace,) = charts["radius"]["traces"]
    t, radius = unpacked(trace["t"]), unpacked(trace["y"])
    way, yaw = np.cumsum(np.hypot(*speed) * np.diff(times, prepend=0.0)), np.unwrap(yaw)
    for k in (int(np.abs(t - moment).argmin()) for moment in (1.1, 1.4, 1.7)):
        gone, turned = (np.ptp(np.interp([t[k] - 0.25, t[k] + 0.25], times, each)) for each in (way, yaw))
        assert radius[k] == pytest.approx(gone / turned, rel=2e-3)
    assert np.isnan(radius[0]), "at rest there is no radius"


def test_the_table_of_a_turn_has_the_measures_of_its_phase(turning, shown):
    table = re.search(r"<h3>By side</h3>.*?<tbody>(.*?)</tbody>", shown, re.S)[1]
    (row,) = re.findall(r"<tr>(.*?)</tr>", table, re.S)
    what, start, end, *cells = (markup.unescape(cell) for cell in re.findall(r"<td>(.*?)</td>", row, re.S))
    assert what == "<b>turn left</b>"
    with Log(turning) as log:
        run, window = RunData(log), Window(float(start) - 1e-6, float(end) + 1e-6)
        for cell, measure, sides in (
            (cells[0], measures.steering_moment, [""]), (cells[1], measures.rotation_centre, [""]),
            (cells[3], measures.propulsion, SIDES), (cells[4], measures.track_slip, SIDES),
            (cells[5], measures.drive_power, SIDES),
        ):  # fmt: skip
            found = [measure(run, side, window) for side in sides]
            assert [value(each) for each in cell.split("<br>")] == pytest.approx(found, rel=1e-3) != [0.0] * len(sides)


def from_above_is_that_of(log, tracks):
    view = above(RunData(log), np.array([2.0]))
    feet, arrows = (np.frombuffer(base64.b64decode(view[of]), "<i2").reshape(-1, 2) * UNIT for of in ("feet", "arrows"))
    assert view["counts"] == [len(feet)]
    t, x = signal(log, "chassis.chassis.position.x")
    row = int(np.abs(t - tracks[0].t[-1]).argmin())
    hull = [x[row], signal(log, "chassis.chassis.position.y")[1][row]]
    assert unpacked(view["hull"]) == pytest.approx(hull, abs=1e-6)
    found = []
    for series in tracks:
        pins, forces = (
            series.values[-1][[series.names.index(name.format(i + 1, axis)) for i in range(64) for axis in "xy"]]
            .reshape(64, 2) for name in ("joint[{}].position.{}", "link[{}].ground.force.{}")
        )  # fmt: skip
        found += zip(0.5 * (pins + np.roll(pins, -1, axis=0)) - hull, forces, strict=True)
    assert view["largest"] == pytest.approx(max(np.hypot(*force) for _, force in found))
    for place, force in found:
        if np.hypot(*force) > 0.03 * view["largest"]:
            k = np.linalg.norm(feet - place, axis=1).argmin()
            assert feet[k] == pytest.approx(place, abs=0.02), "a link's middle is between its pins"
            assert arrows[k] == pytest.approx(force * ARROW_LENGTH / view["largest"], abs=UNIT)


def test_links_from_above_stand_and_push_where_the_log_says(turning, scaled):
    with Log(turning) as log:
        tracks = [log.read(f"/{side}_track/links") for side in SIDES]
        from_above_is_that_of(log, tracks)
        names = [f"link[{i + 1}].ground.force.y" for i in range(64)]
        most = max(names, key=lambda name: abs(tracks[0].values[-1, tracks[0].names.index(name)]))
        scaled(log, "/left_track/links", most, 1.03)
    with Log(turning) as log, pytest.raises(AssertionError):
        from_above_is_that_of(log, tracks)


# --- tooth orders ----------------------------------------------------------------------------------


def test_tooth_orders_are_those_of_the_analysis_at_constant_speed(turning, shown):
    spans = r"(?:left )?(\S+) to (\S+) s(?:, right (\S+) to (\S+) s)?"
    note = re.search(f"constant speed, turn left, while [^:]*: {spans}", shown)
    spans, peaks = (note.groups()[:2], note.groups()[2:] if note[3] else note.groups()[:2]), []
    charts = embedded(shown)["charts"]
    with Log(turning) as log:
        for chart, name in (("torque-orders", "drive.torque"), ("tension-orders", "track.tension.max")):
            size = 1e3 if "k" in charts[chart]["y"] else 1.0
            for trace, side, span in zip(charts[chart]["traces"], SIDES, spans, strict=True):
                assert trace["name"] == side
                window = Window(float(span[0]) - 1e-6, float(span[1]) + 1e-6)
                speed = RunData(log).signal(f"{side}_drive.speed", window)[1]
                assert np.ptp(speed) < 0.03 * speed.mean()
                own = spectrum.of(RunData(log), f"{side}_{name}", window, orders=True)
                orders, amplitudes = unpacked(trace["t"]), size * unpacked(trace["y"])
                assert orders[-1] <= 8.0 < orders[-1] + orders[0]
                assert orders == pytest.approx(own.order[1 : len(orders) + 1], rel=1e-3)
                assert amplitudes == pytest.approx(own.amplitude[1 : len(orders) + 1, 0], rel=2e-3)
                k = int(np.argmax(np.where(orders > 0.5, amplitudes, 0.0)))
                peaks.append((amplitudes[k], orders[k], own.frequency[k + 1]))
    sentence = re.search(r"Largest: ([\d.]+ k?N m) at order ([\d.]+), ([\d.]+) Hz, (left|right)\.", shown)
    assert (value(sentence[1]), float(sentence[2]), float(sentence[3])) == pytest.approx(max(peaks[:2]), rel=6e-3)


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


# --- fatigue ---------------------------------------------------------------------------------------


def pulsating(path, scene=None):
    """Log of two links: ten cycles of 200 MPa at the outer fibre of the second, of 50 MPa elsewhere."""
    t = np.linspace(0.0, 1.0, 401)
    wave = 25e6 * np.cos(20.0 * np.pi * t)
    links = {f"link[{i}].fibre.{fibre}": wave for i in (1, 2) for fibre in ("outer", "inner")}
    links |= {f"link[{i}].tension": wave for i in (1, 2)} | {"link[2].fibre.outer": 4.0 * wave}
    return written(path, {"a.travel": t, "a.tension.max": t}, t, scene, links=links)


@pytest.mark.parametrize(("line", "damage", "equivalent"), [
    ("", 10.0 * (200e6 / 100e6) ** 3 / 2e6, 200e6 * (10.0 / 2e6) ** (1.0 / 3.0)),
    ("90 MPa,1e6,5", 10.0 * (200.0 / 90.0) ** 5 / 1e6, 200e6 * (10.0 / 1e6) ** 0.2),
])  # fmt: skip
def test_fatigue_is_miners_sum_by_the_default_or_an_own_line(tmp_path, cotrack, line, damage, equivalent):
    pytest.importorskip("rainflow")
    options = ("--sn", line) if line else ()
    cotrack.done("report", pulsating(tmp_path / "a.mcap"), *options, "-o", tmp_path / "a.html")
    html = (tmp_path / "a.html").read_text(encoding="utf-8")
    cells = re.findall(r"<td>(.*?)</td>", re.search(r'id="fatigue">.*?<tbody><tr>(.*?)</tr>', html, re.S)[1])
    assert cells[:3] == ["a", "link 2", "outer"]
    assert float(cells[3].split()[0]) == pytest.approx(1.0 / 3600.0 / damage, rel=1e-3)
    assert cells[4:] == [*[number(damage, 3)] * 2, "10", quantity(200e6, "Pa"), quantity(equivalent, "Pa")]
    stated = (
        "S-N line: 1e+06 cycles at a stress range of 90 MPa, slope 5." if line else "mean along a link at its outer"
    )
    for told in (stated, "Stress is recorded every 2.5 ms (run.links); with every second record alone the most"):
        assert told in html
    outer, inner = embedded(html)["charts"]["damage"]["traces"]
    assert unpacked(outer["y"])[1] == pytest.approx(damage, rel=1e-3)
    assert unpacked(inner["y"]) == pytest.approx([damage / 4.0 ** (5 if line else 3)] * 2, rel=1e-3)


def test_without_stress_or_the_library_the_page_says_why_there_is_no_fatigue(tmp_path, monkeypatch):
    texts = [hours(value) for value in (0.0123456, 12.3456, 9519120.4, 1.414e7)]
    assert texts == ["0.01235 h", "12.35 h", "9.519e6 h", "1.414e7 h"]
    rigid = page(pulsating(tmp_path / "c.mcap", {"track": {"model": "rigid"}}))
    monkeypatch.setitem(sys.modules, "rainflow", None)
    without = page(pulsating(tmp_path / "a.mcap"))
    for html, reason in ((without, "rainflow is not installed"), (rigid, "rigid links have no stress")):
        assert 'id="fatigue"' not in html
        assert reason in html


# --- sections --------------------------------------------------------------------------


def test_a_section_that_does_not_apply_is_not_there(html, shown):
    anchors = [f'<a href="#{key}">' for key in ("turn", "orders", "fatigue")]
    assert [anchor in html for anchor in anchors] == [False] * 3
    assert [anchor in shown for anchor in anchors] == [True, True, False]
    assert embedded(html)["player"]["above"] is None
    assert ['id="above"' in each for each in (html, shown)] == [False, True]


# --- print -----------------------------------------------------------------------------------------


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
