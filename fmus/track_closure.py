"""Closure of a loop of links: by a pin like all others or, as in paper 8.1, a stiff spring at a cut."""

from __future__ import annotations

from fmus.ports import NOT_NEGATIVE, POSITIVE, Port

CLOSURES = PIN, SPRING = "pin", "spring"
STIFFNESS, DAMPING = 1e9, 1e4  # of the spring, N/m and N s/m


def closure_ports() -> tuple[Port, ...]:
    """Parameters of a closed chain."""
    text = "of the spring that closes a chain with closure = 'spring'"
    return (
        Port(
            "closure",
            "parameter",
            "1",
            "how the loop is closed: pin, by the last pin as by all others; spring, by a stiff spring at a cut there",
            PIN,
            CLOSURES,
        ),
        Port("closure.stiffness", "parameter", "N/m", f"stiffness {text}", STIFFNESS, allowed=POSITIVE),
        Port("closure.damping", "parameter", "N.s/m", f"damping {text}", DAMPING, allowed=NOT_NEGATIVE),
    )
