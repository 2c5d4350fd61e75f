"""Where the sums of one evaluation of the chain stand."""

CONTACT, POWER, DEPTH, LOAD, SLIP = range(5)  # J stored, W dissipated, m, N on the ground, N m/s slipping
SUMS = 5
