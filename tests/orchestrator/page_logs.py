"""Runs and made-up logs whose pages the tests read, and the page of a log."""

import json
import re

from made_logs import of_columns

from orchestrator.execution.log_report import _judge
from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.results.ground_surface import ground
from orchestrator.results.page.document import document
from orchestrator.results.page.evaluation import evaluate
from orchestrator.results.run_data import RunData
from orchestrator.scene.scene import load

PLOTS = "/* plotly.js v0 */"  # replaces the library
HOSTILE = "</script><b onload='x()'>&\"\u2028<img src=https://example.org/x.png>"
# the vehicle falls onto its springs, so that there is motion
BUMP = "ground.bump={start=0.5, rise=0.2, slope=0.35, length=0.6, radius=0.15}"
SETTINGS = ["run.stop=0.06 s", "start.state=drawn", BUMP]
CHECKS = ("sag", "sag_discrete", "tension", "tension_discrete")
HANGING = ["run.stop=0.02 s", *(f"expect.{name}.{end}" for name in CHECKS for end in ("from=0 s", "to=0.02 s"))]


def vehicle_log(tmp_path_factory):
    """Log of a vehicle of rigid links that falls onto its springs."""
    path = tmp_path_factory.mktemp("page") / "vehicle.mcap"
    assert simulate(load("straight", "rigid", SETTINGS), path)["status"] == "ok"
    return path


def hanging_log(tmp_path_factory):
    """Log of a short run of a hanging chain, with its checks."""
    path = tmp_path_factory.mktemp("page") / "hanging.mcap"
    assert simulate(load("hanging_chain", "flexible", HANGING), path)["status"] == "ok"
    return path


def page(path, reference=None):
    with Log(path) as log:
        run = RunData(log)
        other = None
        if reference:
            with Log(reference) as second:
                known = RunData(second)
                return document(evaluate(run, _judge(run)), evaluate(known, _judge(known)), PLOTS)
        return document(evaluate(run, _judge(run)), other, PLOTS)


def embedded(html):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)[1])


def signal(log, name):
    topic, column = log.find(name)
    series = log.read(topic)
    return series.t, series.values[:, column]


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
