"""Implicit steps that are much shorter than those before them.

A method with auxiliary accelerations is unstable if the length of its steps changes often: at a spectral radius of 0.4,
steps of 1 and 0.01 ms in turn amplify an oscillation of 2e5 rad/s tenfold by each pair. A step below ``SHARE`` of the
steps that the auxiliary values belong to therefore has the acceleration of its end throughout, reads none of them, and
leaves them to the next long step: over one long and up to 20 short steps no undamped oscillation grows by more than
0.4 %, at a radius of 0.9 by 4 % (``tests/fmus/test_short_steps.py``). Where short steps last, the method goes on with
them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.jit import kernel
from fmus.physics.arrays import Floats
from fmus.physics.chain.state import copy_rows

if TYPE_CHECKING:
    from fmus.physics.chain.protocols import ChainState

LENGTH, SINCE = 0, 1  # of ``lengths``: that of the steps of the auxiliary values, s, and the time since the last, s
SHARE = 0.2  # of ``LENGTH``: shorter steps are short ones
PATIENCE = 4.0  # in ``LENGTH``: time of short steps after which they are the rule


@kernel
def is_short(lengths: Floats, h: float) -> bool:
    """Whether a step of ``h`` s leaves the auxiliary values as they are."""
    return h < SHARE * lengths[LENGTH] and lengths[SINCE] < PATIENCE * lengths[LENGTH]


@kernel
def keep_auxiliary_values(before: ChainState, s: ChainState, h: float) -> None:
    """Set the auxiliary values of ``s``, after a short step of ``h`` s, to those before it."""
    copy_rows(before.a, s.a)
    copy_rows(before.aux, s.aux)
    copy_rows(before.on_links_aux, s.on_links_aux)
    s.lengths[SINCE] += h


@kernel
def set_length(lengths: Floats, h: float) -> None:
    """Note that the auxiliary values belong to steps of ``h`` s."""
    lengths[LENGTH], lengths[SINCE] = h, 0.0
