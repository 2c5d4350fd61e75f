"""Entries for vehicles beside or askew to grounds that have a profile along x for each side of y = 0."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from orchestrator.results.analyses import hull
from orchestrator.results.ground_axes import POSE
from orchestrator.results.ground_surface import on_terrain
from orchestrator.results.run_data import RunData
from orchestrator.results.validity import limits
from orchestrator.results.validity.exceedance import WARNING, Exceedance, excess
from orchestrator.results.validity.piece import Piece


def signals(run: RunData) -> Iterator[str]:
    """Signals: heading and place of the hull."""
    yield from POSE if on_terrain(run.scene) else ()


def find(piece: Piece) -> Iterator[Exceedance]:
    """Entries for a vehicle askew on roughness along x, and for one whose tracks leave their lanes; raises Missing."""
    run, scene = piece.run, piece.run.scene
    rough, waves = ((scene.get("ground") or {}).get(key) or {} for key in ("rough", "washboard"))
    rough = {} if rough.get("isotropic") else rough
    apart = (rough, not rough.get("correlated")), (waves, waves.get("phase"))
    lanes = [ground["start"] for ground, two in apart if ground and two]
    if not rough and not lanes:
        return
    t, pose = piece.columns([*POSE])
    reach = np.abs(np.subtract(scene["vehicle"]["road_wheel"]["x"], scene["vehicle"]["chassis"]["centre"][0])).max()
    askew, y, x = np.abs(np.sin(pose[:, 0])), np.abs(pose[:, 2]), pose[:, 1] + reach  # x of the foremost wheels along x
    found = []
    if rough:
        found.append(("askew", np.where(x > rough["start"], 1.0 - np.sqrt(1.0 - askew * askew), 0.0), limits.ASKEW))
    if lanes:
        from fmus.ground import BLEND  # loads the kernels of a terrain

        inner = hull.vehicle_number(run, "track", "lateral") - 0.5 * hull.vehicle_number(run, "track", "width")
        found.append(("lanes", np.where(x > min(lanes), y + reach * askew + BLEND - inner, 0.0), limits.LANE))
    for kind, values, limit in found:
        if (first_and_worst := excess(t, values, limit)) is not None:
            yield Exceedance(kind, "chassis", first_and_worst[0], "", first_and_worst[1], limit, WARNING)
