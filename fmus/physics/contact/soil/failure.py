"""Shear strength of soil by Mohr and Coulomb: c + p tan(phi)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.kernels.jit import kernel

if TYPE_CHECKING:
    from fmus.physics.contact.soil.parameters import Soil


@kernel
def strength(soil: Soil, p: float) -> float:
    """Largest shear stress, Pa, under the pressure ``p``, Pa; its derivative by ``p`` is ``soil.tan``."""
    return soil.cohesion + p * soil.tan
