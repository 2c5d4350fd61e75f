"""Short runs for tests of views: a vehicle on a bump, one on a terrain, and an open chain; files of Foxglove."""

import numpy as np

from orchestrator.execution.simulate import simulate
from orchestrator.log.reader import Log
from orchestrator.log.recorder import Recorder
from orchestrator.results.run_data import RunData
from orchestrator.results.views.bodies import Bodies
from orchestrator.scene.scene import load

STEP = 1e-3
SHOWN = (
    f"run.step={STEP}", "run.links=1", "expect={}", "start.state=drawn", "start.heading=0.4",
    "start.position=[1.0, -2.0, 0.3]",
    'track.link_outputs=["tension", "position", "ground", "sliding", "depth", "axis"]',
)  # fmt: skip
BUMP = "ground.bump={start=-2.4, rise=0.01, slope=0.1, length=0.5, radius=0.02}"
TERRAIN = "ground.grade=0.2", "ground.bank=-0.1", "ground.half_round={x=[-1.0], radius=0.05}"


RAN = {}  # by scene, model and settings


def ran(tmp_path_factory, name, model, settings):
    """Log of a run, which all modules of a process share."""
    key = name, model, tuple(settings)
    if key not in RAN:
        RAN[key] = tmp_path_factory.mktemp(name) / "run.mcap"
        simulate(load(name, model, settings), RAN[key])
    return RAN[key]


def driven_log(tmp_path_factory):
    """Log of a vehicle that settles on a low bump, turned by 0.4 rad; links are recorded at each step."""
    return ran(tmp_path_factory, "straight", "flexible", (*SHOWN, "run.stop=0.04", BUMP))


def terrain_log(tmp_path_factory):
    """Log of a vehicle of rigid links that falls on a slope, banked, with a half round under its wheels."""
    return ran(tmp_path_factory, "straight", "rigid", (*SHOWN, "run.stop=0.02", *TERRAIN))


def hanging_log(tmp_path_factory):
    """Log of an open chain, without wheels, hull and ground."""
    settings = ("run.stop=0.02", "chain.links=8", "run.links=5", "expect={}")
    return ran(tmp_path_factory, "hanging_chain", "flexible", settings)


def bodies_of(driven):
    """Open log of the vehicle, its bodies and their poses at every record."""
    with Log(driven) as log:
        bodies = Bodies(RunData(log), 1e4)
        yield log, bodies, next(bodies.blocks())


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


def decoded(path, topic):
    """Messages of a topic, decoded by the schema in the file."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
    from mcap.reader import make_reader

    messages = []
    with path.open("rb") as file:
        for schema, _, message in make_reader(file).iter_messages(topic):
            pool = descriptor_pool.DescriptorPool()
            for each in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
                pool.Add(each)
            kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
            messages.append(kind.FromString(message.data))
    return messages
