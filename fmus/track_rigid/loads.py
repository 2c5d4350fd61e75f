"""The tally of a chain of rigid links: sums over the run, then figures of the last evaluation."""

from __future__ import annotations

from fmus.physics.chain import sums

TRAVEL, DISSIPATED, WORK, COVERED, NOW = range(5)
# ``sums`` of an evaluation from NOW on, after them the power of the loads on the ends
CONTACT, POWER, COVERING, DEPTH, LOAD, SLIP, SIDESLIP = range(NOW, NOW + sums.SUMS)
LOAD_POWER, TALLY = NOW + sums.SUMS, NOW + sums.SUMS + 1
