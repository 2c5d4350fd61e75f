"""Saint-Venant's torsion of a rectangle with free warping; beams take ``factor``, tables ``constant``.

Timoshenko, Goodier, Theory of Elasticity, 3rd edition, section 109. Used to define sections, not in kernels.
"""

from __future__ import annotations

from math import pi, tanh


def constant(width: float, height: float) -> float:
    """Torsion constant J, m4, of a rectangle, sides in m: moment = G J x twist per length."""
    long, short = max(width, height), min(width, height)
    series = sum(tanh(0.5 * n * pi * long / short) / n**5 for n in range(1, 100, 2))
    return long * short**3 / 3.0 * (1.0 - 192.0 / pi**5 * short / long * series)


def factor(width: float, height: float) -> float:
    """Torsion constant over the polar moment Iy + Iz, the constant of a section that cannot warp."""
    return constant(width, height) / (width * height * (width**2 + height**2) / 12.0)
