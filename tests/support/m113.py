"""The M113's table, and pitch (m), mass (kg) and number of its links."""

from __future__ import annotations

from fmus.vehicles.vehicle import read_table, vehicle

VEHICLE = vehicle(*read_table("m113")).model_dump()
TRACK = VEHICLE["track"]
P, MASS, LINKS = TRACK["pitch"], TRACK["mass"], TRACK["links"]
