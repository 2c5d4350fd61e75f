"""Columns of the forces on each link: one row for each pin and the link that begins there.

Up to the requested number: force of the pin, N; force of the ground, N; force of the wheels, N, on the link and on the
pin where it ends; velocity over the ground, m/s, mean of the link's points on it; depth of the deepest of these, m.
Then three parts of the force of the wheels, N: of teeth on the pin; of rims and of discs and wheels on the horn, on
the link. The last is the moment of the pin on the link, N m, about the axes across it.
"""

JOINT, GROUND, WHEELS, SLIDING, DEPTH = 0, 3, 6, 9, 12  # first column of each quantity
TEETH, RIMS, HORNS, MOMENT = 13, 16, 19, 22
# number of columns up to and including each
WITH_JOINT, WITH_GROUND, WITH_WHEELS, WITH_SLIDING, WITH_PARTS, WITH_MOMENT = 3, 6, 9, 13, 22, 25
LinkForcesShape = tuple[int, int]  # shape (k, c): pins, columns
NONE: LinkForcesShape = (0, 0)
