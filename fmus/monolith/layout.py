"""Layout of a monolith: its flat state and sums, and the connections of its parts as indices."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fmus.drives import mount as mounts
from fmus.drives.motor import SPEED, DriveParameters
from fmus.interface.model import Floats, InvalidParameter
from fmus.interface.ports import STATE, WRENCH
from fmus.monolith.equations import PortMap
from fmus.monolith.parts import ChainSlot, DriveSprocket, MonolithPart, initialised_model
from fmus.monolith.spins import HALF, SPIN, Spins
from fmus.physics.chain.report import REPORT
from fmus.track.model import TrackModel

Connector = tuple[str, str]  # names of a part and of its connector


class Sources:
    """Sources of the inputs of all parts; ``connections`` as of a ``Monolith``."""

    def __init__(self, connections: Iterable[Any]) -> None:
        self._outputs = {
            (c.target, i): (c.source, o) for c in connections for i, o in zip(c.inputs, c.outputs, strict=True)
        }

    def output(self, target: str, variable: str) -> str:
        """Name of the output that is connected to an input; raises KeyError if none is."""
        return self._outputs[target, variable][1]

    def connector(self, target: str, variable: str) -> Connector | None:
        """Connector that an input comes from; None if it is not connected."""
        source = self._outputs.get((target, variable))
        return source and (source[0], source[1].rsplit(".", 2)[0])

    def needed(self, target: str, variable: str) -> Connector:
        """As ``connector``; raises InvalidParameter if the input is not connected."""
        source = self.connector(target, variable)
        if source is None:
            raise InvalidParameter(f"{target}: the input {variable} is not connected")
        return source


class Hull(NamedTuple):
    """Chassis of a monolith; the default is a scene without one."""

    name: str = ""
    tree: Any = None  # parameters of its kernels
    sides: int = 0  # number of its computed sides
    stations: Sequence[str] = ()  # connectors of the motions that it outputs
    inputs: Sequence[str] = ()  # first variable of each wrench that it receives
    size: int = 0  # variables of its state


def hull(part: MonolithPart, mirrored: bool, shafts: Sequence[DriveParameters]) -> Hull:
    """Hull of a chassis, with ``mirrored`` of its left side alone, with the spin inertia of ``shafts``."""
    config = {**part.config, "chassis": {"sides": ["left"]}} if mirrored else part.config
    chassis = initialised_model(part.kind, config, part.parameters)
    sides = len(config["chassis"]["sides"])
    outputs = [port.name for port in chassis.ports if port.causality == "output"]
    stations = [name.removesuffix(".position.x") for name in outputs if name.endswith(".position.x")]
    inputs = [port.name for port in chassis.ports if port.causality == "input" and port.name.endswith(".force.x")]
    tree = _with_spins(chassis.tree, shafts, 2 // sides)
    return Hull(
        part.name, tree, sides, stations[:-1], inputs, chassis.integrated.size
    )  # the last one is the chassis itself


def _with_spins(tree: Any, shafts: Sequence[DriveParameters], times: int) -> Any:
    """Add ``times`` the spin inertia of shafts with prescribed speed against the chassis to the tree. (3)"""
    inertia = tree.inertia.copy()
    inertia[1, 1] += times * sum(drive.inertia for drive in shafts if drive.mode == SPEED)
    return tree._replace(inertia=inertia)


class MonolithLayout(NamedTuple):
    """Flat arrays of a monolith, and indices into them."""

    size: int  # variables of the state
    sums: Floats  # flat: all that is summed over a step
    slots: Sequence[ChainSlot]  # of the chains
    ports: PortMap  # connections; has the indices of chassis and shafts in the state


class _Views:
    """Views of a flat array, taken one after the other."""

    def __init__(self, size: int) -> None:
        self.flat, self._taken = np.zeros(size), 0

    def take(self, *shape: int) -> Floats:
        first = self._taken
        self._taken += int(np.prod(shape))
        return self.flat[first : self._taken].reshape(shape)


def lay_out(
    chains: Mapping[str, TrackModel],
    sizes: Sequence[int],
    chassis: Hull,
    sprockets: Sequence[DriveSprocket],
    differential: bool,
    sources: Sources,
) -> MonolithLayout:
    """Layout of ``chains`` by name with ``sizes`` integrated variables, a chassis and sprockets.

    ``differential``: one joins both sprockets. Raises InvalidParameter for an input without a source.
    """
    fixed, stations = len(sprockets), len(chassis.stations)
    body = sum(sizes)
    spin = body + chassis.size
    counts = [
        (len(model.wheel_list) + 1) * WRENCH + int(np.prod(model.on_links_shape)) + REPORT for model in chains.values()
    ]
    sums = _Views(sum(counts) + WRENCH * fixed)
    index, motion, mount = _motions(chassis, sprockets, sources)
    slots, wrenches = _slots(chains, sizes, index, sources, sums)
    block = len(wrenches) + len(chains)  # each chain has the ground's besides
    chain = [wrenches[sources.needed(s.name, f"{s.prefix}sprocket.force.x")] for s in sprockets]
    wrenches |= {(s.name, f"{s.prefix}mount"): block + d for d, s in enumerate(sprockets)}
    chassis_inputs = [wrenches[sources.needed(chassis.name, name)] for name in chassis.inputs]
    spins = Spins(
        differential=int(differential),
        start=spin,
        body=body,
        inertia=np.array([sprocket.inertia for sprocket in sprockets]),
        stations=stations,
        mount=mount,
        chain=np.array(chain, dtype=np.int64),
        mounts=block,
        drive_states=np.zeros((fixed, mounts.WIDTH)),
        about_axis=np.zeros((fixed, 2)),
        acceleration=np.zeros(fixed),
        own_rate=np.zeros(fixed),
        direction=np.ones(fixed),
        growth=np.zeros(fixed),
        reaction=sums.take(fixed, 3),
        force=sums.take(fixed, 3),
    )
    ports = PortMap(
        motion=motion,
        wrench=np.zeros(WRENCH * (block + fixed)),
        u=np.zeros(max([len(chassis_inputs) * WRENCH, *(STATE * len(slot.motions) for slot in slots)])),
        stations=stations,
        sides=chassis.sides,
        inputs=np.array(chassis_inputs, dtype=np.int64),
        body=body,
        shafts=spin,
        spins=spins,
    )
    return MonolithLayout(spin + SPIN * fixed + (2 * HALF if differential else 0), sums.flat, slots, ports)


def _motions(
    chassis: Hull, sprockets: Sequence[DriveSprocket], sources: Sources
) -> tuple[dict[Connector, int], Floats, Any]:
    """Indices of the motions by connector, motions with the fixed mounts, index of each sprocket's mount."""
    stations, fixed = len(chassis.stations), len(sprockets)
    index = {(chassis.name, station): i for i, station in enumerate(chassis.stations)}
    index |= {(s.name, f"{s.prefix}sprocket"): stations + fixed + d for d, s in enumerate(sprockets)}
    motion, mount = np.zeros(STATE * (stations + 2 * fixed)), np.zeros(fixed, dtype=np.int64)
    for d, sprocket in enumerate(sprockets):
        source = sources.connector(sprocket.name, f"{sprocket.prefix}mount.position.x")
        mount[d] = stations + d if source is None else index[source]
        motion[STATE * (stations + d) : STATE * (stations + d + 1)] = sprocket.rest_motion
    return index, motion, mount


def _slots(
    chains: Mapping[str, TrackModel],
    sizes: Sequence[int],
    motions: Mapping[Connector, int],
    sources: Sources,
    sums: _Views,
) -> tuple[list[ChainSlot], dict[Connector, int]]:
    """Places of the chains, one after the other, and indices of the wrenches on their wheels by connector."""
    slots: list[ChainSlot] = []
    wrenches: dict[Connector, int] = {}
    start, block = 0, 0
    for (name, model), size in zip(chains.items(), sizes, strict=True):
        wheels = [wheel["name"] for wheel in model.wheel_list]
        indices = [motions[sources.needed(name, f"{wheel}.position.x")] for wheel in wheels]
        wrenches |= {(name, wheel): block + i for i, wheel in enumerate(wheels)}
        count = len(wheels) + 1
        slots.append(
            ChainSlot(
                start=start,
                end=start + size,
                motions=np.array(indices, dtype=np.int64),
                wrench=block,
                frame=model.frame,
                impulse=sums.take(count, WRENCH),
                on_links=sums.take(*model.on_links_shape),
                report_sums=sums.take(REPORT),
            )
        )
        start, block = start + size, block + count
    return slots, wrenches
