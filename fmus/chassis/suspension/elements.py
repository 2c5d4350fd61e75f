"""All elements of a suspension: numbers from the vehicle table, force on a leaf, energy, outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fmus.chassis.leaf import ROOT, compression, linear_spring, wheel_offset
from fmus.chassis.suspension import curve, gas_spring, recoil, rotary_damper, stop, torsion_bar
from fmus.interface.ports import Port
from fmus.kernels.jit import implemented_in, kernel
from fmus.physics.arrays import Floats, Vector
from fmus.physics.elementary import power
from fmus.vehicles.sides import of_wheels, smooth_wheels

if TYPE_CHECKING:
    from fmus.chassis.tree import VehicleTree


@implemented_in(suspension=".elements")
class Elements(NamedTuple):
    """Elements of the leaves of a vehicle; those that no leaf has are of no leaves.

    So all vehicles that have any element share the compiled kernels.
    """

    wheels: int  # of a side
    spring: curve.Curve
    gas_spring: gas_spring.GasSpring
    damper: curve.Curve
    torsion_bar: torsion_bar.TorsionBar
    rotary_damper: rotary_damper.RotaryDamper
    bump_stop: stop.Stop
    rebound_stop: stop.Stop
    recoil: recoil.Recoil


NAMES = ("spring", "gas_spring", "damper", "torsion_bar", "rotary_damper", "bump_stop", "rebound_stop")


def elements(sides: Sequence[Mapping[str, Any]], rollers: int, sense: Floats) -> Elements:
    """Elements of a vehicle from the tables of its left and right side.

    ``rollers``: return rollers of a side; ``sense`` (leaves): 1 where the wheel rises with the coordinate.
    """
    wheels = len(sides[0]["road_wheel"]["x"])
    tables = {name: [(side["suspension"] or {}).get(name) for side in sides] for name in NAMES}
    recoils = [(wheel.get("tensioner") or {}).get("recoil") for side in sides for wheel in smooth_wheels(side)]

    def each(name: str, key: str) -> Floats:
        """Number (leaves) of the wheels that have an element, 0 for the others."""
        values = []
        for table in tables[name]:
            having = (table or {}).get("wheels") or (range(1, wheels + 1) if table else ())
            numbers = of_wheels((table or {}).get(key, 0.0), wheels)
            values += [number if k in having else 0.0 for k, number in enumerate(numbers, 1)]
            values += [0.0] * (1 + rollers)
        return np.array(values)

    def made(kind: type, name: str, *more: Any) -> Any:
        keys, any_leaf = [key for key in kind._fields if key != "sense"], any(tables[name])  # type: ignore[attr-defined]
        return kind(**{key: each(name, key) if any_leaf else np.zeros(0) for key in keys}, **dict(more))

    bars = made(torsion_bar.TorsionBar, "torsion_bar", ("sense", sense))
    resistance = np.array([
        float(table[key]) if table else 0.0 for key in ("preload", "stiffness") for table in recoils
    ]).reshape(2, -1)  # fmt: skip
    return Elements(
        wheels,
        _curves(tables["spring"], "compression", wheels, rollers),
        made(gas_spring.GasSpring, "gas_spring"),
        _curves(tables["damper"], "speed", wheels, rollers),
        bars,
        made(rotary_damper.RotaryDamper, "rotary_damper"),
        made(stop.Stop, "bump_stop", ("sense", 1.0)),
        made(stop.Stop, "rebound_stop", ("sense", -1.0)),
        recoil.Recoil(*(row if any(recoils) else np.zeros(0) for row in resistance)),
    )


def _curves(tables: Sequence[Mapping[str, Any] | None], key: str, wheels: int, rollers: int) -> curve.Curve:
    """Curves of the left and the right side, of no leaves without any."""
    given: list[Mapping[str, Any]] = []
    given += [table for table in tables if table and table not in given][:1]
    given += [table for table in tables[1:] if table and table not in given]
    if not given:
        none = np.zeros((0, 0))
        return curve.Curve(np.zeros(0, dtype=np.int64), none, none, none)
    which: list[int] = []
    for table in tables:
        row, having = given.index(table) if table else -1, (table or {}).get("wheels") or range(1, wheels + 1)
        which += [row if k in having else -1 for k in range(1, wheels + 1)] + [-1] * (1 + rollers)
    points = max(len(table[key]) for table in given)
    at, force, stored = (np.zeros((len(given), points)) for _ in range(3))
    for row, table in enumerate(given):
        x, f = np.array(table[key]), np.array(table["force"])
        more = points - len(x)  # continue the last line
        slope = (f[-1] - f[-2]) / (x[-1] - x[-2])
        further = x[-1] + (x[-1] - x[-2]) * np.arange(1, more + 1)
        at[row], force[row] = [*x, *further], [*f, *(f[-1] + slope * (further - x[-1]))]
        work = np.concatenate([[0.0], np.cumsum(0.5 * (force[row, 1:] + force[row, :-1]) * np.diff(at[row]))])
        stored[row] = work
    found = curve.Curve(np.array(which), at, force, stored)
    for row in range(len(given)):
        leaf = which.index(row)
        stored[row] -= curve.stored(found, leaf, 0.0)
    return found


@kernel
def _along(suspension: Elements, k: int, e: float, ed: float) -> Vector:
    """Push along the spring-damper, N, stored energy, J, lost power, W, of what leaf k has there."""
    spring, gas, damper = suspension.spring, suspension.gas_spring, suspension.damper
    push, energy, lost = 0.0, 0.0, 0.0
    if len(spring.which) > 0:
        push, energy = push + curve.force(spring, k, e), energy + curve.stored(spring, k, e)
    if len(gas.area) > 0:
        push, energy = push + gas_spring.force(gas, k, e), energy + gas_spring.stored(gas, k, e)
    if len(damper.which) > 0:
        f = curve.force(damper, k, ed)
        push, lost = push + f, lost + f * ed
    return push, energy, lost


@kernel
def _about(suspension: Elements, tree: VehicleTree, k: int, q: float, qd: float) -> Vector:
    """Force against the coordinate of leaf k, N m, stored energy, J, lost power, W, of what acts on its arm."""
    bar, damper, bump, rebound = (
        suspension.torsion_bar, suspension.rotary_damper, suspension.bump_stop, suspension.rebound_stop,
    )  # fmt: skip
    pull, energy, lost = 0.0, 0.0, 0.0
    if len(bar.stiffness) > 0:
        pull, energy = bar.sense[k] * torsion_bar.moment(bar, k, q), torsion_bar.stored(bar, k, q)
    if len(damper.damping) > 0:
        m = rotary_damper.moment(damper, k, qd)
        pull, lost = pull + m, lost + m * qd
    r, dr = wheel_offset(tree, k, q)
    rise, slope = r[2] - tree.arm[k, 1], dr[2]
    if len(bump.stiffness) > 0:
        f, stored, power = stop.force(bump, k, rise, slope * qd)
        pull, energy, lost = pull + slope * f, energy + stored, lost + power
    if len(rebound.stiffness) > 0:
        f, stored, power = stop.force(rebound, k, rise, slope * qd)
        pull, energy, lost = pull - slope * f, energy + stored, lost + power
    return pull, energy, lost


@kernel
def _give(spring: recoil.Recoil, tree: VehicleTree, k: int, e: float) -> tuple[float, float]:
    if len(spring.stiffness) > 0:
        return recoil.softening(spring, tree, k, e)
    return 0.0, 0.0


@kernel
def suspend(suspension: Elements, tree: VehicleTree, k: int, q: float, qd: float) -> tuple[float, float, float, float]:
    """See ``dynamics.suspend``."""
    e, slope = compression(tree, k, q)
    push, _, lost, stored = linear_spring(tree, k, q, qd)
    s = suspension
    f, energy, power = _along(s, k, e, slope * qd)
    push, stored, lost = push + f, stored + energy, lost + power
    f, energy = _give(s.recoil, tree, k, e)
    push, stored = push - f, stored - energy
    pull, energy, power = _about(s, tree, k, q, qd)
    return push, slope * push + pull, lost + power, stored + energy


@kernel
def spring_push(suspension: Elements, tree: VehicleTree, k: int, q: float, qd: float) -> float:
    """See ``dynamics.spring_push``."""
    return suspend(suspension, tree, k, q, qd)[0]


@kernel
def put_elements(suspension: Elements, tree: VehicleTree, x: Floats, k: int, y: Floats, i: int) -> int:
    """See ``dynamics.put_elements``."""
    s, n = suspension, len(tree.is_arm)
    q, qd = x[ROOT + k], x[ROOT + 2 * n + k]
    if tree.is_arm[k] == 1:
        return _put_arm(s, tree, k, q, qd, y, i)
    return _put_recoil(s.recoil, tree, k, q, y, i)


@kernel
def _put_arm(suspension: Elements, tree: VehicleTree, k: int, q: float, qd: float, y: Floats, i: int) -> int:
    bar, bump, rebound = suspension.torsion_bar, suspension.bump_stop, suspension.rebound_stop
    r, dr = wheel_offset(tree, k, q)
    rise, rate = r[2] - tree.arm[k, 1], dr[2] * qd
    if len(bar.stiffness) > 0:
        y[i] = torsion_bar.moment(bar, k, q)
        i += 1
    if len(bump.stiffness) > 0:
        y[i] = stop.force(bump, k, rise, rate)[0]
        i += 1
    if len(rebound.stiffness) > 0:
        y[i] = stop.force(rebound, k, rise, rate)[0]
        i += 1
    return i


@kernel
def _put_recoil(spring: recoil.Recoil, tree: VehicleTree, k: int, q: float, y: Floats, i: int) -> int:
    if len(spring.stiffness) > 0 and spring.stiffness[k] > 0.0:
        y[i] = recoil.stroke(spring, tree, k, compression(tree, k, q)[0])
        i += 1
    return i


def output_ports(suspension: Elements, wheel: str) -> list[Port]:
    """Outputs of a leaf: of the arm ``wheel``, ``left.road_arm[1]``, or of a wheel with a recoil, ``left.idler``."""
    side, _, place = wheel.partition(".")
    if not place.startswith("road_arm["):
        text, above = f"how far the recoil spring of the {side} {place} gives", "" if place == "idler" else f"{place}."
        return [Port(f"{side}.{above}recoil.stroke", "output", "m", text)]
    index = place.removeprefix("road_arm")
    texts = {
        "torsion_bar": ("moment", "N.m", f"moment of the torsion bar on {wheel}, pushing its wheel down is positive"),
        "bump_stop": ("force", "N", f"force of the bump stop on the wheel of {wheel}, downwards in the hull"),
        "rebound_stop": ("force", "N", f"force of the rebound stop on the wheel of {wheel}, upwards in the hull"),
    }
    return [
        Port(f"{side}.{name}{index}.{what}", "output", unit, text)
        for name, (what, unit, text) in texts.items()
        if len(getattr(suspension, name).stiffness) > 0
    ]


def slopes(suspension: Elements, tree: VehicleTree, k: int, lever_squared: float) -> tuple[float, float]:
    """Bounds of stiffness, N m/rad, and damping, N m s/rad, of the elements of leaf k about its pivot.

    ``lever_squared``: largest lever of the spring-damper, squared, m2. A gas spring counts at half of its volume.
    """
    s, wheel_squared = suspension, float((tree.arm[k] ** 2).sum())
    stiffness, damping = 0.0, 0.0
    for found, is_spring in ((s.spring, True), (s.damper, False)):
        if len(found.which) > 0 and found.which[k] >= 0:
            at, force = found.at[found.which[k]], found.force[found.which[k]]
            steepest = lever_squared * float((np.diff(force) / np.diff(at)).max())
            stiffness, damping = stiffness + steepest * is_spring, damping + steepest * (not is_spring)
    gas = s.gas_spring
    if len(gas.area) > 0:
        rate = gas.exponent[k] * gas.pressure[k] * gas.area[k] ** 2 / max(gas.volume[k], 1e-300)
        stiffness += lever_squared * float(rate) * power(2.0, float(gas.exponent[k]) + 1.0)
    if len(s.torsion_bar.stiffness) > 0:
        stiffness += float(s.torsion_bar.stiffness[k])
    if len(s.rotary_damper.damping) > 0:
        damping += float(s.rotary_damper.damping[k])
    for each in (s.bump_stop, s.rebound_stop):
        if len(each.stiffness) > 0:
            stiffness += wheel_squared * float(each.stiffness[k])
            damping += wheel_squared * float(each.damping[k])
    return stiffness, damping
