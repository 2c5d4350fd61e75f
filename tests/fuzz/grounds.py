"""Grounds under a vehicle: random tables ``[ground]``, soils, links and starts, through the start and some steps."""

from __future__ import annotations

import random
import sys
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from fmus.ground import soils
from fmus.interface.model import InvalidParameter, StepFailed
from fmus.vehicles.tables import BadInput
from orchestrator.scene.scene import load
from tests.fuzz import values
from tests.support.vehicle_in_process import InProcess

STEPS = (3, 3, 40)
BASE = (
    "track.start=polygon", "track.link_outputs=false", "drive.ramp_start=0", "drive.ramp_time=0.01", "drive.speed=5",
    "start.state=drawn",
)  # fmt: skip
SETTLED = ("track.link_outputs=false",)
LINKS: dict[str, tuple[str, ...]] = {
    "rigid": (),
    "cable": ("track.model=flexible", "track.axes=fixed"),  # of other links the kernels alone take minutes
}


def _place(chance: random.Random) -> float:
    """A place under the vehicle, which stands between x = -4.5 m and 0.5 m, or elsewhere."""
    return round(chance.uniform(-6.0, 2.0), chance.choice((0, 1, 3, 12)))


def _length(chance: random.Random, usual: float) -> float:
    return usual * 10.0 ** chance.uniform(-1.0, 0.5 if chance.random() < 0.9 else 3.0)


def _signed(chance: random.Random, value: float) -> float:
    return value if chance.random() < 0.6 else -value


def _places(chance: random.Random) -> list[float]:
    return sorted(_place(chance) for _ in range(chance.choice((1, 1, 1, 2, 3))))


def _fading(chance: random.Random) -> dict[str, Any]:
    return {"start": _place(chance), "length": _length(chance, 1.0)} if chance.random() < 0.5 else {}


def _heightmap(chance: random.Random) -> dict[str, Any]:
    rows, columns = chance.randrange(2, 7), chance.randrange(2, 7)
    size = _length(chance, 0.05)
    heights = [[round(chance.uniform(-size, size), 4) for _ in range(columns)] for _ in range(rows)]
    spacing = [_length(chance, 1.0), _length(chance, 1.0)]
    return {"heights": heights, "corner": [_place(chance), _place(chance)], "spacing": spacing, **_fading(chance)}


def _friction(chance: random.Random) -> list[dict[str, Any]]:
    regions = []
    for _ in range(chance.choice((1, 2, 5))):
        x, y = sorted((_place(chance), _place(chance) + 1e-3)), sorted((_place(chance), _place(chance) + 1e-3))
        how = chance.choice(("factor", "coefficient"))
        regions.append({"x": x, "y": y, how: chance.choice((0.0, 0.3, 1.0, 5.0))})
    return regions


def _soil(chance: random.Random) -> dict[str, Any]:
    """A named soil, one with changes, or one of numbers alone."""
    name = {"name": chance.choice((*soils.named(), "no_soil"))} if chance.random() < 0.6 else {}
    if name and chance.random() < 0.4:
        return name
    slope = chance.choice(({"k0": _length(chance, 1e8)}, {"Au": _length(chance, 1e9)}, {"rebound": chance.random()}))
    numbers = {
        "n": chance.choice((0.1, 0.5, 0.8, 1.0, 1.1, 2.0, 5.0)), "kc": _length(chance, 1e4),
        "kphi": _length(chance, 1e6),
        "cohesion": _length(chance, 1e3), "friction_angle": chance.uniform(0.0, 1.5),
        "shear_deformation_modulus": _length(chance, 0.02), "elastic": _length(chance, 1e8),
        "damping": chance.choice((0.0, _length(chance, 1e4))), "width": _length(chance, 0.4),
        **slope,
    }  # fmt: skip
    return {**name, **{key: each for key, each in numbers.items() if not name or chance.random() < 0.4}}


TABLES: dict[str, Callable[[random.Random], Any]] = {
    "grade": lambda chance: _signed(chance, _length(chance, 0.15)),
    "bank": lambda chance: _signed(chance, _length(chance, 0.15)),
    "bump": lambda chance: {
        "start": _place(chance), "rise": _length(chance, 0.1), "slope": chance.uniform(0.05, 1.4),
        "length": _length(chance, 0.3), "radius": _length(chance, 0.05),
    },
    "step": lambda chance: {
        "x": _places(chance), "rise": _signed(chance, _length(chance, 0.2)), "radius": _length(chance, 0.02),
    },
    "half_round": lambda chance: {
        "x": _places(chance), "radius": _length(chance, 0.1), "fillet": _length(chance, 0.02),
    },
    "trench": lambda chance: {
        "start": _place(chance), "width": _length(chance, 1.0), "depth": _length(chance, 0.5),
        "radius": _length(chance, 0.02),
    },
    "kerb": lambda chance: {
        "y": _place(chance) / 3.0, "rise": _signed(chance, _length(chance, 0.1)), "radius": _length(chance, 0.02),
        **_fading(chance),
    },
    "washboard": lambda chance: {
        "amplitude": _length(chance, 0.02), "wavelength": _length(chance, 1.0), "start": _place(chance),
        "phase": chance.uniform(-7.0, 7.0), **({"end": _place(chance) + 5.0} if chance.random() < 0.5 else {}),
    },
    "rough": lambda chance: {
        "iso_class": chance.choice("ABCDEFGH"), "seed": chance.randrange(10), "start": _place(chance),
        "period": chance.choice((20.0, 50.0, 200.0)), chance.choice(("correlated", "isotropic")): chance.random() < 0.5,
        "length": _length(chance, 2.0),
    },
    "heightmap": _heightmap,
    "friction": _friction,
}  # fmt: skip


def draw(chance: random.Random) -> dict[str, Any]:
    """A case: settings of a vehicle on a ground."""
    chosen = chance.sample(sorted(TABLES), chance.choice((1, 1, 1, 2, 2, 3)))
    ground = {key: TABLES[key](chance) for key in chosen}
    soft = chance.random() < 0.4
    if soft:
        ground = {"soil": _soil(chance), **(ground if chance.random() < 0.4 else {})}
    if {"grade", "bank"} & ground.keys() and chance.random() < 0.3:
        ground |= {"incline_start": _place(chance), "incline_length": _length(chance, 1.0)}
    if chance.random() < 0.3:
        values.change(ground, chance)
    settings = [*(BASE if chance.random() < 0.7 else SETTLED)]
    settings += [f"ground.{key}={values.text(one)}" for key, one in ground.items()]
    if chance.random() < 0.5:
        position = [_place(chance), _place(chance), round(chance.uniform(-3.0, 3.0), 2)]
        settings += [f"start.heading={chance.uniform(-4.0, 4.0)!r}", f"start.position={position}"]
    settings += LINKS[chance.choice((*LINKS, "rigid", "rigid"))]
    if chance.random() < (0.05 if soft else 0.3):
        settings.append("ground.hull=true")
    if chance.random() < (0.05 if soft else 0.2):
        settings.append(f"tracks={chance.choice(('[]', '[' + chr(34) + 'left' + chr(34) + ']'))}")
    elif chance.random() < 0.2:
        settings.append("symmetric=true")
    return {"settings": settings, "steps": chance.choice(STEPS)}


@cache
def _load(links: str, soft: bool, uneven: bool, bare: bool) -> None:
    """Load the kernels of a kind of case: links, soil, terrain, a side without a track and the hull on the ground."""
    soil, step = ["ground.soil.name=dry_sand"] * soft, ["ground.step={x=[-2], rise=0.01}"] * uneven
    beside = ["tracks=['left']", "ground.hull=true"] * bare
    InProcess(load("straight", "rigid", [*BASE, *soil, *step, *beside, *LINKS[links]])).step()


def act(case: dict[str, Any]) -> Callable[[], None]:
    """Action of a case: it ends with status 2 and a sentence, or with finite outputs.

    This process loads the kernels of its kind, so that a case is no longer than its limit of time.
    """
    keys = {one.partition("=")[0].removeprefix("ground.").partition(".")[0] for one in case["settings"]}
    links = "cable" if set(LINKS["cable"]) <= {*case["settings"]} else "rigid"
    soft, bare = "soil" in keys, not keys.isdisjoint(("tracks", "hull"))
    _load(links, soft, not keys.isdisjoint(TABLES), bare and not soft)  # soil bears no hull

    def play() -> None:
        try:
            vehicle = InProcess(load("straight", "rigid", case["settings"]))
            for _ in range(case["steps"]):
                vehicle.step()
        except (BadInput, InvalidParameter) as error:
            print(f"cotrack: {error}", file=sys.stderr)
            sys.exit(2)
        except StepFailed as error:
            print(f"cotrack: {error}", file=sys.stderr)
            sys.exit(3)
        for one in vehicle.members.values():
            odd = [name for name, value in zip(one.outputs, one.y, strict=True) if not np.isfinite(value)]
            assert not odd, f"{one.name}.{odd[0]} is not finite"

    return play
