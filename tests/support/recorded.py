"""Small logs for tests of the log layer."""

import resource
import struct
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from orchestrator.log import recorder as module
from orchestrator.log.recorder import Recorder

STEP = 1e-3
TOPICS = {
    "/left_track/in": [
        ("sprocket.position.x", "m"),
        ("road_wheel[1].position.x", "m"),
        ("road_wheel[2].position.x", "m"),
    ],
    "/left_track/out": [("speed", "m/s"), ("tension.mean", "N")],
    "/left_track/links": [
        (f"link[{i}].{what}", unit) for i in range(1, 65) for what, unit in (("tension", "N"), ("stress", "Pa"))
    ],
    "/chassis/out": [
        ("speed", "m/s"),
        *((f"{side}.road_arm[{i}].angle", "rad") for side in ("left", "right") for i in range(1, 6)),
    ],
    "/stats/chassis": [("wall_time", "s")],
}
ATTACHMENTS = {"scene.json": b'{"name": "small"}', "chassis.modelDescription.xml": b"<fmiModelDescription/>" * 50}
METADATA = {"run": {"scene": "small", "step": "0.001"}, "versions": {"cotrack": "0.1.0"}}
EVERY = {"/left_track/links": 5}


def values(topic: str, k: int) -> np.ndarray:
    """Values of a topic at step k."""
    number = list(TOPICS).index(topic)
    return np.sin(np.arange(len(TOPICS[topic])) + 0.01 * k + number) * 10.0**number


def record(path: Path, steps: int = 100, wall: float = 0.0, change=lambda topic, k, row: row, **options) -> Path:
    """Write a log of ``steps`` steps; ``change`` may alter the values."""
    with Recorder(path, TOPICS, ATTACHMENTS, METADATA, every=EVERY, **options) as recorder:
        write_steps(recorder, steps, wall, change)
        recorder.close("ok", "", steps)
    return path


def record_in_chunks(path: Path, steps: int = 1500) -> Path:
    """Write a log of about ten chunks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "CHUNK", 80_000)
        return record(path, steps, flush=60)


def small_log(tmp_path_factory):
    """Log of 100 steps, a fixture's."""
    return record(tmp_path_factory.mktemp("logs") / "small.mcap")


def chunked_log(tmp_path_factory):
    """Log in several chunks, a fixture's."""
    return record_in_chunks(tmp_path_factory.mktemp("logs") / "chunked.mcap")


def write_steps(recorder: Recorder, steps: int, wall: float = 0.0, change=lambda topic, k, row: row) -> None:
    """Write steps 0 to ``steps``."""
    for k in range(steps + 1):
        for topic in TOPICS:
            if topic.startswith("/stats/"):
                recorder.write("/stats/chassis", k, k * STEP, STEP, np.array([wall + k]))
            else:
                recorder.write(topic, k, k * STEP, STEP, change(topic, k, values(topic, k)))


def spans(data: bytes) -> list[tuple[int, int, float, float]]:
    """Chunks of a file with the indexes behind them: begin and end, bytes; first and last time, s."""
    found, offset = [], 8
    while offset < len(data) - 8:
        kind, length = struct.unpack_from("<BQ", data, offset)
        if kind == 0x06:
            times = (1e-9 * t for t in struct.unpack_from("<QQ", data, offset + 9))
            found.append((offset, offset + 9 + length, *times))
        elif kind == 0x07:
            found[-1] = found[-1][0], offset + 9 + length, *found[-1][2:]
        offset += 9 + length
    return found


@contextmanager
def disk(room: int):
    """A disk on which no file grows beyond ``room`` bytes."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


STRIDES = {"/a/in": 1, "/a/out": 3, "/a/links": 7, "/b/in": 1, "/b/out": 1, "/stats/a": 1}


def ragged(path: Path, steps: int = 60, results: dict[str, str] | None = None) -> Path:
    """Write a log as a run does, topic after topic, in chunks that end anywhere in a step."""
    topics = {topic: [("x", "m"), ("y", "m")] for topic in STRIDES}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "CHUNK", 500)
        with Recorder(path, topics, ATTACHMENTS, {}, every=STRIDES, flush=60) as recorder:
            for k in range(steps + 1):
                for name in ("a", "b"):
                    if k:
                        recorder.write(f"/{name}/in", k - 1, (k - 1) * STEP, STEP, np.array([k, 0.0]))
                    recorder.write(f"/{name}/out", k, k * STEP, STEP, np.array([k, 1.0]))
                recorder.write("/a/links", k, k * STEP, STEP, np.array([k, 2.0]))
                if k % 10 == 0:
                    recorder.write("/stats/a", k, k * STEP, STEP, np.array([k, 3.0]))
            recorder.close("ok", "done", steps, results)
    return path
