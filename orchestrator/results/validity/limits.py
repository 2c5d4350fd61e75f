"""The limits of the validity ledger, each with its reason, and the kinds of its entries.

A limit that is passed makes a warning. One beyond which the model no longer describes the machine makes a failure,
unless the scene allows that kind (``[run] allow``). Lengths of the vehicle are those of its own table: face (half of
the thickness of a link), radius of a pin, travel of the tensioner.
"""

from __future__ import annotations

from typing import NamedTuple


class Kind(NamedTuple):
    """A kind of entry."""

    text: str  # what is the matter, with which the sentence of an entry begins
    unit: str  # that value and limit are shown in
    size: float  # of that unit in SI
    fails: bool = False  # whether there are failures of this kind, which a scene may allow


KINDS = {
    "penetration": Kind("bodies pass through each other", "mm", 1e-3, fails=True),
    "tooth_jump": Kind("the chain jumps over teeth", "teeth", 1.0, fails=True),
    "idler_travel": Kind("the idler is beyond the travel of its tensioner", "mm", 1e-3),
    "compression": Kind("links push more than a chain can carry", "kN", 1e3),
    "creep": Kind("the standing vehicle creeps where it should stick", "mm/s", 1e-3),
    "lift": Kind("is off what bears it", "s", 1.0),
    "contact_step": Kind("the step is long for the contacts: frequency times step", "rad", 1.0),
}
ALLOWED = tuple(name for name, kind in KINDS.items() if kind.fails)

# Penetration of a link, over ``track.face``. Contact springs stand for pads, rubber and flanks that give way by a few
# millimetres (9.8 mm under a road wheel at rest, 26 mm when sprockets lock at 2.5 m/s). At 1 the surface of one
# body has reached the line of the pins, which no rubber does: forces are too small, by a law that nobody measured. At 2
# one body has gone through the other: contact may act from the wrong side.
LINK_WARNING, LINK_FAILURE = 1.0, 2.0
# Penetration of a pin into its seat, over ``sprocket.pin_radius``. A seated pin sinks 4.6 mm at 15 kN, 14 mm when
# sprockets lock at 2.5 m/s. At 1 its centre is where the steel begins, at 2 all of it is inside the tooth.
PIN_WARNING, PIN_FAILURE = 1.5, 2.0
# Teeth by which the chain is off its first seat. There is no half jump: the next seat is a pitch away.
JUMP = 0.0
# Compression of a link, N. The links between two road wheels lie on the ground, the joints lifted by what wheels sink
# in, some 10 mm. They stay down by their own weight, q = 1160 N/m over the 0.67 m between wheels: an arch that
# rises by f carries a thrust of q L^2 / (8 f) = 6.5 kN before it lifts (the three-hinged arch). In the free runs
# anything above zero buckles; that takes some milliseconds, so peaks that are shorter than HELD do not count.
HELD = 0.02  # s
RISE = 0.01  # m
# Sliding of a standing vehicle, m/s, mean over STANDING seconds. Regularised friction creeps at v = v_reg s / sqrt(1 -
# s^2) where it bears the share s of its limit; 0.01 m/s is 36 m an hour. From a share of STICKS on the contact slides
# in earnest, which is physics.
CREEP, STICKS, STANDING = 0.01, 0.9, 1.0
# Time without load, s. A wheel that bounces is off its track for a tenth of a second; after LIFT a track has dropped by
# g t^2 / 2 = 20 mm off its wheels, the height of the guide horns that the model has without an end.
LIFT = 0.2
# Angular frequency of the stiffest contact times the step of the integration, rad. The implicit integrators are stable
# at any step, but at 1 a contact's period has 6 steps, and is off by a tenth ((w h)^2 / 12 and numerical damping). Of
# the communication step: an explicit exchange is stable up to 2.
STEP = 1.0
