"""Parts that the tables of other vehicles than the m113 have."""

from fmus.vehicles.vehicle import read_table, vehicle

M113 = vehicle(*read_table("m113")).model_dump(mode="json", exclude_none=True)
ROLLERS = {
    "mass": 90.0, "spin_inertia": 1.4, "transverse_inertia": 0.9, "radius": 0.118, "width": 0.3,
    "x": [-1.0, -2.0, -3.0], "z": 0.096,
}  # fmt: skip
REAR = {
    "mass": 200.0,
    "spin_inertia": 4.0,
    "transverse_inertia": 4.0,
    "radius": 0.2,
    "width": 0.381,
    "x": -3.9,
    "z": 0.35,
}
SPRING = {"stiffness": 1e6, "damping": 1e4, "preload": 0.0}
