"""Tracks of rigid links by themselves: hanging and on wheels, with their parameters, inputs and outputs."""

from __future__ import annotations

import numpy as np
from m113 import LINKS, TRACK, VEHICLE, P

from fmus.track_rigid.model import Model


def hanging(span=0.8, vehicle=VEHICLE, **track):
    config = {
        "links": LINKS, "closed": False, "wheels": [], "ground": False, "gravity": 9.81,
        "ends": {"kind": "pinned", "first": [0.0, 0.0], "last": [span * LINKS * P, 0.0]}, "transverse_damping": 0.0,
    }  # fmt: skip
    return Model({"vehicle": vehicle, "track": config | track, "link_outputs": True})


def rolling(ground=True, idler=-3.998, gravity=9.81, links=LINKS, **vehicle):
    v = VEHICLE | vehicle
    rims = [("road_wheel", x, v["road_wheel"]) for x in v["road_wheel"]["x"]] + [("idler", idler, v["idler"])]
    wheels = [{"name": "sprocket", "kind": "teeth", "position": [0.0, 0.0]}]
    for i, (name, x, part) in enumerate(rims):
        wheels.append({"name": f"{name}[{i}]", "kind": "rim", "radius": part["radius"], "position": [x, part["z"]]})
    config = {"links": links, "closed": True, "wheels": wheels, "ground": ground, "gravity": gravity, "ends": None}
    return Model({"vehicle": v, "track": config, "link_outputs": True})


def inputs(model, t, spin, lateral=0.0, yaw=0.0, heading=0.0):
    """Inputs: the sprocket spins up to ``spin`` rad/s in 0.2 s; all wheels slide sideways and yaw."""
    ramp = 0.2
    rate = spin * min(t / ramp, 1.0)
    angle = spin * (0.5 * t * t / ramp if t < ramp else t - 0.5 * ramp)
    turned = yaw * t + heading
    c, s = np.cos(turned), np.sin(turned)
    u = np.zeros((len(model.wheel_list), 13))
    for row, wheel in zip(u, model.wheel_list, strict=True):
        x, z = wheel["position"]
        toothed = wheel["kind"] == "teeth"
        y = TRACK["lateral"] + lateral * t
        row[0:3] = c * x - s * y, s * x + c * y, z
        about = 0.5 * (angle if toothed else 0.0)
        cz, sz = np.cos(0.5 * turned), np.sin(0.5 * turned)
        row[3:7] = cz * np.cos(about), -sz * np.sin(about), cz * np.sin(about), sz * np.cos(about)
        row[7:10] = -yaw * row[1] - s * lateral, yaw * row[0] + c * lateral, 0.0
        own = rate if toothed else model.report[1] / wheel["radius"]
        row[10:13] = -s * own, c * own, yaw
    return u.ravel()
