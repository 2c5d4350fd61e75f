"""Logs of the acceleration of a seat."""

import numpy as np
from made_logs import made
from scipy.spatial.transform import Rotation

TURNED = Rotation.from_euler("ZYX", [0.7, 0.2, -0.1])
MOTION = [("seat.driver.acceleration." + axis, "m/s2") for axis in "xyz"]
ATTITUDE = [("chassis.orientation." + part, "1") for part in "wxyz"]


def seat_log(folder, own, t, names=MOTION + ATTITUDE):
    """Log of a seat with accelerations ``own`` (m, 3) in the axes of a hull that is turned, pitched and rolled."""
    q = np.tile(TURNED.as_quat(scalar_first=True), (len(t), 1))
    rows = {"/chassis/out": (t, np.hstack([TURNED.apply(own), q])[:, : len(names)])}
    return made(folder / "seat.mcap", {"/chassis/out": names}, rows, instances=("chassis",))


def sines(t):
    """Accelerations (m, 3), m/s2: 2 at 2 Hz ahead, 5 at 4.5 Hz up."""
    return np.stack([2.0 * np.sin(2 * np.pi * 2.0 * t), 0.0 * t, 5.0 * np.sin(2 * np.pi * 4.5 * t)], axis=1)
