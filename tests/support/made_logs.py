"""Logs of made-up signals."""

import json

import numpy as np

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
