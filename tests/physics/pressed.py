"""Contact forces at a point as arrays, with separate derivatives by position and velocity."""

from __future__ import annotations

from typing import Any

import numpy as np

from fmus.physics.contact.face import Face, Penetration, contact_force, point_contact_force
from fmus.physics.contact.grounds import ground_face
from fmus.physics.contact.guide import guide_face
from fmus.physics.contact.teeth import tooth_face
from fmus.physics.contact.wheel import rim_face
from fmus.physics.point import Memory, memory


class PointContact:
    """Force of a face on a point, with derivatives."""

    def __init__(self) -> None:
        self.memory = memory()
        self.f, self.f_rate = np.zeros(3), np.zeros(3)
        self.f_x, self.f_v = np.zeros((3, 3)), np.zeros((3, 3))

    def apply(self, law: Any, share: float, depth: float, face: Face, rate: float | None = None) -> tuple[float, ...]:
        """Press a point against a face by its own or a given rate; return depth, normal force, energy, power."""
        if depth <= 0.0:
            return depth, 0.0, 0.0, 0.0

        def force_of(by_rate: float, memory: Memory) -> Any:
            if rate is None:
                return point_contact_force(law, share, depth, face, by_rate, True, memory, 0)
            return contact_force(law, share, Penetration(depth, rate, 0.0), face, by_rate, True, memory, 0)

        at_rest = force_of(0.0, Memory(*(part.copy() for part in self.memory)))
        moving = force_of(1.0, self.memory)
        self.f[:], self.f_rate[:] = at_rest.f, at_rest.by_rate
        self.f_x[:] = np.reshape(at_rest.g, (3, 3))
        self.f_v[:] = np.reshape(moving.g, (3, 3)) - self.f_x
        return depth, at_rest.normal, at_rest.energy, at_rest.friction + at_rest.damping


def _point(x: Any, v: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return tuple(map(float, x)), tuple(map(float, v))


def rim(
    law: Any, share: float, radius: float, row: Any, x: Any, v: Any, rate: float, s: PointContact
) -> tuple[float, ...]:
    """Contact with a rim that penetrates at ``rate``."""
    return s.apply(law, share, *rim_face(row, radius, *_point(x, v)), rate)


def tooth(law: Any, share: float, teeth: Any, row: Any, x: Any, v: Any, s: PointContact) -> tuple[float, ...]:
    """Contact with teeth."""
    return s.apply(law, share, *tooth_face(teeth, row, *_point(x, v)))


def soil(law: Any, share: float, ground: Any, x: Any, v: Any, s: PointContact) -> tuple[float, ...]:
    """Contact with the ground."""
    return s.apply(law, share, *ground_face(ground, *_point(x, v)))


def guide(law: Any, share: float, play: float, row: Any, x: Any, v: Any, s: PointContact) -> tuple[float, ...]:
    """Contact with a guide."""
    return s.apply(law, share, *guide_face(row, play, *_point(x, v)))
