"""A made-up log of a sprocket and its chain, and the entries of a log in the validity ledger."""

import numpy as np
from made_logs import of_columns

from orchestrator.log.reader import Log
from orchestrator.results.analyses import validity
from orchestrator.results.run_data import RunData
from orchestrator.scene.scene import load

TEETH, LINKS = 10, 64
EVERY = 5e-3  # s, between records of pins


def vehicle():
    return load("straight").vehicle.model_dump(mode="json")


def entries_of(path):
    with Log(path) as log:
        return validity.of(RunData(log)).entries


SPROCKET = {
    "source": "left_track", "outputs": ["sprocket.force.x", "sprocket.torque.x"],
    "target": "left_drive", "inputs": ["sprocket.force.x", "sprocket.torque.x"],
}  # fmt: skip


def running(path, turned, off, turn=0.0, middle=(1.0, 2.0, 3.0), gaps=1, lugs=1):
    """Log of a sprocket that has ``turned`` (m,) rad and a chain ``off`` (m,) pitches from its gaps.

    It takes TEETH pins a turn, each in one of so many ``gaps``, or of so many pins one with ``lugs``.
    """
    table = vehicle()
    table["sprocket"] |= {"teeth": gaps * TEETH // lugs, "gaps_per_pin": gaps, "pins_per_gap": lugs}
    step = 2.0 * np.pi / TEETH
    radius = table["track"]["pitch"] / (2.0 * np.sin(np.pi / TEETH))
    t = EVERY * np.arange(len(turned))
    place = np.arange(LINKS) * step + turned[:, None] + off[:, None] * step
    place = (place + 0.5 * LINKS * step) % (LINKS * step) - 0.5 * LINKS * step  # along the loop, 0 at the front
    wrapped = np.abs(place) < 0.5 * np.pi
    angle = np.clip(place, -0.5 * np.pi, 0.5 * np.pi)
    behind = np.where(wrapped, 0.0, (np.abs(place) - 0.5 * np.pi) * radius)
    x, z = radius * np.cos(angle) - behind, -radius * np.sin(angle)
    c, s = np.cos(turn), np.sin(turn)  # about +y
    travel = table["track"]["pitch"] * (turned / step + off)
    columns = {"left_drive.angle": turned, "left_track.travel": travel}
    columns |= {
        f"left_drive.sprocket.position.{axis}": np.full(len(t), at) for axis, at in zip("xyz", middle, strict=True)
    }
    for j in range(LINKS):
        pin = c * x[:, j] + s * z[:, j], np.zeros(len(t)), c * z[:, j] - s * x[:, j]
        columns |= {
            f"left_track.joint[{j + 1}].position.{a}": p + m for a, p, m in zip("xyz", pin, middle, strict=True)
        }
    columns["left_track.sprocket.force.x"] = t
    return of_columns(path, columns, t, {"assembly": "rig", "vehicle": table, "run": {"step": EVERY}}, [SPROCKET])
