"""Numbers of a chassis that is not ours, from what a stranger reads: start values of FMUs and the vehicle table."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from orchestrator.cosim.component import description_of
from orchestrator.cosim.graph import System


def parameters(graph: System, vehicle: Mapping[str, Any]) -> dict[str, float]:
    """Parameters of ``foreign/chassis.c``: all masses of a vehicle, its wheels where its tracks expect them."""
    places, turn = _places(graph)
    to_world = np.array([[np.cos(turn), 0.0, np.sin(turn)], [0.0, 1.0, 0.0], [-np.sin(turn), 0.0, np.cos(turn)]])
    origin = 0.5 * (places["left.sprocket"] + places["right.sprocket"])
    hull = vehicle["chassis"]
    bodies = [(hull["mass"], origin + to_world @ hull["centre"], hull["inertia"])]
    arm, drawn = vehicle["road_arm"], vehicle["road_wheel"]
    for name, place in places.items():
        kind = name.split(".")[1].partition("[")[0]
        body = vehicle[kind]
        across = body["transverse_inertia"]
        bodies.append((body["mass"], place, (across, 0.0, across)))
        if kind == "road_wheel":
            x = drawn["x"][int(name[-2]) - 1]
            pivot = origin + to_world @ [x + arm["pivot"][0], place[1], drawn["z"] + arm["pivot"][1]]
            long, pin = arm["long_inertia"], arm["pin_inertia"]
            along = (pivot - place) / np.linalg.norm(pivot - place) @ to_world
            slender = (pin - long) * np.outer(along, along)
            bodies.append((arm["mass"], 0.5 * (pivot + place), pin * np.eye(3) - slender))
    mass = sum(body[0] for body in bodies)
    centre = sum(body[0] * body[1] for body in bodies) / mass
    inertia = np.zeros((3, 3))
    for weight, place, own in bodies:
        arm_of_mass = to_world.T @ (place - centre)
        inertia += weight * (arm_of_mass @ arm_of_mass * np.eye(3) - np.outer(arm_of_mass, arm_of_mass))
        inertia += np.diag(own) if np.ndim(own) == 1 else own
    at = [(name, axis, k) for name in (*places, "centre") for k, axis in enumerate("xyz")]
    starts = places | {"centre": centre}
    return {
        **{f"{name}.start.{axis}": float(starts[name][k]) for name, axis, k in at},
        "pitch": turn,
        "mass": float(mass),
        "gravity": vehicle["gravity"],
        **{f"inertia.{a}{b}": float(inertia["xyz".index(a), "xyz".index(b)]) for a, b in ("xx", "yy", "zz", "xz")},
        "wheel.inertia": vehicle["road_wheel"]["spin_inertia"],
        "idler.inertia": vehicle["idler"]["spin_inertia"],
    }


def _places(graph: System) -> tuple[dict[str, Any], float]:
    """Places of wheels and mounts at the start, m, and pitch of the hull: start values of a left track, mirrored."""
    track = next(instance for instance in graph.instances if instance.name == "left_track")
    inputs = (each.name for each in description_of(track.fmu).modelVariables if each.causality == "input")
    starts = dict(zip(inputs, track.starts, strict=False))
    places = {}
    for name in dict.fromkeys(name.partition(".")[0] for name in starts):
        x, y, z = (starts[f"{name}.position.{axis}"] for axis in "xyz")
        places |= {f"left.{name}": np.array([x, y, z]), f"right.{name}": np.array([x, -y, z])}
    return places, 2.0 * float(np.arcsin(starts["sprocket.orientation.y"]))
