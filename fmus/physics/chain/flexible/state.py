"""State and work arrays of a chain of flexible links; the common part: ``chain.state``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fmus.kernels.jit import by_reference
from fmus.physics.arrays import Floats
from fmus.physics.block_cyclic import Factors, workspace
from fmus.physics.chain import state
from fmus.physics.chain.bushing import BushArrays, bush_arrays
from fmus.physics.chain.flexible.axes_state import AxesArrays, axes_arrays
from fmus.physics.chain.link_columns import NONE, LinkForcesShape
from fmus.physics.chain.near import Near, near
from fmus.physics.chain.state import HARD, NO_RUT, GroundMemory, size, views
from fmus.physics.chain.sums import SUMS
from fmus.physics.point import ContactPoints, Memory, contact_points, memory, points

if TYPE_CHECKING:
    from types import ModuleType


FIXED = np.zeros(0)  # state of axes that do not turn


class State(NamedTuple):
    """Views into the flat state; pins (nodes) with ``width`` coordinates, m wheels."""

    flat: np.ndarray  # (size) all of the following
    p: np.ndarray  # (2, nodes, width) Cholesky coordinates and rates, from which q and v follow; (0, ...) if unused
    q: np.ndarray  # (nodes, width) coordinates: positions, m, and gradients
    v: np.ndarray  # (nodes, width) rates of ``q``, m/s and 1/s
    axes: np.ndarray  # (SIZE) see ``axes_state``; (0) where the axes of the coordinates are fixed
    a: np.ndarray  # (nodes, width) auxiliary accelerations, m/s2 and 1/s2
    vdot: np.ndarray  # (nodes, width) accelerations, m/s2 and 1/s2
    wrench: np.ndarray  # (m + 1, 6) present wrench on each wheel and, last, on the ground, N and N m
    aux: np.ndarray  # (m + 1, 6) auxiliary wrenches, N and N m
    mean: np.ndarray  # (m + 1, 6) mean wrenches over the communication step, N and N m
    on_links: np.ndarray  # (k, c) present forces on each link, see ``on_links``; k = 0 without a request
    on_links_aux: np.ndarray  # (k, c) auxiliary forces
    on_links_sum: np.ndarray  # (k, c) impulses since the interval began
    span: np.ndarray  # (2) time since then, s, and steps left of the interval
    lengths: np.ndarray  # (2) of the steps of the auxiliary values, see ``implicit``
    sums: np.ndarray  # (SUMS) of the last evaluation, see ``sums``
    turned: np.ndarray  # (k, 2) angle, rad, and work of friction, J, of bushed pins so far; k = 0 without bushes
    turning: np.ndarray  # (k, 2) their present rates, rad/s and W
    soil: np.ndarray  # (points, k) memory of the ground at the contact points; (0, 0) on hard ground
    rut: np.ndarray  # (k) rut of the chain, see ``contact.soil.memory``; (0) on hard ground


class Motion(NamedTuple):
    """Arguments of an evaluation, each (nodes, width)."""

    q: np.ndarray  # coordinates
    v: np.ndarray  # rates
    vdot: np.ndarray  # accelerations
    axes: np.ndarray = FIXED  # state of the axes of the coordinates, see ``State``


def shapes(
    width: int,
    nodes: int,
    wheels: int,
    axes: int = 0,
    forces: LinkForcesShape = NONE,
    cholesky: bool = False,
    ground: state.GroundMemory = state.HARD,
    bushed: int = 0,
) -> state.Shapes:
    """Shapes of the views; ``width``: coordinates of a pin.

    ``axes``: size of the axes' state; ``forces``: shape of the forces on each link; ``cholesky``: with its coordinates;
    ``ground``: its memory; ``bushed``: number of the chain's pins if they have bushes.
    """
    pins, on = (nodes, width), (wheels + 1, 6)
    return {
        "p": (2 * cholesky, *pins), "q": pins, "v": pins, "axes": (axes,), "a": pins, "vdot": pins,
        "wrench": on, "aux": on, "mean": on, "on_links": forces, "on_links_aux": forces, "on_links_sum": forces,
        "span": (2,), "lengths": (2,), "sums": (SUMS,),
        "turned": (bushed, 2), "turning": (bushed, 2), **ground.shapes,
    }  # fmt: skip


class ConstrainedJoints(NamedTuple):
    """Arrays for n links with m coordinates a pin.

    Pin j joins link j - 1 to link j, pin 0 the last link to link 0.
    """

    inverse: np.ndarray  # (n, 2 m, 2 m) of each link's matrix
    schur_complement: np.ndarray  # (3, n, m, m) diagonal, upper, lower
    factors: Factors  # factors of these blocks
    multipliers: np.ndarray  # (n, m) forces of the pins on the links that begin there, reversed, N
    gap: np.ndarray  # (n, m) residual of the equations
    scratch: np.ndarray  # (2 m)
    whole: tuple[int, ...]  # length 2 m
    places: np.ndarray  # (n + 1, 3) positions of the pins, m, each pin once
    rates: np.ndarray  # (n + 1, 3) their velocities, m/s


class Work(NamedTuple):
    """Arrays for elements of ``rows`` vectors along ``axes`` axes.

    m coordinates are shared a pin, n are a link's own.
    """

    before: State  # state at the beginning of a step, without a rut
    diagonal: np.ndarray  # (nodes, m, m) diagonal blocks of the condensed matrix
    upper: np.ndarray  # (nodes, m, m) blocks to the next pin
    lower: np.ndarray  # (nodes, m, m) blocks to the previous pin
    factors: Factors  # factors of these blocks
    right_side: np.ndarray  # (nodes, m) of the equations of the pins: their residual; then their correction
    iteration_matrix: (
        np.ndarray
    )  # (whole, whole) of one link; whole = rows axes + c + 2 t, c unknowns common to all, t torques a pin
    residual: np.ndarray  # (links, rows, axes) residual of each link: inertia + internal - external, N and N m
    residual_rows: np.ndarray  # (links, rows axes) the same numbers
    inner: np.ndarray  # (links, n, n) inverse of its own part
    right: np.ndarray  # (links, n, 2 m + c) inner^-1 times the coupling to pins and common unknowns
    left: np.ndarray  # (links, 2 m + c, n) coupling of these to its own part
    coupling: np.ndarray  # (n, 2 m + c) coupling of one link's own part to them
    rest: np.ndarray  # (2 m + c, 2 m + c) condensed matrix of one link
    own: np.ndarray  # (links, n) inner^-1 times its own residual
    scratch: np.ndarray  # (n) scratch
    coordinates: np.ndarray  # (rows, axes) coordinates of one link
    rates: np.ndarray  # (rows, axes) their rates, m/s and 1/s
    accelerations: np.ndarray  # (rows, axes) their accelerations, m/s2 and 1/s2
    mass: np.ndarray  # (rows, rows) mass of one link, kg
    shape_functions: np.ndarray  # (rows) at a contact point
    shape_slopes: np.ndarray  # (rows) their slopes, as the faces weight them
    unit_tangent: np.ndarray  # (3) of the centreline there; scratch of ``pins``
    wheels: np.ndarray  # (wheels, 15) wheels at the time of evaluation
    flat: np.ndarray  # (wheels, 15) wheels as the chain sees them: in its plane or axes
    touched: np.ndarray  # (links) bool: the link touches a wheel or the ground
    load: np.ndarray  # (links, rows, axes) residual of a link's contacts, if touched
    stiffening: np.ndarray  # (links, whole, whole) their iteration matrix
    wrench: np.ndarray  # (wheels + 1, 6) wrenches on the wheels and, last, on the ground, N and N m
    on_links: np.ndarray  # (k, c) forces on each link, see ``on_links``
    imbalance: np.ndarray  # (nodes, axes) forces at the pins in the last evaluation, N
    sums: np.ndarray  # (SUMS) see ``sums``
    bushes: BushArrays  # of bushed pins
    contact: Memory  # memory of sharp friction
    points: ContactPoints  # at the last iteration matrix; empty without contacts
    near: Near  # distances of links from a wheel
    axes: AxesArrays | None  # arrays of turning axes, else None
    joints: Any  # ``ConstrainedJoints`` of links that share no pins, else None
    still: np.ndarray  # (nodes, width) zeros
    change: np.ndarray  # (2, nodes, width) accelerations; unused by-products
    soil: np.ndarray  # (points, k) memory that the ground would have after the evaluation; (0, 0) on hard ground
    rut: np.ndarray  # (k) rut of the state, which changes with accepted steps only; (0) on hard ground


if TYPE_CHECKING:

    class TurningWork(Work):
        """Work of a chain whose axes turn."""

        axes: AxesArrays


def work(
    kit: ModuleType,
    links: int,
    nodes: int,
    wheels: int,
    forces: LinkForcesShape = NONE,
    contacts: int = 0,
    ground: GroundMemory = HARD,
    rut: Floats = NO_RUT,
    bushed: int = 0,
) -> Work:
    """Return zeroed arrays; ``kit``: module of the links; ``forces``: shape of the forces on each link.

    ``contacts``: most contact points, 0 if the chain can touch nothing; ``ground``: its memory, ``rut``: that part of
    it in the state; ``bushed``: number of the chain's pins if they have bushes.
    """
    rows, dims = kit.ELEMENT
    at = kit.BUSHED if bushed else kit.LAYOUT
    m, n, outer, whole = len(at.shared), len(at.own), len(at.outer), rows * dims + len(at.common) + 2 * len(at.torques)
    sizes = shapes(kit.NODE, nodes, wheels, kit.FREE, forces, ground=ground._replace(rut=0), bushed=bushed)
    block, vectors, z = (nodes, m, m), (rows, dims), np.zeros
    wheel_rows, residual = z((wheels, 15)), z((links, *vectors))
    return by_reference(Work(
        before=views(State, sizes, z(size(sizes))),
        diagonal=z(block), upper=z(block), lower=z(block), factors=workspace(nodes, m), right_side=z((nodes, m)),
        iteration_matrix=z((whole, whole)), residual=residual, residual_rows=residual.reshape(links, -1),
        inner=z((links, n, n)), right=z((links, n, outer)), left=z((links, outer, n)),
        coupling=z((n, outer)), rest=z((outer, outer)), own=z((links, n)), scratch=z(n),
        coordinates=z(vectors), rates=z(vectors), accelerations=z(vectors), mass=z((rows, rows)),
        shape_functions=z(rows), shape_slopes=z(rows), unit_tangent=z(3),
        wheels=wheel_rows, flat=wheel_rows if dims == 3 and not kit.FREE else z((wheels, 15)),
        touched=z(links, dtype=np.bool_), load=z((links, *vectors)), stiffening=z((links, whole, whole)),
        wrench=z((wheels + 1, 6)), on_links=z(forces), imbalance=z((nodes, dims)), sums=z(SUMS),
        bushes=bush_arrays(bushed),
        contact=memory(points(wheels, nodes, ground.points // links)),
        points=contact_points(contacts, (nodes, kit.NODE), (nodes, kit.NODE)),
        near=near(links),
        axes=axes_arrays(nodes, m, whole) if kit.FREE else None,
        joints=_joints(links, m) if len(at.pins) == 2 else None,
        still=z((nodes, kit.NODE)), change=z((2, nodes, kit.NODE)),
        soil=z((ground.points, ground.pending)),
        rut=rut,
    ))  # fmt: skip


def _joints(links: int, m: int) -> ConstrainedJoints:
    """Return zeroed arrays for ``links`` links with ``m`` coordinates a pin."""
    z = np.zeros
    return ConstrainedJoints(
        z((links, 2 * m, 2 * m)), z((3, links, m, m)), workspace(links, m), z((links, m)), z((links, m)), z(2 * m),
        (0,) * (2 * m), z((links + 1, 3)), z((links + 1, 3)),
    )  # fmt: skip
