"""Numbers of a component: the floats of its config, each a fixed parameter of its FMU under the name of its key.

What decides variables, sizes and kernels (names, whole numbers, lengths of lists, tables that are there) is the shape
of a component, and an FMU is built for a shape. Its numbers are the floats of the vehicle table that its model reads,
named as in a vehicle file (``chassis.mass``, ``road_wheel.x[2]``), those of the ground, named as in a scene, and others
of the scene:

| name | number |
| --- | --- |
| `ground.soil.cohesion`, `ground.step.x[2]`, `ground.friction.factor[1]` | of ground and soil |
| `ground.level` | height of the level part of a ground |
| `gravity`, `ends.first[1]`, `transverse_damping` | of a chain |
| `rest.road_wheel[1].position.x` | place of a wheel of a track at the start, or of the mount of a drive |
| `rest.height`, `rest.roll`, `rest.pitch`, `rest.lateral`, `rest.left[1]` | place of hull and leaves at the start |
| `rest.wrench[1]` | wrench of a track on the sprocket of a drive at rest |
| `rest.contact.wheel.friction` | without influence; older tools set it |
| `tensioner.push` | part of `tensioner.preload` that balances a track |
| `sprocket.spin_inertia` | of the spin of a drive |

Of the ground, the heights of a map, and band and period of a rough one are part of the shape: they say how long its
arrays are. So are class and seed of a rough ground, and which tables and optional numbers there are. Native FMUs take
the numbers of the ground from their file of numbers, as all others that the start of a track depends on: scipy computes
its place at rest. Where a number adds or removes a piece of a profile (a step below two radii has no wall), they have
another library, because arrays are longer; Python FMUs make their model anew.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fmus.interface.ports import ANY, Port, Range

Path = tuple[str | int, ...]  # keys and indices in a config
Meaning = Sequence[Any]  # unit, least and largest value, what is allowed in words, description

MEANINGS = "numbers.json"  # file of an FMU's resources: ``fmus.ground.tables.number_meanings``
STANCE = ("position.x", "position.y", "position.z", "orientation.w", "orientation.x", "orientation.y", "orientation.z")
OF_GROUNDS = ("terrain", "bump", "soil")  # tables of a track, or of the ground of a chassis
SIZES = ("heights", "band", "period")  # keys of numbers that say how long arrays of the ground are
OF_CHAINS = ("gravity", "transverse_damping", "ends")
OF_HULLS = ("height", "roll", "pitch", "lateral", "left", "right")
OF_SCENES: dict[str, tuple[str, str]] = {  # unit ("": see _unit) and description, by the beginning of the name
    "rest.height": ("m", "height of the hull's centre of mass over its drawn place at the start"),
    "rest.lateral": ("m", "way of the hull to the left at the start"),
    "rest.roll": ("rad", "roll of the hull at the start"),
    "rest.pitch": ("rad", "pitch of the hull at the start"),
    "rest.left": ("", "left arm from the front, rad, then slides of idler and further wheels, m, at the start"),
    "rest.right": ("", "right arm from the front, rad, then slides of idler and further wheels, m, at the start"),
    "rest.wrench": ("", "force, N, then torque, N m, of the left, then the right track on its sprocket at rest"),
    "rest.": ("", "place at the start in the vehicle, m, or quaternion"),
    "ground.level": ("m", "height of the level part of the ground in the world"),
    "gravity": ("m/s2", "acceleration of gravity, downwards"),
    "transverse_damping": ("1/s", "damping of motion across a held chain, over its mass"),
    "ends.": ("", "place of a held end, m, or pull on a free one, N"),
    "tensioner.push": ("N", "part of tensioner.preload that balances a track"),
}


def packed(config: Mapping[str, Any], reads: Sequence[str]) -> dict[str, Any]:
    """Config with the keys of its vehicle table that a model reads: dotted names of keys or of whole tables."""
    vehicle: dict[str, Any] = {}
    for name in reads:
        source, target = config["vehicle"], vehicle
        *above, last = name.split(".")
        for key in above:
            source, target = source.get(key) or {}, target.setdefault(key, {})
        if last in source:
            target[last] = source[last]
    others = {key: value for key, value in config.items() if key != "vehicle"}
    return {"vehicle": vehicle, **others} if vehicle else others


def places(config: Mapping[str, Any]) -> dict[str, Path]:
    """Places of the numbers in a config, by their names."""
    found: dict[str, Path] = {}
    chain, hull, drive = (config.get(key) or {} for key in ("track", "chassis", "drive"))
    for path in _floats(config.get("vehicle") or {}, ("vehicle",)):
        found[f"{'rest.' if chain and path[1] == 'contact' else ''}{_name(path[1:])}"] = path
    for key in OF_CHAINS:
        found |= {_name(path[1:]): path for path in _floats(chain.get(key), ("track", key))}
    for k, wheel in enumerate(chain.get("wheels", ())):
        above: Path = ("track", "wheels", k, "start")
        found |= _stance(wheel["name"], wheel.get("start", ()), above)
    for key in OF_HULLS:
        start = (hull.get("start") or {}).get(key)
        found |= {f"rest.{_name(path[2:])}": path for path in _floats(start, ("chassis", "start", key))}
    if isinstance(hull.get("push"), float):
        found["tensioner.push"] = ("chassis", "push")
    if isinstance(drive.get("inertia"), float):
        found["sprocket.spin_inertia"] = ("drive", "inertia")
    found |= {_name(("rest", *path[1:])): path for path in _floats(drive.get("wrench"), ("drive", "wrench"))}
    for key in ("mount", "right"):
        found |= _stance(f"{key}", drive.get(key, ()), ("drive", key))
    for above, table in ((("track",), chain), (("chassis", "ground"), hull.get("ground") or {})):
        for key in OF_GROUNDS:
            inside = len(above) + (key == "terrain")
            found |= {_name(("ground", *path[inside:])): path for path in _floats(table.get(key), (*above, key))}
    return found


def values(config: Mapping[str, Any]) -> dict[str, float]:
    """Numbers of a config by name."""
    return {name: _at(config, path) for name, path in places(config).items()}


def with_values(config: Mapping[str, Any], numbers: Mapping[str, Any]) -> Any:
    """Config, as JSON has it, with other numbers, those of ``numbers`` that it has a place for."""
    changed = json.loads(json.dumps(config))
    for name, (*above, last) in places(config).items():
        if name in numbers:
            _at(changed, above)[last] = numbers[name]
    return changed


def shape(config: Mapping[str, Any]) -> Any:
    """Config with 0 in place of every number."""
    return with_values(config, dict.fromkeys(places(config), 0.0))


def ports(config: Mapping[str, Any], meanings: Mapping[str, Meaning], known: Sequence[Port]) -> tuple[Port, ...]:
    """Parameters of the numbers of a config that are not among the ``known`` ports already.

    ``meanings``: of the keys of vehicles and grounds, without indices.
    """
    names = {port.name for port in known}
    return tuple(_port(name, config, path, meanings) for name, path in places(config).items() if name not in names)


def _port(name: str, config: Mapping[str, Any], path: Path, meanings: Mapping[str, Meaning]) -> Port:
    value = _at(config, path)
    key = name.removeprefix("rest.contact.").partition("[")[0]
    key = f"contact.{key}" if name.startswith("rest.contact.") else key
    key = re.sub(r"\b(seat|wheel)\.\w+\.", r"\1.", key)
    if key in meanings:
        unit, least, most, allowed, text = meanings[key]
        text += ", without influence: contact.* counts" if name.startswith("rest.") else ""
        return Port(name, "parameter", unit, text, value, allowed=Range(_bound(least), _bound(most), allowed))
    for beginning, (unit, text) in OF_SCENES.items():
        if name.startswith(beginning):
            return Port(name, "parameter", unit or _unit(config, path), text, value, allowed=ANY)
    raise KeyError(f"the number {name} has no meaning")


def _unit(config: Mapping[str, Any], path: Path) -> str:
    """Unit of an entry of a list whose entries have several: arms and a slide, wrenches, a place and a quaternion."""
    match path:
        case ("chassis", "start", _, int(k)):
            return "rad" if k < len(config["vehicle"]["road_wheel"]["x"]) else "m"
        case ("drive", "wrench", int(k)):
            return "N" if k % 6 < 3 else "N.m"
        case ("track", "ends", *_):
            return "N" if config["track"]["ends"]["kind"] == "pulled" else "m"
        case (*_, int(k)):
            return "m" if k < 3 else "1"
    raise KeyError(f"{path} is no entry of a list")


def _bound(text: float | str) -> float:
    """Bound of a range; JSON has no infinity."""
    return float(text)


def _floats(value: Any, path: Path) -> Iterator[Path]:
    """Places of the floats in tables and lists, without those of SIZES."""
    if isinstance(value, float):
        yield path
    elif isinstance(value, Mapping):
        for key, inside in value.items():
            if key not in SIZES:
                yield from _floats(inside, (*path, key))
    elif isinstance(value, list | tuple):
        for k, inside in enumerate(value):
            yield from _floats(inside, (*path, k))


def _stance(name: str, numbers: Sequence[float], above: Path) -> dict[str, Path]:
    return {f"rest.{name}.{part}": (*above, k) for k, part in zip(range(len(numbers)), STANCE, strict=False)}


def _name(path: Path) -> str:
    """Structured name: keys with points between them, indices from 1 in brackets."""
    keys = [str(each) for each in path if isinstance(each, str)]
    indices = [str(each + 1) for each in path if isinstance(each, int)]
    return ".".join(keys) + (f"[{','.join(indices)}]" if indices else "")


def _at(config: Any, path: Sequence[str | int]) -> Any:
    for key in path:
        config = config[key]
    return config
