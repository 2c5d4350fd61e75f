"""Constants of one contact pair, shared by the normal and the friction law."""

from __future__ import annotations

from typing import NamedTuple


class Law(NamedTuple):
    """Linear dissipative normal contact with regularised Coulomb friction (Table 2 of the paper)."""

    k: float  # normal stiffness of a whole link or pin, N/m
    c: float  # normal damping of a whole link or pin, N s/m
    mu: float  # coefficient of friction
    v_reg: float  # slip velocity at which friction has grown to 1/sqrt(2) of mu N, m/s
    ramp: float = 1e-3  # penetration over which the damper takes hold, m: without it the force jumps at first touch
