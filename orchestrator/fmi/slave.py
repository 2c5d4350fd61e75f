"""Instance of an FMU in one interface, whatever its version of FMI and its process.

Numbers are exchanged with arrays, Strings with lists of bytes. Every call returns an FMI status. The functions of both
versions are in ``fmi2`` and ``fmi3``; ``cosim.processes`` has the slave of another process.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, NamedTuple, Protocol

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)  # FMI status
LogCallback = Callable[[int, str, str], None]  # FMI status, message, category
CallNote = Callable[[str], None]  # gets the name of each function before it is called
Kind = Literal["Real", "Integer", "Boolean", "String"]


class ComponentFailed(RuntimeError):
    """An FMU cannot be loaded or a call failed; the message is one sentence with the instance name."""


class ComponentEnded(ComponentFailed):
    """An FMU has ended the simulation in order; the message is one sentence with the instance name and the time."""


class NotInstantiated(RuntimeError):
    """The FMU has made no instance; its log says why, if anything does."""


class Opening(NamedTuple):
    """Data that make an instance."""

    version: str  # of FMI
    folder: str  # of the unpacked FMU
    identifier: str
    name: str
    token: str  # guid or instantiation token
    elements: Sequence[tuple[int, str, int, int]] = ()  # of FMI 3.0, see ``model_description.Elements``
    resources: str | None = None  # None: those in the folder


class Exchange(Protocol):
    """Variables of one type whose values are set from an array and got into it together."""

    def set(self) -> int:
        """Set the variables."""

    def get(self) -> int:
        """Get the variables."""

    def function(self, way: Literal["Set", "Get"]) -> str:
        """Name of the function of FMI that sets or gets them."""


class Slave(Protocol):
    """Instance of an FMU."""

    functions: Mapping[str, str]  # of FMI, by the names of these methods
    failed: str  # function of FMI that failed last

    def setup(self, start: float, stop: float | None) -> int:
        """Set the times of the experiment, s."""

    def enter_initialisation(self) -> int:
        """Enter initialisation mode."""

    def exit_initialisation(self) -> int:
        """Exit initialisation mode."""

    def exchange(self, kind: Kind, references: Sequence[int], values: Any, with_steps: bool = False) -> Exchange:
        """Exchange of variables with ``values``: float64, whole numbers as ``Loadable.whole``, a list of bytes.

        ``with_steps``: they are got after each step, as far as that saves time.
        """

    def step(self, t: float, h: float, no_rollback: bool) -> int:
        """Advance from t by h, s; ``no_rollback``: no earlier state will be restored."""

    def discarded(self) -> tuple[bool, float]:
        """Of a discarded step: whether the FMU ends the run, and the time, s, that it has reached, NaN if unknown."""

    def save(self) -> tuple[int, Any]:
        """Save the state; the result must be discarded."""

    def restore(self, state: Any) -> int:
        """Restore a saved state, which stays valid."""

    def discard(self, state: Any) -> int:
        """Release a saved state."""

    def dump(self, state: Any) -> tuple[int, bytes]:
        """Serialise a saved state."""

    def load(self, content: bytes) -> tuple[int, Any]:
        """Restore the state of these bytes; the result is that of ``save``."""

    def reset(self) -> int:
        """Return to the state after the instantiation."""

    def terminate(self) -> int:
        """End the simulation."""

    def free(self) -> int:
        """Free the instance."""


def failed(status: int) -> bool:
    """Whether a call with this status has failed; FMI has no negative ones."""
    return not 0 <= status <= WARNING


def worse(one: int, other: int) -> int:
    """The worse of two statuses, of which negative ones are none."""
    return min(one, other) if min(one, other) < 0 else max(one, other)
