"""Forces of faces on a point as arrays, and what holds for all of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fmus.physics.contact.face import Face, Penetration, contact_force, point_contact_force
from fmus.physics.contact.grounds import ground_face
from fmus.physics.contact.guide import guide_face
from fmus.physics.contact.linear import Linear
from fmus.physics.contact.teeth import tooth_face
from fmus.physics.contact.wheel import rim_face
from fmus.physics.point import Memory, memory

LAW = Linear(2e6, 5e3, 0.3, 0.05)


class PointContact:
    """Force of a face on a point, with derivatives by position and by velocity."""

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


def tooth(law: Any, teeth: Any, row: Any, x: Any, v: Any, s: PointContact) -> tuple[float, ...]:
    """Contact of a pin with teeth."""
    return s.apply(law, 1.0, *tooth_face(teeth, row, *_point(x, v)))


def soil(law: Any, share: float, ground: Any, x: Any, v: Any, s: PointContact) -> tuple[float, ...]:
    """Contact with the ground."""
    return s.apply(law, share, *ground_face(ground, *_point(x, v)))


def guide(law: Any, share: float, play: float, row: Any, x: Any, v: Any, s: PointContact) -> tuple[float, ...]:
    """Contact with a guide."""
    return s.apply(law, share, *guide_face(row, play, *_point(x, v)))


def assert_derivatives(contact: Any, x: Any, v: Any, share: float = 1e-5) -> None:
    """The matrices of ``contact(x, v, s)`` are its derivatives, to a ``share`` of their largest entry."""
    s = PointContact()
    assert contact(x, v, s)[0] > 0.0
    for exact, way in ((s.f_x.copy(), 0), (s.f_v.copy(), 1)):
        for i, e in enumerate(1e-7 * 10.0**way * np.eye(3)):
            pair = []
            for sign in (1.0, -1.0):
                contact(x + sign * e * (1 - way), v + sign * e * way, s)
                pair.append(s.f.copy())
            assert (pair[0] - pair[1]) / (2.0 * e[i]) == pytest.approx(exact[:, i], abs=share * abs(exact).max())


def assert_power(contact: Any, x: Any, v: Any, seen: Any) -> None:
    """The power of the force, at the velocity ``seen`` by the face, is dissipation and growth of the stored energy."""
    s, h = PointContact(), 1e-7
    power = contact(x, v, s)[3]
    taken = -s.f @ seen
    grown = (contact(x + h * seen, v, s)[2] - contact(x - h * seen, v, s)[2]) / (2.0 * h)
    assert power > 0.0
    assert taken == pytest.approx(power + grown, rel=1e-5)
    assert taken != pytest.approx(1.03 * power + grown, rel=1e-5)
