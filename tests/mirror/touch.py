"""Contacts of links by the laws in `fmus/physics/README.md` and the points in `fmus/track.md`.

Plain numpy, world axes. Stiffness and damping of the table are per link (per pin in the teeth) and shared by its
points: two Gauss points on the part of the inner face inside a rim, on the whole outer face for the ground; links with
a width have points on both sides of their middle. A rim's damper acts on the penetration rate of the whole rim, all
others on the approach of the point.
"""

from __future__ import annotations

from itertools import product
from typing import Any, NamedTuple

import numpy as np

from fmus.track.start import drawn
from mirror import soft
from mirror.ground import Ground
from mirror.links import UP, Chain, Element
from mirror.motion import Wheels, ground_frame, start_frame
from mirror.record import Floats

SPREAD = 0.5 / np.sqrt(3.0)  # distance of two Gauss points from the middle of the unit interval
RAMP = 1e-3  # m, penetration over which a damper sets in
DEEP = 5e-3  # m, penetration at which a damper of Hunt and Crossley equals that of the table
NUDGE = 1e-4  # of a gradient, for differences of places
HORN = 0.05  # m, penetration depth of a guide horn in a disc


class Law(NamedTuple):
    k: float
    c: float
    mu: float
    v: float
    name: str

    @classmethod
    def of(cls, parameters: dict[str, Any], table: dict[str, Any], pair: str) -> Law:
        keys = "stiffness", "damping", "friction", "friction_velocity"
        numbers = (float(parameters.get(f"contact.{pair}.{key}", table[pair][key])) for key in keys)
        return cls(*numbers, table[pair]["law"])

    def damper(self, depth: Floats) -> Floats:
        """Its damping constant at a penetration, N s/m."""
        if self.name == "hunt_crossley":
            return self.c * depth / DEEP
        s = np.clip(depth / RAMP, 0.0, 1.0)
        return self.c * s * s * (3.0 - 2.0 * s)


class Push(NamedTuple):
    """Contact forces, energies and losses of p points."""

    force: Floats  # on the points (p, 3), N
    normal: Floats  # normal force, N
    stored: Floats  # J
    friction_loss: Floats  # W lost by friction
    damping_loss: Floats  # W lost by the damper


def press(law: Law, share, depth: Floats, n: Floats, w: Floats, rate: Floats | None = None) -> Push:
    """Contact of points with faces (normals ``n``, relative velocity ``w``; ``rate`` for the damper)."""
    along = (w * n).sum(-1)
    rate = -along if rate is None else rate
    spring = share * law.k * depth
    normal = np.maximum(spring + share * law.damper(depth) * rate, 0.0)
    slip = w - along[..., None] * n
    friction = -law.mu * normal[..., None] * slip / np.sqrt((slip**2).sum(-1, keepdims=True) + law.v**2)
    force = normal[..., None] * n + friction
    power_losses = -(friction * slip).sum(-1), -(normal - spring) * along
    return Push(force, normal, 0.5 * share * law.k * depth**2, *power_losses)


# causes of contact losses: friction and damping of three pairs; of guides, both together
CAUSES = ("ground_friction", "ground_damping", "wheel_friction", "wheel_damping", "tooth_friction", "tooth_damping",
          "guides")  # fmt: skip
GROUND, WHEEL, TOOTH, GUIDE = (0, 1), (2, 3), (4, 5), (6, 6)


class Touch(NamedTuple):
    """All contacts of a chain at T instants."""

    wrench: Floats  # (T, m, 6) on the wheels, about their centres
    ground: Floats  # (T, n, 3) of the ground on the links
    force: Floats  # (T, n, 3) of rims, guides and ground on the links
    torque: Floats  # (T, n, 3) about their middles
    teeth: Floats  # (T, nodes, 3) on the pins
    stored: Floats  # (T) J
    losses: Floats  # (T, causes) W
    along: Floats  # (T, n) N: forces along a link times their distance from its middle, over its length
    power_in: Floats  # (T) W: power that wheels and links put in
    covering: Floats  # (T) W, what rims and guides take in and do not lose
    depth: Floats  # (T) m
    load: Floats  # (T) N on the ground
    slide: Floats  # (T, 3) N m/s: load times velocity of the points on the ground
    sliding: Floats  # (T, n, 3) m/s, mean velocity of the points on the ground
    link_depth: Floats  # (T, n) m, depth of the deepest point
    horns: Floats  # (T, n, 3) of wheels on the horns
    twist: Floats  # (T, nodes, 3) N m, moment of the teeth on the pins about their middles
    shared: Floats  # (T, n, 2, 3) N m, work of forces on a link in nudges of its shared gradients, by end
    lost: Floats  # (T, causes) J, lost besides ``losses`` in the step that ends here


class _ContactSums:
    def __init__(self, chain: Chain, wheels: Wheels, only_energy: bool = False) -> None:
        T, m = wheels.centre.shape[:2]
        z = np.zeros
        self.chain, self.wheels, self.only_energy = chain, wheels, only_energy
        self.nudged = []
        for end in range(2) if isinstance(chain, Element) and not only_energy else ():
            row = chain.shared_row + end * (chain.e.shape[2] // 2)
            for k, way in enumerate(chain.shared_nudges):
                self.nudged.append((end, k, chain.nudged(row, NUDGE * way), chain.nudged(row, -NUDGE * way)))
        self.t = Touch(z((T, m, 6)), z((T, chain.n, 3)), z((T, chain.n, 3)), z((T, chain.n, 3)), z((T, chain.nodes, 3)),
                       z(T), z((T, len(CAUSES))), z((T, chain.n)), *(z(T) for _ in range(4)), z((T, 3)),
                       z((T, chain.n, 3)), z((T, chain.n)), z((T, chain.n, 3)), z((T, chain.nodes, 3)),
                       z((T, chain.n, 2, 3)), z((T, len(CAUSES))))  # fmt: skip

    def add(
        self, t, index, x: Floats, w: Floats, depth: Floats, push: Push, m: int | None, kind: tuple, place: tuple = ()
    ) -> None:
        """Add forces at points ``x`` (p, 3) and instants ``t`` on links (or pins) ``at`` by wheel ``m``.

        ``place``: of ``Chain.point``, of points on links.
        """
        sums, f = self.t, push.force
        np.add.at(sums.stored, t, push.stored)
        if self.only_energy:
            return
        for end, k, more, less in self.nudged if place else ():
            way = (more.point(t, index, *place)[0] - less.point(t, index, *place)[0]) / (2.0 * NUDGE)
            np.add.at(sums.shared, (t, index, end, k), (f * way).sum(-1))
        if kind == TOOTH:
            np.add.at(sums.teeth, (t, index), f)
            np.add.at(sums.twist, (t, index), np.cross(x - self.chain.pins[t, index], f))
        else:
            np.add.at(sums.force, (t, index), f)
            if kind == GUIDE:
                np.add.at(sums.horns, (t, index), f)
            arm, line = x - self.chain.middle[t, index], self.chain.line[t, index]
            np.add.at(sums.torque, (t, index), np.cross(arm, f))
            np.add.at(sums.along, (t, index), (f * line).sum(-1) * (arm * line).sum(-1) / self.chain.pitch)
        if m is None:
            np.add.at(sums.ground, (t, index), f)
        else:
            arm = x - self.wheels.centre[t, m]
            np.add.at(sums.wrench, (t, m), -np.concatenate([f, np.cross(arm, f)], axis=-1))
        np.add.at(sums.losses, (t, kind[0]), push.friction_loss)
        np.add.at(sums.losses, (t, kind[1]), push.damping_loss)
        np.add.at(sums.power_in, t, -(f * w).sum(-1))
        np.maximum.at(sums.depth, t, depth)

    def lie(self, t, index, u: Floats, depth: Floats, push: Push) -> Floats:
        """Add load and motion of points on the ground; return their number on each link (T, n)."""
        sums, number = self.t, np.zeros(self.t.sliding.shape[:2])
        np.add.at(sums.load, t, push.normal)
        np.add.at(sums.slide, t, push.normal[:, None] * u)
        np.add.at(sums.sliding, (t, index), u)
        np.maximum.at(sums.link_depth, (t, index), depth)
        np.add.at(number, (t, index), 1.0)
        return number

    def material(self, t, m: int, x: Floats, u: Floats) -> Floats:
        """Velocity of points relative to the material of a wheel."""
        wheels = self.wheels
        return u - wheels.velocity[t, m] - np.cross(wheels.spin[t, m], x - wheels.centre[t, m])


def inside(chain: Chain, wheels: Wheels, m: int, radius: float):
    """Part of each link's inner face inside a circle.

    Returns t, i (p), its ends as fractions, foot, normal, length.
    """
    a, b, _, _ = chain.ends
    axle, centre = wheels.axle[:, m, None], wheels.centre[:, m, None]
    along = b - a
    along = along - (along * axle).sum(-1, keepdims=True) * axle
    length = np.linalg.norm(along, axis=-1)
    e = along / length[..., None]
    n = np.cross(e, axle)
    foot = ((centre - a) * e).sum(-1) / length
    height = ((a - centre) * n).sum(-1) - chain.face
    half = np.sqrt(np.maximum(radius**2 - height**2, 0.0)) / length
    low, high = np.maximum(foot - half, 0.0), np.minimum(foot + half, 1.0)
    t, i = np.nonzero((half > 0.0) & (high > low))
    return t, i, low[t, i], high[t, i], foot[t, i], n[t, i], length[t, i]


def rims(sums: _ContactSums, law: Law, m: int, radius: float) -> None:
    chain, wheels = sums.chain, sums.wheels
    t, i, low, high, foot, n, length = inside(chain, wheels, m, radius)
    _, _, va, vb = chain.ends
    sinking = (n * (wheels.velocity[t, m] - (1 - foot)[:, None] * va[t, i] - foot[:, None] * vb[t, i])).sum(-1)
    centre, axle = wheels.centre[t, m], wheels.axle[t, m]
    depths = []
    for side in (-1.0, 1.0):
        for y in chain.lateral:
            share = 0.5 * (high - low) / len(chain.lateral)
            xi = 0.5 * (low + high) + side * SPREAD * (high - low)
            x, u = chain.point(t, i, xi, y, -chain.face)
            radial = x - centre
            radial = radial - (radial * axle).sum(-1, keepdims=True) * axle
            rho = np.linalg.norm(radial, axis=-1)
            depths.append(radius - rho)
            on = depths[-1] > 0.0
            w = sums.material(t, m, x, u)
            push = press(law, share[on], depths[-1][on], (radial / rho[:, None])[on], w[on], sinking[on])
            sums.add(t[on], i[on], x[on], w[on], depths[-1][on], push, m, WHEEL, (xi[on], y, -chain.face))
    # a parabola through two depths stores more than two points: its mean square over the part, by three points
    half = 0.5 * (high - low) * length
    bow, extra = half**2 / (2.0 * radius), 0.0
    for eta, weight in zip(*np.polynomial.legendre.leggauss(3), strict=True):
        extra = extra + 0.5 * weight * (bow * (eta**2 - 1.0 / 3.0)) ** 2
    np.add.at(sums.t.stored, t, 0.5 * law.k * (high - low) * extra)


def guides(sums: _ContactSums, law: Law, m: int, radius: float, play: float) -> None:
    chain, wheels = sums.chain, sums.wheels
    t, i, low, high, _, _, _ = inside(chain, wheels, m, radius)
    axle = wheels.axle[t, m]
    for side in (-1.0, 1.0):
        xi = 0.5 * (low + high) + side * SPREAD * (high - low)
        x, u = chain.point(t, i, xi, 0.0, -chain.face)
        off = ((x - wheels.centre[t, m]) * axle).sum(-1)
        depth = abs(off) - play
        on = depth > 0.0
        w = sums.material(t, m, x, u)
        n = -np.sign(off)[:, None] * axle
        push = press(law, 0.5 * (high - low)[on], depth[on], n[on], w[on])
        sums.add(t[on], i[on], x[on], w[on], depth[on], push, m, GUIDE, (xi[on], 0.0, -chain.face))


class _GroundPoint(NamedTuple):
    """Point of a link on the ground: two Gauss points along each part of a face, one in the middle of each strip."""

    xi: float  # fraction of the link
    y: float  # m
    off: float  # outwards from the line of the pins, m
    share: float  # of the contact of a link
    to_middle: float  # from the point to the middle of its part, of the link
    half: tuple[float, float]  # half of its part: along, of the link, and across, m


def _ground_points(chain: Chain, hard: bool) -> list[_GroundPoint]:
    """Points of a link: of its grousers, then of the plate, which has the area that is left to it."""
    parts, strips = chain.part.config["track"].get("refinement", (1, 1))
    table, bar, sides = chain.vehicle["track"], chain.vehicle["track"].get("grouser"), len(chain.lateral)
    whole, left, faces = table["width"], 1.0, []
    if bar:
        length, width = bar["length"] / chain.pitch, bar.get("width") or whole
        left -= bar["count"] * length * width / whole
        for k in range(bar["count"]):
            share = 1.0 / bar["count"] if hard else length * width / whole
            faces.append(((k + 0.5) / bar["count"], length, width, chain.face + bar["height"], share))
    if left > 1e-6:
        faces.append((0.5, 1.0, whole, chain.face, left))
    points = []
    for middle, length, width, off, share in faces:
        part = length / parts
        for k, side, strip, y in product(range(parts), (-1.0, 1.0), range(strips), chain.lateral):
            xi = middle + (k + 0.5 - 0.5 * parts + side * SPREAD) * part
            place, half = y * width / whole * (2 * strip + 1) / strips, (0.25 * part, width / (2 * sides * strips))
            own = share / (2 * parts * strips * sides)
            points.append(_GroundPoint(xi, place, off, own, side * (0.25 - SPREAD) * part, half))
    return points


def hard_ground(sums: _ContactSums, law: Law, ground: Ground) -> None:
    chain = sums.chain
    heights = [end[..., 2] - ground.height(end[..., 0], end[..., 1]) for end in chain.ends[:2]]
    near = np.minimum(*heights) < 2.0 * chain.pitch
    t, i = np.nonzero(near)
    lie = np.zeros(near.shape)
    for xi, y, off, share, _, _ in _ground_points(chain, hard=True):
        x, u = chain.point(t, i, xi, y, off)
        depth, n = ground.under(x)
        on = depth > 0.0
        push = press(law, share, depth[on], n[on], u[on])
        sums.add(t[on], i[on], x[on], u[on], depth[on], push, None, GROUND, (np.full(on.sum(), xi), y, off))
        lie += sums.lie(t[on], i[on], u[on], depth[on], push)
    sums.t.sliding[:] /= np.maximum(lie, 1.0)[..., None]


def soft_ground(sums: _ContactSums, law: soft.Law, ground: Ground) -> None:
    """Soil; cells of its rut are counted from the start, along its axes."""
    chain = sums.chain
    T = len(chain.part.t)
    t, i = (each.ravel() for each in np.indices((T, chain.n)))
    axes = ground_frame(chain.part.parameters).inv()
    ahead = axes.apply((chain.ends[1] - chain.ends[0])[t, i])[:, :2].reshape(T, chain.n, 2)
    points = _ground_points(chain, hard=False)
    x, u, depth, places = [], [], [], []
    for xi, y, off, *_ in points:
        place, velocity = chain.point(t, i, xi, y, off)
        x.append(place.reshape(T, chain.n, 3))
        u.append(velocity.reshape(T, chain.n, 3))
        depth.append(ground.under(place)[0].reshape(T, chain.n))
        places += [(xi, y, off)] * chain.n
    x, u, depth = (np.concatenate(each, axis=1) for each in (x, u, depth))
    start, _ = start_frame(chain.part.parameters)
    local = axes.apply(x.reshape(-1, 3) - start).reshape(x.shape)
    rows, each = len(points), [point for point in points for _ in range(chain.n)]
    along, link = np.concatenate([ahead] * rows, axis=1), np.tile(np.arange(chain.n), rows)
    area = [point.share * chain.pitch * chain.vehicle["track"]["width"] for point in each]
    part, half = [point.to_middle for point in each], [point.half for point in each]
    found = soft.march(law, soft.Points(local, depth, along, part, area, half))
    t, k = np.nonzero(depth > 0.0)
    force = axes.inv().apply(found.shear[t, k] + found.normal[t, k][:, None] * UP)
    none = np.zeros(len(t))
    push = Push(force, found.normal[t, k], found.stored[t, k], none, none)
    place = tuple(np.array(places)[k].T)
    sums.add(t, link[k], x[t, k], u[t, k], none, push, None, GROUND, place)
    sums.t.lost[:, GROUND] += np.stack([found.sheared, found.compacted], axis=1)
    lie = sums.lie(t, link[k], u[t, k], depth[t, k], push)
    sums.t.sliding[:] /= np.maximum(lie, 1.0)[..., None]


class Outline:
    """Path of a pin's centre between two teeth: seat, flank, rounding, land; a outwards, b across."""

    def __init__(self, vehicle: dict[str, Any]) -> None:
        s = vehicle["sprocket"]
        self.count = s["teeth"]
        self.lugs = s.get("pins_per_gap", 1)
        between_pins = 2.0 * np.pi * s.get("gaps_per_pin", 1) / (self.lugs * self.count)
        seat = vehicle["track"]["pitch"] / (2.0 * np.sin(0.5 * between_pins)) + s["seat_clearance"]
        self.rim = vehicle["track"]["pitch"] / (2.0 * np.tan(0.5 * between_pins)) - vehicle["track"]["face"]
        self.seat, self.gap = np.array([seat, 0.0]), s["seat_clearance"]
        self.top, self.round = s["outer_radius"] + s["pin_radius"], s["tip_radius"] + s["pin_radius"]
        d = np.array([np.cos(s["flank_angle"]), np.sin(s["flank_angle"])])  # up the flank
        self.normal = np.array([d[1], -d[0]])  # out of the tooth
        self.foot = self.seat - self.gap * self.normal  # start of the flank at the seat
        # centre of the rounding: its radius behind the flank, and below the land
        behind = self.foot - self.round * self.normal
        p = behind @ d
        climb = -p + np.sqrt(p * p - behind @ behind + (self.top - self.round) ** 2)
        self.tip, self.length, self.d = behind + climb * d, climb, d

    def press(self, a: Floats, b: Floats) -> tuple[Floats, Floats]:
        """Depth (p) and normal in a and b (p, 2) of pins at b >= 0, by the nearest of the four pieces."""
        x = np.stack([a, b], axis=-1)
        rho = np.linalg.norm(x, axis=-1)
        pieces = []
        seat = x - self.seat
        size = np.linalg.norm(seat, axis=-1)
        pieces.append((size - self.gap, -seat / size[:, None], seat @ self.d <= 0.0))
        on_flank = x - self.foot
        climb = on_flank @ self.d
        n = np.broadcast_to(self.normal, x.shape)
        pieces.append((-(on_flank @ self.normal), n, (climb > 0.0) & (climb < self.length)))
        tip = x - self.tip
        size = np.linalg.norm(tip, axis=-1)
        beyond = np.arctan2(b, a) >= np.arctan2(self.tip[1], self.tip[0])
        pieces.append((self.round - size, tip / size[:, None], (climb >= self.length) & ~beyond))
        land = (climb >= self.length) & beyond
        land |= (climb < self.length) & (np.where(climb > 0.0, pieces[1][0], pieces[0][0]) > self.top - rho)
        pieces.append((self.top - rho, x / rho[:, None], land))
        depth, normal = np.zeros(len(x)), np.zeros((len(x), 2))
        for d, n, here in pieces:
            depth[here], normal[here] = d[here], n[here]
        return depth, normal


def teeth(sums: _ContactSums, law: Law, m: int, outline: Outline) -> None:
    chain, wheels = sums.chain, sums.wheels
    far = np.linalg.norm(chain.pins - wheels.centre[:, m, None], axis=-1)
    t, j = np.nonzero((far < outline.top + 0.5) & (np.arange(far.shape[1]) % outline.lugs == 0))
    axle, radial, centre = wheels.axle[t, m], wheels.radial[t, m], wheels.centre[t, m]
    quarter = np.cross(axle, radial)  # direction of rotation
    for y in chain.lateral:
        x, u = chain.pin(t, j, y)
        d = x - centre
        p, q = (d * radial).sum(-1), (d * quarter).sum(-1)
        angle, rho = np.arctan2(q, p), np.hypot(p, q)
        step = 2.0 * np.pi / outline.count
        gap = step * np.round(angle / step)
        a, b = rho * np.cos(angle - gap), rho * np.sin(angle - gap)
        depth, normal = outline.press(a, abs(b))
        on = (depth > 0.0) & (rho < outline.top)
        out = np.cos(gap)[:, None] * radial + np.sin(gap)[:, None] * quarter
        side = np.cos(gap)[:, None] * quarter - np.sin(gap)[:, None] * radial
        n = normal[:, :1] * out + (normal[:, 1:] * np.sign(b)[:, None]) * side
        w = sums.material(t, m, x, u)
        push = press(law, 1.0 / len(chain.lateral), depth[on], n[on], w[on])
        sums.add(t[on], j[on], x[on], w[on], depth[on], push, m, TOOTH)


def _law(chain: Chain, pair: str) -> Law:
    return Law.of(chain.part.parameters, chain.vehicle["contact"], pair)


def cover(sums: _ContactSums, outline: Outline) -> None:
    """Contacts of all wheels that cover more or less of a link as it moves."""
    chain, law = sums.chain, _law(sums.chain, "wheel")
    for m, wheel in enumerate(drawn(chain.vehicle, chain.part.config["track"]["wheels"])):
        toothed = wheel["kind"] == "teeth"
        rim = outline.rim if toothed else wheel["radius"]
        if not toothed or outline.lugs > 1:
            rims(sums, law, m, rim)
        if chain.guided:
            disc = outline.top if toothed and outline.lugs == 1 else rim + HORN
            guides(sums, law, m, disc, chain.vehicle["guide"]["clearance"])


def covering_energy(chain: Chain, wheels: Wheels) -> Floats:
    """Energy stored in the contacts that cover more or less of a link as it moves (T), J."""
    sums = _ContactSums(chain, wheels, only_energy=True)
    cover(sums, Outline(chain.vehicle))
    return sums.t.stored


def touch(chain: Chain, wheels: Wheels) -> Touch:
    """All contacts of a track."""
    part, vehicle = chain.part, chain.vehicle
    outline, sums = Outline(vehicle), _ContactSums(chain, wheels)
    cover(sums, outline)
    sums.t.covering[:] = sums.t.power_in - sums.t.losses.sum(1)
    for m, wheel in enumerate(drawn(vehicle, part.config["track"]["wheels"])):
        if wheel["kind"] == "teeth":
            teeth(sums, _law(chain, "sprocket"), m, outline)
    if part.config["track"]["ground"]:
        if soil := part.config["track"].get("soil"):
            soft_ground(sums, soft.Law(soil, vehicle["track"]["width"]), Ground(part.scene))
        else:
            hard_ground(sums, _law(chain, "ground"), Ground(part.scene))
    return sums.t
