"""One track from the side, picture after picture, for the player of the page."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from orchestrator.log.reader import NoSuchSignal
from orchestrator.log.time_series import Floats
from orchestrator.results.analyses.hull import matrices
from orchestrator.results.ground_profile import Ground, ground
from orchestrator.results.page.chain import Chain
from orchestrator.results.page.embedded import floats, shorts
from orchestrator.results.page.signals import wheels
from orchestrator.results.run_data import EVER, RunData, pitch_radius

RATE = 25.0  # pictures a second at most
MOST = 500  # pictures
UNIT = 5e-4  # m: of places, in whole numbers of two bytes up to 16 m
MARGIN = 0.15  # m round what is drawn
ABOVE = 0.4  # m over the chain at most: hulls are high


class Plane(NamedTuple):
    """The plane of a track as it moves: ahead of its sprocket's axle and up."""

    origin: Floats  # (m, 3) m, the axle of the sprocket, or where the scene starts without one
    ahead: Floats  # (m, 3) unit vector, level, across the axle

    def seen(self, places: Floats) -> Floats:
        """Places (m, ..., 3) of the world as ahead of and above the origin, (m, ..., 2) m."""
        between = (slice(None), *(None,) * (places.ndim - 2))
        offset = places - self.origin[between]
        return np.stack([np.sum(offset * self.ahead[between], axis=-1), offset[..., 2]], axis=-1)


def side_view(run: RunData, found: Chain, reference: tuple[RunData, Chain] | None = None) -> dict[str, Any]:
    """What the player draws, over it the chain of a reference.

    Raises LogUnreadable, and LookupError for what is not recorded.
    """
    at = found.columns
    if len(at.position) < len(at.tension):
        raise LookupError("places of pins were not recorded")
    rows = _rows(found.t)
    t = found.t[rows]
    position, tension = _records(run, found, rows)
    of = Plane(*run.axle(found.track, t, EVER))
    bodies = [body for name in wheels(run, found.track) if (body := _wheel(run, found.track, name, of, t))]
    below = _ground(run)
    shift = _shift(of, below)
    pins = _over(of.seen(position), shift)
    for body in bodies:
        body["centre"][..., 1] += shift[:, 0]
    finite = pins[np.isfinite(pins).all(axis=(1, 2))]
    if not len(finite):
        raise LookupError("places of pins are no finite numbers")
    hull = _hull(run, of, t, shift[:, 0])
    shown_places = finite.reshape(-1, 2) if hull is None else np.vstack([finite.reshape(-1, 2), hull.reshape(-1, 2)])
    low, high = np.nanmin(shown_places, axis=0) - MARGIN, np.nanmax(shown_places, axis=0) + MARGIN
    high[1] = min(high[1], finite[..., 1].max() + ABOVE)
    shown = tension[np.isfinite(tension)]
    return {
        "track": found.track,
        "t": floats(t),
        "pictures": len(t),
        "links": len(at.tension),
        "pins": shorts(pins, UNIT),
        "pinCount": len(at.position),
        "unit": UNIT,
        "tension": floats(tension),
        "least": min(0.0, float(np.min(shown, initial=0.0))),
        "most": float(np.max(shown, initial=1.0)),
        "low": low.tolist(),
        "high": high.tolist(),
        "face": _face(run.scene),
        "wheels": [{**body, "centre": shorts(body["centre"], UNIT), "angle": floats(body["angle"])} for body in bodies],
        "hull": None if hull is None else shorts(hull, UNIT),
        "ground": _drawn(below, of) if below else None,
        "speed": _speed(run, t),
        "reference": outline(*reference, t) if reference else None,
    }


def outline(run: RunData, found: Chain, t: Floats) -> dict[str, Any]:
    """The pins of a chain at the times (m,) of another run's pictures, as far as its record goes.

    Raises LogUnreadable, and LookupError for what is not recorded.
    """
    shown = t[t <= found.t[-1] + 0.5 / RATE]
    rows = _nearest(found.t, shown)
    of = Plane(*run.axle(found.track, found.t[rows], EVER))
    pins = _over(of.seen(_records(run, found, rows)[0]), _shift(of, _ground(run)))
    return {
        "pictures": len(rows),
        "pins": shorts(pins, UNIT),
        "pinCount": len(found.columns.position),
        "closed": found.columns.closed,
    }


def _shift(of: Plane, below: Ground | None) -> Floats:
    """What is added to heights over the axle (m, 1), m: they are shown over the ground, or over the first axle."""
    shift: Floats = (of.origin[:, 2] - (below.level if below else of.origin[0, 2]))[:, None]
    return shift


def _over(pins: Floats, shift: Floats) -> Floats:
    return np.stack([pins[..., 0], pins[..., 1] + shift], axis=-1)


def _rows(t: Floats) -> Floats:
    """Which records are shown."""
    span = float(t[-1] - t[0])
    count = int(np.clip(span * RATE, 1, MOST - 1)) if span > 0.0 else 0
    return np.unique(_nearest(t, np.linspace(t[0], t[-1], count + 1)))


def _nearest(t: Floats, wanted: Floats) -> Floats:
    """Of records at times ``t`` (m,) those nearest to the wanted times (k,)."""
    after = np.clip(np.searchsorted(t, wanted), 1, max(len(t) - 1, 1))
    nearest = np.where(wanted - t[after - 1] < t[np.minimum(after, len(t) - 1)] - wanted, after - 1, after)
    return np.clip(nearest, 0, len(t) - 1)


def _records(run: RunData, found: Chain, rows: Floats) -> tuple[Floats, Floats]:
    """Places of pins (m, pins, 3) and tensions (m, links) in some records."""
    at = found.columns
    topic, done = f"/{found.track}/links", 0
    kept = []
    for piece in run.log.stream({topic: [*at.tension, *(k for pin in at.position for k in pin)]}):
        values = piece[topic].values
        inside = rows[(rows >= done) & (rows < done + len(values))]
        kept.append(values[inside - done])
        done += len(values)
    whole = np.concatenate(kept)
    return whole[:, len(at.tension) :].reshape(len(whole), -1, 3), whole[:, : len(at.tension)]


def _wheel(run: RunData, track: str, name: str, of: Plane, t: Floats) -> dict[str, Any] | None:
    """A wheel as drawn, None where the log or its scene does not have it."""
    kind = name.partition("[")[0]
    try:
        vehicle = run.scene["vehicle"]
        teeth = int(vehicle["sprocket"]["teeth"]) if kind == "sprocket" else 0
        radius = pitch_radius(vehicle) if teeth else float(vehicle[kind]["radius"])
        pose = _poses(run, f"{track}.{name}", t)
    except (NoSuchSignal, LookupError, TypeError, ValueError):
        return None
    spoke = matrices(pose[:, 3:])[..., 0]
    angle = np.arctan2(spoke[:, 2], np.sum(spoke * of.ahead, axis=1))
    body = {"radius": radius, "centre": of.seen(pose[:, :3]), "angle": angle}
    if teeth:
        sprocket = vehicle["sprocket"]
        body |= {"teeth": min(teeth, 100), "outer": float(sprocket["outer_radius"])}
        body["root"] = radius - float(sprocket["pin_radius"])
    return body


def _face(scene: dict[str, Any]) -> float:
    try:
        return float(np.clip(scene["vehicle"]["track"]["face"], 0.01, 1.0))
    except (LookupError, TypeError, ValueError):
        return 0.01


def _hull(run: RunData, of: Plane, t: Floats, shift: Floats) -> Floats | None:
    """Corners of the hull (m, corners, 2), in order."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        body = run.scene["vehicle"]["chassis"]
        corners = np.array(body["hull"], float) - np.array(body["centre"], float)
        outline = corners[ConvexHull(corners[:, [0, 2]]).vertices]
        outline[:, 1] = 0.0
        pose = _poses(run, "chassis.chassis", t)
    except (LookupError, TypeError, ValueError, QhullError):
        return None
    places = pose[:, None, :3] + np.einsum("mij,kj->mki", matrices(pose[:, 3:]), outline)
    seen = of.seen(places)
    seen[..., 1] += shift[:, None]
    return seen


def _poses(run: RunData, body: str, t: Floats) -> Floats:
    """Places, m, and quaternions w, x, y, z (m, 7) of a body at times (m,); raises NoSuchSignal, LogUnreadable."""
    parts = [f"position.{axis}" for axis in "xyz"] + [f"orientation.{axis}" for axis in "wxyz"]
    return run.log.sample([f"{body}.{part}" for part in parts], t)


def _ground(run: RunData) -> Ground | None:
    try:
        return ground(run.scene)
    except (LookupError, TypeError, ValueError):
        return None


def _drawn(below: Ground, of: Plane) -> dict[str, Any]:
    """The corners of a bump over the level part, and how far along the plane's origin is, m."""
    if len(below.along):
        along = (of.origin - below.start) @ below.ahead
    else:  # marks that pass by are all there is to see: along the way itself, whichever turns it takes
        way = np.sum(np.diff(of.origin, axis=0) * of.ahead[1:], axis=1)
        along = np.concatenate([[0.0], np.cumsum(way)])
    return {
        "corners": [[float(a), float(z - below.level)] for a, z in zip(below.along, below.height, strict=True)],
        "along": floats(along),
    }


def _speed(run: RunData, t: Floats) -> str | None:
    try:
        return floats(run.log.sample(["chassis.speed"], t)[:, 0])
    except NoSuchSignal:
        return None
