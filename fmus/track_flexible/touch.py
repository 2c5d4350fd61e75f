"""The door from the chain to its contacts: opened when a chain that touches something is compiled.

Kernels call kernels by import; numba drops the call where ``contacts`` is None, and with these stand-ins the contact
modules are then not even imported.
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload


def touch_links(contacts, links, q, v, w, by_rate, tangent) -> None:
    """See ``contacts.touch_links``."""
    from fmus.track_flexible import contacts as kernels

    kernels.touch_links(contacts, links, q, v, w, by_rate, tangent)


def touch_pins(contacts, q, v, w, by_rate, tangent) -> None:
    """See ``contacts.touch_pins``."""
    from fmus.track_flexible import contacts as kernels

    kernels.touch_pins(contacts, q, v, w, by_rate, tangent)


def touch_beams(contacts, links, q, v, w, by_rate, tangent) -> None:
    """See ``beam_contacts.touch``."""
    from fmus.track_flexible import beam_contacts as kernels

    kernels.touch(contacts, links, q, v, w, by_rate, tangent)


def touch_plane(contacts, links, q, v, w, by_rate, tangent) -> None:
    """See ``planar_contacts.touch_plane``."""
    from fmus.track_flexible import planar_contacts as kernels

    kernels.touch_plane(contacts, links, q, v, w, by_rate, tangent)


@overload(touch_links)
def _links(contacts, links, q, v, w, by_rate, tangent) -> Any:
    from fmus.track_flexible.contacts import touch_links as compiled

    return lambda contacts, links, q, v, w, by_rate, tangent: compiled(
        contacts, links, q, v, w, by_rate, tangent
    )


@overload(touch_pins)
def _pins(contacts, q, v, w, by_rate, tangent) -> Any:
    from fmus.track_flexible.contacts import touch_pins as compiled

    return lambda contacts, q, v, w, by_rate, tangent: compiled(contacts, q, v, w, by_rate, tangent)


@overload(touch_beams)
def _beams(contacts, links, q, v, w, by_rate, tangent) -> Any:
    from fmus.track_flexible.beam_contacts import touch as compiled

    return lambda contacts, links, q, v, w, by_rate, tangent: compiled(
        contacts, links, q, v, w, by_rate, tangent
    )


@overload(touch_plane)
def _plane(contacts, links, q, v, w, by_rate, tangent) -> Any:
    from fmus.track_flexible.planar_contacts import touch_plane as compiled

    return lambda contacts, links, q, v, w, by_rate, tangent: compiled(
        contacts, links, q, v, w, by_rate, tangent
    )
