"""Logs made of arrays."""

import json

import numpy as np
from scipy.spatial.transform import Rotation

from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder

STEP = 1e-3  # s


def made(
    path,
    topics,
    rows,
    scene=None,
    instances=("track",),
    connections=(),
    step=STEP,
    every=None,
    metadata=None,
    **closing,
):
    """Write a log of topics: for each its variables and units, and its times with values (m, variables).

    ``closing``: what is recorded at the end, by default that the run ended well.
    """
    system = {"instances": [{"name": name} for name in instances], "connections": list(connections)}
    files = {"scene.json": json.dumps(scene or {}).encode(), "system.json": json.dumps(system).encode()}
    arrays = {topic: np.ascontiguousarray(values, float) for topic, (_, values) in rows.items()}
    moments = [(float(t), k, topic) for topic, (times, _) in rows.items() for k, t in enumerate(times)]
    with Recorder(path, topics, files, metadata or {}, every=every) as recorder:
        for t, k, topic in sorted(moments, key=lambda moment: moment[0]):  # of one instant in the order of topics
            recorder.write(topic, k, t, step, arrays[topic][k])
        steps = max(map(len, arrays.values()))
        recorder.close(**{"status": "ok", "message": "", "steps": steps} | closing)
    return path


def of_columns(path, columns, t, scene=None, connections=(), unit="1", **options):
    """Write a log of signals "instance.variable", also of links, at times (m,), equally spaced if no step is given."""
    topics, names = {}, {}
    for name in columns:
        instance, _, variable = name.partition(".")
        topic = f"/{instance}/{'links' if variable.startswith(('joint[', 'link[')) else 'out'}"
        topics.setdefault(topic, []).append((variable, unit))
        names.setdefault(topic, []).append(name)
    rows = {topic: (t, np.stack([columns[name] for name in each], axis=1)) for topic, each in names.items()}
    options = {"step": float(t[1] - t[0])} | options
    instances = dict.fromkeys(topic.split("/")[1] for topic in topics)
    return made(path, topics, rows, scene, instances, connections, **options)


def written(path, columns, t, scene=None, closed="ok", links=None, **options):
    """Write a log of outputs by instance and name; ``links`` are link outputs of "a"."""
    columns = columns | {f"a.{name}": values for name, values in (links or {}).items()}
    message = "" if closed == "ok" else "it blew up"
    return of_columns(path, columns, t, scene, unit="N", step=1e-3, status=closed, message=message, **options)


def stretched(log, path, times, blown=None):
    """Log of links at these times, with the first record of another log moved to the right by 1 m/s.

    From record ``blown`` on the positions are NaN.
    """
    with Log(log) as whole:
        links = whole.read("/chain/links")
        about = whole.topics["/chain/links"]
        attachments = {name: whole.attachment(name) for name in ("scene.json", "system.json")}
        topics = {"/chain/links": list(zip(about.names, about.units, strict=True))}
        with Recorder(path, topics, attachments, whole.metadata) as recorder:
            x = np.array([name.endswith("position.x") for name in about.names])
            for k, t in enumerate(times):
                way = float("nan") if blown is not None and k >= blown else float(t)
                recorder.write("/chain/links", k, float(t), 0.1, links.values[0] + way * x)
            recorder.close("ok", "", len(times))
    return path


TURNED = Rotation.from_euler("ZYX", [0.7, 0.2, -0.1])
SEAT_MOTION = [("seat.driver.acceleration." + axis, "m/s2") for axis in "xyz"]
ATTITUDE = [("chassis.orientation." + part, "1") for part in "wxyz"]


def seat_log(folder, own, t, names=SEAT_MOTION + ATTITUDE):
    """Log of a seat with accelerations ``own`` (m, 3) in the axes of a hull that is turned, pitched and rolled."""
    q = np.tile(TURNED.as_quat(scalar_first=True), (len(t), 1))
    rows = {"/chassis/out": (t, np.hstack([TURNED.apply(own), q])[:, : len(names)])}
    return made(folder / "seat.mcap", {"/chassis/out": names}, rows, instances=("chassis",))


def sines(t):
    """Accelerations (m, 3), m/s2: 2 at 2 Hz ahead, 5 at 4.5 Hz up."""
    return np.stack([2.0 * np.sin(2 * np.pi * 2.0 * t), 0.0 * t, 5.0 * np.sin(2 * np.pi * 4.5 * t)], axis=1)
