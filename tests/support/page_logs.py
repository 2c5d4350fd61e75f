"""Runs and made-up logs whose pages the tests read, and the page of a log."""

import json
import re
import warnings
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest import mock

from made_logs import of_columns
from view_logs import ran

from orchestrator.execution import log_report
from orchestrator.log.notices import LogNotice
from orchestrator.results.ground_surface import ground
from orchestrator.results.page import document
from orchestrator.results.run_data import RunData

HOSTILE = "</script><b onload='x()'>&\"\u2028<img src=https://example.org/x.png>"
# the vehicle falls onto its springs, so that there is motion
BUMP = "ground.bump={start=0.5, rise=0.2, slope=0.35, length=0.6, radius=0.15}"
SETTINGS = ["run.stop=0.06 s", "start.state=drawn", BUMP]
CHECKS = ("sag", "sag_discrete", "tension", "tension_discrete")
HANGING = ["run.stop=0.02 s", *(f"expect.{name}.{end}" for name in CHECKS for end in ("from=0 s", "to=0.02 s"))]


def vehicle_log(tmp_path_factory):
    """Log of a vehicle of rigid links that falls onto its springs."""
    return ran(tmp_path_factory, "straight", "rigid", SETTINGS)


def hanging_log(tmp_path_factory, *settings):
    """Log of a short run of a hanging chain, with its checks."""
    return ran(tmp_path_factory, "hanging_chain", "flexible", [*HANGING, *settings])


def page(path, reference=None):
    """HTML of the page of a log, without the library that draws its curves."""
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", LogNotice)
        written_page = Path(folder) / "x.html"
        with mock.patch.multiple(document, plotting=str), mock.patch.multiple(log_report, plotting=str):
            log_report.report(path, written_page, reference, different=True)
        return written_page.read_text(encoding="utf-8")


def embedded(html):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)[1])


def charts_of(path, reference=None):
    return embedded(page(path, reference))["charts"]


def signal(log, name):
    topic, column = log.find(name)
    series = log.read(topic)
    return series.t, series.values[:, column]


def change(log, name):
    """Last value of a signal less its first one."""
    values = signal(log, name)[1]
    return values[-1] - values[0]


def written(path, columns, t, scene=None, closed="ok", links=None, **options):
    """Write a log of outputs by instance and name; ``links`` are link outputs of "a"."""
    columns = columns | {f"a.{name}": values for name, values in (links or {}).items()}
    message = "" if closed == "ok" else "it blew up"
    return of_columns(path, columns, t, scene, unit="N", step=1e-3, status=closed, message=message, **options)


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
