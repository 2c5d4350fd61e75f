"""Limits of the validity ledger, each with its reason, and the kinds of limits.

Beyond a warning limit results are doubtful. Beyond a failure limit the model no longer describes the machine, and the
run fails unless the scene allows that kind (``[run] allow``). Lengths are those of the vehicle table: face (half of
the thickness of a link), radius of a pin, travel of the tensioner.
"""

from __future__ import annotations

import math
from typing import NamedTuple


class LimitKind(NamedTuple):
    """How an exceedance of a limit is said, and whether it may fail a run."""

    text: str  # begins the sentence of an exceedance
    unit: str  # display unit of value and limit
    fails: bool = False  # failures of this kind exist, which a scene may allow
    advice: str = ""  # ends the sentence, with the limit over the value


VALIDITY_KINDS = {
    "penetration": LimitKind("bodies pass through each other", "mm", fails=True),
    "tooth_jump": LimitKind("the chain jumps over teeth", "teeth", fails=True),
    "idler_travel": LimitKind("the idler is beyond the travel of its tensioner", "mm"),
    "compression": LimitKind("links push more than a chain can carry", "kN"),
    "spin": LimitKind("the track spins on the ground and hardly drives: slip of its pads", "%"),
    "slide": LimitKind("the vehicle slides, faster than its track runs: speed of its pads", "m/s"),
    "fast": LimitKind("it goes ten times as fast as a vehicle of this length goes at a walk", "m/s"),
    "creep": LimitKind("the standing vehicle creeps where it should stick", "mm/s"),
    "lift": LimitKind("without load", "s"),
    "belly": LimitKind("the hull is in the soil, which bears tracks only", "mm", fails=True),
    "hull": LimitKind("the hull is in hard ground, held by springs of a link, or by none without ground.hull", "mm"),
    "crossed_rut": LimitKind("the track is in the rut of the other one, which counts as untouched", "mm"),
    "lanes": LimitKind("a track leaves the lane along x that is its own", "mm"),
    "askew": LimitKind("the vehicle is askew to roughness along x, whose density along its way is less", "%"),
    "contact_step": LimitKind(
        "the step is long for the contacts: frequency times step",
        "rad",
        advice="; {:.3g} times run.step, or track.step where links are meant, is short enough",
    ),
}
ALLOWED = tuple(name for name, kind in VALIDITY_KINDS.items() if kind.fails)

# Penetration of a link, over ``track.face``. Contact springs stand for pads, rubber and flanks that yield by a few
# millimetres (9.8 mm under a road wheel at rest, 26 mm when sprockets lock at 2.5 m/s). At 1 the surface of one body
# has reached the line of the pins, more than rubber can yield: the contact force is too small, by an unmeasured law. At
# 2 one body has passed through the other, and contact may act from the wrong side.
LINK_WARNING, LINK_FAILURE = 1.0, 2.0
# Penetration of a pin into its seat, over ``sprocket.pin_radius``. A seated pin sinks 4.6 mm at 15 kN, 14 mm when
# sprockets lock at 2.5 m/s. At 1 its centre is at the surface of the steel, at 2 the whole pin is inside the tooth.
PIN_WARNING, PIN_FAILURE = 1.5, 2.0
# Teeth between the chain and its first seat. There are no half jumps: the next seat is a tooth away.
JUMP = 0.0
# Compression of a link, N. The links between two road wheels lie on the ground; their joints rise by some 10 mm, the
# depth to which wheels sink in. Their weight, q = 1160 N/m over the 0.67 m between wheels, keeps them down: an arch of
# rise f carries a thrust of q L^2 / (8 f) = 6.5 kN before it lifts (three-hinged arch). In the free spans any
# compression buckles; that takes some milliseconds, so peaks shorter than HELD do not count.
HELD = 0.02  # s
RISE = 0.01  # m
# Sliding of a standing vehicle, m/s, mean over STANDING seconds. Regularised friction creeps at v = v_reg s / sqrt(1 -
# s^2) at the share s of its limit; 0.01 m/s is 36 m an hour. At CREEPS times that speed, or with s above 1, the contact
# really slides, which is physical.
CREEP, CREEPS, STANDING = 0.01, 3.0, 1.0
# Slip of pads over STANDING seconds: beyond SPIN a track digs in and hardly pulls more. A vehicle slides where its pads
# are faster than its chain. Slower than SLOW of a walking pace, 0.4 sqrt(gravity length), neither matters; FAST of them
# are 70 km/h for the m113.
SPIN, SLOW, FAST = 0.5, 0.1, 10.0
# Time without load, s. A bouncing wheel leaves its track for a tenth of a second. After LIFT a track has dropped by g
# t^2 / 2 = 20 mm below its wheels, the height of real guide horns; those of the model have no end.
LIFT = 0.2
# Depth of a corner of the hull below the undeformed soil, m. Soil has no law for the hull: a belly that touches carries
# a part of the weight and holds the vehicle back; on dry sand 30 mm of it would carry all. So touching is the limit.
BELLY = 0.0
# Depth of a corner of the hull in hard ground with ``ground.hull``, over ``track.face``. The ground holds a corner by
# the spring of one link, 20 mm deep under each of four corners at rest; plates and edges yield by less. Deeper than a
# link may be, the force is too small, by an unmeasured law. Without ``ground.hull`` nothing holds the hull: touching is
# the limit.
HULL = 1.0
# Depth of the other track's rut where a track comes through it, m. No port carries a rut, so soil bears and resists as
# if it were pressed for the first time.
RUT = 0.0
# Inner edge of a track over the edge of its lane, m: there one lane turns into the other, then both tracks have one
# profile. A way at an angle to x has the density of a profile along x times the cosine: less by a share ASKEW at 26
# degrees, as much as an estimate from a kilometre of ground is uncertain.
LANE, ASKEW = 0.0, 0.1
# Angular frequency of the stiffest contact times the step, rad. The implicit integrators are stable at any step, but at
# 1 the contact's period has 6 steps and is off by a tenth ((w h)^2 / 12 and numerical damping). For the communication
# step, an explicit exchange is stable up to 2.
STEP = 1.0
# Share of the largest sum of the energy ledger, or of a component's: a run that leaves more open cannot be right.
LARGEST_RESIDUAL = 0.05


def shorter_step(step: float, longest: float) -> str:
    """A step, s, halved until it is at most ``longest``, s: the end of a run stays a multiple of it."""
    return f"{1e3 * step * 0.5 ** math.ceil(math.log2(step / longest)):.12g}ms"
