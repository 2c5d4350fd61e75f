"""Pictures for the player of the page: one track from the side, the vehicle from above."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from orchestrator.log.time_series import Floats
from orchestrator.results.ground_surface import GroundSurface, gives_way
from orchestrator.results.page.embedded import floats, shorts
from orchestrator.results.rotation import body_axis, matrices
from orchestrator.results.run_data import RunData
from orchestrator.results.views.bodies import EVERY, Bodies, BodyPose, LinkPoses, Poses
from orchestrator.results.views.colours import PART
from orchestrator.results.views.pose_columns import nearest
from orchestrator.results.views.projected import Camera, section, side_camera
from orchestrator.results.views.ruts import ground_at, untouched
from orchestrator.results.views.shapes import DRAWN, HullBody, LinkPart, in_world
from orchestrator.results.views.solids import scale_arrow

RATE = 25.0  # pictures a second at most
MAX_PICTURES = 500  # pictures in all
UNIT = 5e-4  # m: unit of places, which are integers of two bytes, up to 16 m
MARGIN = 0.15  # m round the drawn bodies
CORNERS = 200  # of the section of a terrain in a picture at most
WIDEST = 4.0  # width over height of a picture at most
ABOVE = 0.4  # m over the chain at most: hulls are high


def player(run: RunData, track: str, reference: RunData | None = None, turns: bool = False) -> dict[str, Any]:
    """Pictures of a track, and the chain of a reference that is drawn over them, as a JSON table.

    ``turns``: the vehicle from above as well. Places are ahead of the axle of the track's sprocket and over the
    ground, or over the first axle, m. Raises LogUnreadable, and ValueError if poses were not recorded.
    """
    bodies = Bodies(run, EVERY, track=track)
    if not bodies.tracks:
        raise ValueError("places of pins were not recorded")
    span = float(bodies.t[-1] - bodies.t[0])
    bodies.select_instants(np.linspace(bodies.t[0], bodies.t[-1], int(np.clip(span * RATE, 1, MAX_PICTURES - 1)) + 1))
    poses = next(bodies.blocks(MAX_PICTURES))
    cameras = _cameras(bodies, poses, track)
    links, (shape,) = poses.links[track], bodies.tracks
    assert links.colour is not None, "a page has a player of links whose tensions were recorded"
    pins = _projected(cameras, links.pins)
    hull = None if bodies.hull is None or poses.hull is None else _hull(cameras, bodies.hull, poses.hull)
    outlines = [pins.reshape(-1, 2)] + ([] if hull is None else [hull.reshape(-1, 2)])
    low, high = (np.concatenate(outlines).min(axis=0) - MARGIN), (np.concatenate(outlines).max(axis=0) + MARGIN)
    high[1] = min(high[1], pins[..., 1].max() + ABOVE)
    least, most = bodies.colour_range()
    speeds = bodies.speeds()
    return {
        "track": track,
        "t": floats(poses.t),
        "pictures": len(poses.t),
        "links": shape.links,
        "pins": shorts(pins, UNIT),
        "pinCount": pins.shape[1],
        "unit": UNIT,
        "tension": floats(links.colour),
        "least": least,
        "most": most,
        "label": bodies.label,
        "low": low.tolist(),
        "high": high.tolist(),
        "drawn": DRAWN,
        "thick": 2.0 * float(shape.half[2]),
        "parts": [_upright(part) for part in shape.parts[1:]],
        "wheels": [
            {
                "radius": wheel.radius,
                "outline": np.round(wheel.outline, 6).tolist(),
                "centre": shorts(_projected(cameras, poses.wheels[wheel.name].position[:, None])[:, 0], UNIT),
                "angle": floats(_angles(cameras, poses.wheels[wheel.name])),
            }
            for wheel in bodies.wheels
        ],
        "hull": None if hull is None else shorts(hull, UNIT),
        "ground": _ground(bodies, cameras, poses.t, low, high),
        "speed": None if speeds is None else floats(np.interp(poses.t, bodies.t, speeds)),
        "above": above(run, poses.t) if turns else None,
        "reference": _chain(reference, track, poses.t) if reference else None,
    }


def _upright(part: LinkPart) -> dict[str, Any]:
    """Part of a link from the side: least and largest place along and outwards from the middle of the link, m."""
    low, high = (part.centre - part.half)[[0, 2]], (part.centre + part.half)[[0, 2]]
    return {"kind": part.kind, "low": low.tolist(), "high": high.tolist(), "colour": PART[part.kind]}


def _chain(run: RunData, track: str, t: Floats) -> dict[str, Any]:
    """The pins of a chain at the times (m,) of another run's pictures, as far as its record goes."""
    bodies = Bodies(run, EVERY, track=track)
    times = bodies.t[nearest(bodies.t, t[t <= bodies.end + 0.5 / RATE])]
    bodies.select_instants(times)
    poses = next(bodies.blocks(MAX_PICTURES))
    rows = nearest(poses.t, times)
    pins = _projected(_cameras(bodies, poses, track), poses.links[track].pins)[rows]
    (shape,) = bodies.tracks
    return {"pictures": len(rows), "pins": shorts(pins, UNIT), "pinCount": pins.shape[1], "closed": shape.closed}


def _cameras(bodies: Bodies, poses: Poses, track: str) -> list[Camera]:
    """Cameras to the right of the track at each instant, at the height of the ground or of the first axle."""
    cameras = [side_camera(bodies, poses, k, track) for k in range(len(poses.t))]
    first = float(cameras[0].centre[2])
    levels = [first if bodies.ground is None else bodies.height_of_ground(poses, k) for k in range(len(poses.t))]
    return [
        camera._replace(centre=np.array([*camera.centre[:2], level]))
        for camera, level in zip(cameras, levels, strict=True)
    ]


def _projected(cameras: list[Camera], places: Floats) -> Floats:
    """Places (m, ..., 2), m, in the picture of their instant, of places in world (m, ..., 3)."""
    return np.stack([camera.project(instant_places) for camera, instant_places in zip(cameras, places, strict=True)])


def _angles(cameras: list[Camera], pose: BodyPose) -> Floats:
    """Angles of a wheel in the pictures (m,), anticlockwise, rad."""
    ahead = body_axis(pose.orientation, 0)
    return np.array(
        [np.arctan2(axis @ camera.up, axis @ camera.right) for camera, axis in zip(cameras, ahead, strict=True)]
    )


def _hull(cameras: list[Camera], hull: HullBody, pose: BodyPose) -> Floats:
    """Corners of the hull's outline in the pictures (m, corners, 2), m, in order."""
    from scipy.spatial import ConvexHull

    outline = hull.corners[ConvexHull(hull.corners[:, [0, 2]]).vertices] * [1.0, 0.0, 1.0]
    return _projected(cameras, in_world(outline, pose.position, matrices(pose.orientation)))


def _ground(bodies: Bodies, cameras: list[Camera], t: Floats, low: Floats, high: Floats) -> dict[str, Any] | None:
    """Corners of a bump above the level, and way of the middle of each picture along it, m; None without ground.

    A terrain, and soil with its ruts at the times ``t`` (m,), s, has its section in each picture instead, beyond the
    limits ``low`` and ``high`` (2,) of the bodies.
    """
    profile = bodies.ground
    if profile is None:
        return None
    middle = np.stack([camera.centre for camera in cameras])
    if len(profile.along):
        along = profile.station(middle)
    else:  # marks that pass by are all there is to see: along the way itself, whichever turns it takes
        way = np.sum(
            np.diff(middle, axis=0) * np.stack([camera.right for camera in cameras[1:]] or [middle[0]]), axis=1
        )
        along = np.concatenate([[0.0], np.cumsum(way)])
    corners = np.stack([profile.along, profile.height - profile.level], axis=1)
    sections = _sections(bodies, cameras, t, low, high) if profile.terrain or gives_way(bodies.scene) else {}
    return {"corners": corners.tolist(), "along": floats(along), **sections}


def _sections(bodies: Bodies, cameras: list[Camera], t: Floats, low: Floats, high: Floats) -> dict[str, Any]:
    """Sections of a terrain, in one table of corners (n, 2), m, with the number of corners in each picture.

    On soil also ``untouched``, a table of the same form: the ground before the track came.
    """
    room = 0.5 * max(high[0] - low[0], WIDEST * (high[1] - low[1]))
    at = 0.5 * (low[0] + high[0])

    def table(profiles: Iterable[GroundSurface | None]) -> dict[str, Any]:
        lines = [
            section(camera, profile, at - room, at + room, most=CORNERS)[0]
            for camera, profile in zip(cameras, profiles, strict=True)
            if profile is not None
        ]
        lines = [line if np.ptp(line[:, 1]) else line[[0, -1]] for line in lines]  # level
        return {"sections": floats(np.concatenate(lines)), "counts": [len(line) for line in lines]}

    before = untouched(bodies)
    return {
        **table(ground_at(bodies, instant) for instant in t.tolist()),
        **({} if before is None else {"untouched": table([before] * len(cameras))}),
    }


ARROW_LENGTH = 0.7  # m: arrow of the largest force
ROOM = 0.5  # m round the tracks


def above(run: RunData, t: Floats) -> dict[str, Any] | None:
    """Lower runs of both tracks at the records nearest to times (m,), s, as a JSON table.

    Places and arrows are relative to the hull's centre of mass, in world axes, m. None without a hull, or without the
    forces of the ground on links. Raises LogUnreadable, and ValueError if poses were not recorded.
    """
    bodies = Bodies(run, EVERY)
    bodies.select_instants(t)
    blocks = [*bodies.blocks()]
    hulls = [poses.hull for poses in blocks if poses.hull is not None]
    if not hulls or any(links.ground is None for poses in blocks for links in poses.links.values()):
        return None

    def of_links(values: Callable[[LinkPoses], Any]) -> Any:
        return np.concatenate([np.hstack([values(links) for links in poses.links.values()]) for poses in blocks])

    hull = np.concatenate([pose.position[:, :2] for pose in hulls])
    ahead = np.concatenate([body_axis(pose.orientation, 0) for pose in hulls])
    lower = of_links(lambda links: links.axes[..., 2, 2] < 0.0)
    feet = of_links(lambda links: links.centres[..., :2])[lower] - np.repeat(hull, lower.sum(axis=1), axis=0)
    force = of_links(lambda links: np.asarray(links.ground)[..., :2])[lower]
    largest = float(np.linalg.norm(force, axis=1).max()) or 1.0
    return {
        "hull": floats(hull),
        "heading": floats(np.arctan2(ahead[:, 1], ahead[:, 0])),
        "counts": lower.sum(axis=1).tolist(),
        "feet": shorts(feet, UNIT),
        "arrows": shorts(force * ARROW_LENGTH / largest, UNIT),
        "unit": UNIT,
        "largest": largest,
        "scale": scale_arrow(ARROW_LENGTH, largest / ARROW_LENGTH)._asdict(),
        "half": (bodies.tracks[0].half[:2]).tolist(),
        "reach": float(np.abs(feet).max()) + ROOM,
    }
