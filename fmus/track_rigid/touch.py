"""The door from the chain to its contacts: opened when a chain that touches something is compiled.

Kernels call kernels by import; numba drops the call where ``contacts`` is None, and with this stand-in the contact
modules are then not even imported.
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload


def touch(contacts, link, closed, s, w, by_v, tangent) -> None:
    """See ``contacts.touch``."""
    from fmus.track_rigid import contacts as kernels

    kernels.touch(contacts, link, closed, s, w, by_v, tangent)


@overload(touch)
def _touch(contacts, link, closed, s, w, by_v, tangent) -> Any:
    from fmus.track_rigid.contacts import touch as compiled

    return lambda contacts, link, closed, s, w, by_v, tangent: compiled(
        contacts, link, closed, s, w, by_v, tangent
    )
