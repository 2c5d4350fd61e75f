"""Labels of the observables of a run, for people: name, unit, digits."""

from __future__ import annotations

LABELS = {
    "distance": ("distance along the start heading", "m", 5),
    "speed": ("speed", "m/s", 4),
    "settlement": ("settlement", "mm", 4),
    "ground_force": ("ground carries", "kN", 5),
    "weight": ("weight", "kN", 5),
    "slip": ("slip", "%", 2),
    "pad_slip": ("slip of the pads", "%", 2),
    "pad_velocity": ("pads slide at", "m/s", 3),
    "path_error": ("largest distance from the path", "m", 3),
    "yaw_rate": ("yaw rate", "rad/s", 4),
    "turn_radius": ("turn radius", "m", 4),
    "steering_moment": ("steering moment", "kN m", 4),
    "slip_left": ("slip left", "m/s", 3),
    "slip_right": ("slip right", "m/s", 3),
    "power_left": ("power left", "kW", 4),
    "power_right": ("power right", "kW", 4),
    "power_propulsion": ("power of propulsion", "kW", 4),
    "power_steering": ("power of steering", "kW", 4),
    "power_regenerated": ("power from side to side", "kW", 4),
    "tension_max": ("largest link tension", "kN", 4),
    "tension_mean": ("mean link tension", "kN", 4),
    "sag": ("sag", "m", 6),
    "end_tension": ("tension at the ends", "kN", 5),
}
