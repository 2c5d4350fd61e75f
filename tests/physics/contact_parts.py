"""A contact law, teeth, a bump and a wheel in motion, for the tests of contacts."""

from __future__ import annotations

import numpy as np

from fmus.physics.contact.ground import bumpy_ground
from fmus.physics.contact.linear import Linear
from fmus.physics.contact.teeth import teeth
from fmus.physics.wheels import WIDTH

LAW = Linear(2e6, 5e3, 0.3, 0.05)
PITCH = 0.1524
TEETH = teeth(10, PITCH, 0.015, 0.26, 0.004, np.radians(25.0), 0.01)
BUMP = bumpy_ground(0.01, 0.4, 0.5, 0.6, 0.8, 0.3)  # from x = 0.4


def wheel_row(tilt: float = 0.0) -> np.ndarray:
    row = np.zeros(WIDTH)
    row[0:3] = 0.3, 0.02, -0.1
    row[3:6] = 1.0, 0.1, -0.2
    row[6:9] = 0.2, 3.0, -0.1
    row[9:12] = np.array([0.0, np.cos(tilt), np.sin(tilt)])
    row[12:15] = 1.0, 0.0, 0.0
    return row
