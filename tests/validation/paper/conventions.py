"""Conventions for details that the paper leaves open.

The first joint is the one between links 1 and 2, pin 2 here, because the cut of an open chain is pin 1; its force is
that on the link that begins there, along the chassis (ahead) and normal to it (up). The end point of link 31 is pin 32.
Links are numbered backwards over the ground: from the sprocket in front down to the ground, to the idler, and ahead
along the upper run. The slack section leads from the middle of the sprocket's wrap to the first road wheel, the
transition over the ground and round the idler, the tight section is the upper run on to the middle of that wrap.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.analyses import circuit
from orchestrator.results.rotation import matrices
from orchestrator.results.run_data import RunData, Window

SIDE = "right"
TRACK = f"{SIDE}_track"
FIRST = 2  # pin of the first joint
NODE = 32  # pin of figures 14 and 15: the end point of link 31
LINK = 1  # of figures 18 and 19
INSTANT = 5.0  # s, of figures 18 to 21
AROUND = Window(4.0, 6.0)  # s, of means around the instant
HOLD = Window(6.0, 8.0)  # s, at constant speed of the sprockets
TURNING = Window(2.0, 8.0)  # s, sprockets in motion
SECTIONS = SLACK, TRANSITION, TIGHT = "slack", "transition", "tight"


def in_chassis(run: RunData, t: Floats, vectors: Floats, placed: bool) -> Floats:
    """Vectors (m, 3) in the axes of the chassis; with ``placed`` positions from its centre of mass, m."""
    times, centre = run.vectors("chassis", "out", "chassis.position")
    _, q = run.vectors("chassis", "out", "chassis.orientation", "wxyz")
    at = np.clip(np.searchsorted(times, t - 1e-9), 0, len(times) - 1)
    return np.asarray(np.einsum("mi,mij->mj", vectors - (centre[at] if placed else 0.0), matrices(q[at])))


def edges(vehicle: Mapping[str, Any], placed: circuit.PlacedRecords) -> tuple[float, float, float, float]:
    """Limits of the ``SECTIONS`` in the first record, in order, m along the circuit."""
    place, (ahead, up), length = placed.links[0], placed.centres[0].T, float(placed.length[0])
    low = up < vehicle["road_wheel"]["z"]
    ground = place[low & (ahead < vehicle["road_wheel"]["x"][0])]
    upper = place[~low & (ahead > vehicle["idler"]["x"]) & (place > 0.5 * length)]
    return 0.0, float(ground.min()), float(upper.min()), length
