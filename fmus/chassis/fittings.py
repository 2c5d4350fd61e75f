"""Hitch and seats as a chassis has them: its ports, states and parts; dispatch of their kernels and of contacts.

A chassis without them imports none of these modules. A dispatch is resolved when a chassis that has them is compiled;
where ``contacts``, ``hitch`` or ``seats`` is None numba removes the calls.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fmus.chassis.tree import VehicleTree
from fmus.interface.model import InvalidParameter
from fmus.interface.ports import Port
from fmus.kernels.jit import dispatch
from fmus.physics.arrays import Floats, Matrix, Vector


class Fittings:
    """Hitch and seats of a chassis with a ``config``, see ``chassis.model.Model``.

    ``first_input``, ``first_state``: indices of the first input and the first state that belong to them. Raises
    InvalidParameter where the vehicle table has no hitch or not these seats.
    """

    def __init__(
        self, vehicle: Mapping[str, Any], config: Mapping[str, Any], first_input: int, first_state: int
    ) -> None:
        self._origin = vehicle["chassis"]["centre"]
        self._place: Mapping[str, Any] | None = vehicle.get("hitch") if config.get("hitch") else None
        self._table, self._names = vehicle.get("seat", {}), tuple(config.get("seats", ()))
        self._first_input, self._first_state = first_input, first_state
        self.inputs: list[Port] = []
        self.outputs: list[Port] = []
        self.parameters: list[Port] = []
        self.free: Mapping[str, str] = {}  # of ``interface.model.FreeParameters``
        self.end = first_state  # index after their states
        if config.get("hitch"):
            from fmus.chassis import hitch

            if self._place is None:
                raise InvalidParameter("chassis.hitch: the vehicle has no table hitch")
            self.inputs, self.outputs = hitch.input_ports(), hitch.output_ports()
            self.parameters, self.free = hitch.parameter_ports(), hitch.FREE
            self.end += hitch.STATES
        self._first_seat = self.end
        if self._names:
            from fmus.chassis import seats

            self.outputs = [*self.outputs, *seats.output_ports(self._names)]
            self.end += seats.STATES * len(self._names)

    def hitch(self, parameters: Mapping[str, Any]) -> Any:
        """Hitch with the load of the checked parameters, None without one; raises InvalidParameter."""
        if self._place is None:
            return None
        from fmus.chassis.hitch import hitch

        x, y, z = self._origin
        place = self._place["x"] - x, 0.0 - y, self._place["z"] - z
        return hitch(place, self._first_input, self._first_state, parameters)

    def seats(self) -> Any:
        """Seats, None without any; raises InvalidParameter."""
        if not self._names:
            return None
        from fmus.chassis.seats import seats

        return seats(self._table, self._names, self._origin, self._first_seat)


def _contacts(kind: type) -> Any:
    from fmus.chassis import contacts as kernels

    return kernels


def _hitch(kind: type) -> Any:
    from fmus.chassis import hitch as kernels

    return kernels


def _seats(kind: type) -> Any:
    from fmus.chassis import seats as kernels

    return kernels


@dispatch(_contacts, shared=True)
def touch(contacts: Any, tree: VehicleTree, x: Floats, A: Matrix, v: Vector, w: Vector) -> None:
    """See ``contacts.touch``."""


@dispatch(_hitch)
def pull(hitch: Any, x: Floats, A: Matrix, u: Floats, out: Floats) -> tuple[Vector, Vector]:  # type: ignore[empty-body]
    """See ``hitch.pull``."""


@dispatch(_hitch)
def set_time(hitch: Any, x: Floats, t: float) -> None:
    """See ``hitch.set_time``."""


@dispatch(_hitch)
def put_hitch(hitch: Any, x: Floats, A: Matrix, y: Floats, i: int) -> int:  # type: ignore[empty-body]
    """See ``hitch.put_hitch``."""


@dispatch(_seats)
def keep_velocities(seats: Any, x: Floats, A: Matrix) -> None:
    """See ``seats.keep_velocities``."""


@dispatch(_seats)
def put_accelerations(seats: Any, x: Floats, A: Matrix, h: float) -> None:
    """See ``seats.put_accelerations``."""


@dispatch(_seats)
def put_seats(seats: Any, x: Floats, A: Matrix, y: Floats, i: int) -> None:
    """See ``seats.put_seats``."""
