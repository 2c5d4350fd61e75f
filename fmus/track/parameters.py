"""Parameters of both tracks: integrators, and the closure of a loop by a pin or, as in paper 8.1, a stiff spring."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fmus.interface.model import InvalidParameter
from fmus.interface.ports import NOT_NEGATIVE, POSITIVE, TOLERANCE, TOLERANCES, Port, Range
from fmus.physics.integrate import generalized_alpha, hht
from fmus.physics.integrate.generalized_alpha import GeneralizedAlpha
from fmus.track.choices import HHT

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


def integrator_ports() -> tuple[Port, ...]:
    """Parameters of the integrators of links."""
    text = f"of generalised-alpha at infinite frequency, 0 to 1; of hht {hht.LEAST:g} to 1"
    return (
        Port("spectral_radius", "parameter", "1", text, 0.4, allowed=Range(0.0, 1.0, "between 0 and 1")),
        *(
            Port(f"adams.{name}", "parameter", "1", text, TOLERANCE, allowed=TOLERANCES)
            for name, text in (
                ("rtol", "relative error of a step of integrator = adams or dormand_prince"),
                ("atol", "absolute error of such a step, in m, rad, m/s and rad/s"),
            )
        ),
    )


def integrator_coefficients(p: Mapping[str, Any]) -> GeneralizedAlpha:
    """Coefficients of the implicit integrator that the parameters choose; raises InvalidParameter."""
    radius = p["spectral_radius"]
    if p["integrator"] != HHT:
        coefficients: GeneralizedAlpha = generalized_alpha.coefficients(radius)
    elif radius < hht.LEAST:
        raise InvalidParameter(f"spectral_radius = {radius:g}: integrator = '{HHT}' has {hht.LEAST:g} to 1")
    else:
        coefficients = hht.coefficients(radius)
    return coefficients
