"""The door from the chassis to its contacts: opened when a chassis that touches something is compiled.

Where ``contacts`` is None numba drops the call, and the contact modules are not even imported.
"""

from __future__ import annotations

from typing import Any

from fmus.jit import door


def _kernels(contacts: type) -> Any:
    from fmus.chassis import contacts as kernels

    return kernels


@door(_kernels, shared=True)
def touch(contacts, tree, x, A, v, w):
    """See ``contacts.touch``."""
