"""The door from the chassis to its contacts: opened when a chassis that touches something is compiled.

Where ``contacts`` is None numba drops the call, and the contact modules are not even imported.
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload


def touch(contacts, tree, x, A, v, w) -> None:
    """See ``contacts.touch``."""
    from fmus.chassis import contacts as kernels

    kernels.touch(contacts, tree, x, A, v, w)


@overload(touch)
def _touch(contacts, tree, x, A, v, w) -> Any:
    from fmus.chassis.contacts import touch as compiled

    return lambda contacts, tree, x, A, v, w: compiled(contacts, tree, x, A, v, w)
