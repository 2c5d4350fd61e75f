"""The page of a log: its text, its numbers, and the signals that they show."""

import base64
import json
import re
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest import mock

import numpy as np

from orchestrator.execution import log_report
from orchestrator.results.ground_surface import ground
from orchestrator.results.page import document
from orchestrator.results.run_data import RunData

HOSTILE = "</script><b onload='x()'>&\"\u2028<img src=https://example.org/x.png>"


def page(path, reference=None):
    """HTML of the page of a log, without the library that draws its curves."""
    with TemporaryDirectory() as folder:
        written_page = Path(folder) / "x.html"
        with mock.patch.multiple(document, plotting=str), mock.patch.multiple(log_report, plotting=str):
            log_report.report(path, written_page, reference, different=True)
        return written_page.read_text(encoding="utf-8")


def embedded(html):
    """Data in the text of a page."""
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)[1])


def charts_of(path, reference=None):
    """Charts in the page of a log."""
    return embedded(page(path, reference))["charts"]


def signal(log, name):
    """Times and values of a signal."""
    topic, column = log.find(name)
    series = log.read(topic)
    return series.t, series.values[:, column]


def change(log, name):
    """Last value of a signal less its first one."""
    values = signal(log, name)[1]
    return values[-1] - values[0]


def side_of_links(log):
    """Times of links, pins ahead of the axle and above the ground (m, 64), and the axle (m,), m."""
    series = log.read("/left_track/links")
    x, z = (
        series.values[:, [series.names.index(f"joint[{i + 1}].position.{axis}") for i in range(64)]] for axis in "xz"
    )
    axle = log.sample(["left_drive.sprocket.position.x"], series.t)[:, 0]  # also at the end, where no step begins
    return series.t, x - axle[:, None], z - ground(RunData(log).scene).level, axle


PAGES = {}  # by log


def vehicle_page(vehicle):
    """HTML of the page of the log of the vehicle, which all modules of a process share."""
    if vehicle not in PAGES:
        PAGES[vehicle] = page(vehicle)
    return PAGES[vehicle]


def unpacked(content):
    """Array (m,) of float32 that a page holds as base64."""
    return np.frombuffer(base64.b64decode(content), "<f4")
