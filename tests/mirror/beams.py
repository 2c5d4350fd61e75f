"""Links that are beams."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mirror.links import Element, gauss, hermite
from mirror.record import Floats


class Beam(Element):
    """Beam; a pin has position, r_y along it, and r_x, r_z of the ending and of the beginning link."""

    width = 18
    guided = True
    shared_row = 2
    shared_nudges = tuple(np.eye(3))

    def coordinates(self, x: Floats, places: bool) -> Floats:
        first, last = (a.reshape(*a.shape[:2], 6, 3) for a in (x[:, : self.n], x[:, self.second]))
        e = self.world(np.concatenate([first[:, :, [0, 4, 1, 5]], last[:, :, [0, 2, 1, 3]]], axis=2))
        if places:
            e[:, :, [0, 4]] += self.origin
        return e

    def read(self, state: Floats) -> None:
        super().read(state)
        section = self.vehicle["section"]
        seconds = section["lateral_bending"], section["bending"]
        self.wide, self.high = (np.sqrt(12.0 * second / section["area"]) for second in seconds)

    @property
    def axes(self) -> Floats:
        """Axis of each link, the mean of its pins' axes."""
        axis = self.e[:, :, 2] + self.e[:, :, 6]
        return axis / np.linalg.norm(axis, axis=-1, keepdims=True)

    def shape(self, xi, y, z) -> Floats:
        xi, y, z = np.broadcast_arrays(np.asarray(xi, float), y, z)
        S = hermite(xi, self.pitch)
        return np.stack([S[..., 0], S[..., 1], y * (1 - xi), z * (1 - xi), S[..., 2], S[..., 3], y * xi, z * xi], -1)

    def centreline(self, xi, derivative: int = 0) -> Floats:
        S = hermite(xi, self.pitch, derivative)
        none = np.zeros_like(S[..., 0])
        return np.stack([S[..., 0], S[..., 1], none, none, S[..., 2], S[..., 3], none, none], -1)

    @cached_property
    def mass_matrix(self) -> Floats:
        """Mass of a box with the table's inertias; length beyond the pitch acts on the mean slope."""
        (x, w), (s, m) = gauss(4), gauss(2)
        M, slope, (roll, pin, yaw) = np.zeros((8, 8)), self.mean_slope, self.vehicle["track"]["inertia"]
        wide, high = (np.sqrt(6.0 * moment / self.mass) for moment in (roll + yaw - pin, roll + pin - yaw))
        for a, wa in zip(x, w, strict=True):
            for b, wb in zip(s - 0.5, m, strict=True):
                for c, wc in zip(s - 0.5, m, strict=True):
                    S = self.shape(a, b * wide, c * high)
                    M += self.mass * wa * wb * wc * np.outer(S, S)
        return M + self.excess_inertia * np.outer(slope, slope)

    @property
    def excess_inertia(self) -> float:
        roll, pin, yaw = self.vehicle["track"]["inertia"]
        return 0.5 * (pin + yaw - roll) - self.mass * self.pitch**2 / 12.0

    def point(self, t, i, xi, y, off) -> tuple[Floats, Floats]:
        S = self.shape(xi, y, off)
        return np.einsum("...a,...ai->...i", S, self.e[t, i]), np.einsum("...a,...ai->...i", S, self.v[t, i])

    def pin(self, t, j, y) -> tuple[Floats, Floats]:
        i, half = np.where(j >= self.n, j - 1, j), np.where(j >= self.n, 4, 0)
        y = np.asarray(y)[..., None]
        return self.e[t, i, half] + y * self.e[t, i, half + 2], self.v[t, i, half] + y * self.v[t, i, half + 2]

    def slope(self, xi: float, y: float, z: float) -> Floats:
        """Gradients r_x (T, n, 3) at one place of all links."""
        C, l = hermite(xi, self.pitch, 1), self.pitch
        return np.tensordot(self.e, [C[0], C[1], -y / l, -z / l, C[2], C[3], y / l, z / l], (2, 0))

    def gradients_at(self, xi: float) -> Floats:
        """Gradients r_x (T, n, 3) of the axis of all links at a fraction of their length."""
        return self.slope(xi, 0.0, 0.0)

    @property
    def young(self) -> float:
        return float(self.part.parameters["material.youngs_modulus"])

    def strain_changes(self, change: Floats) -> list[tuple[float, Floats]]:
        """Changes of the quadratic strains, with energy weights, by a ``change`` of coordinates."""
        more, less = self.parts(self.e + 0.5 * change), self.parts(self.e - 0.5 * change)
        return [(w, s - r) for (w, s), (_, r) in zip(more, less, strict=True)]

    @cached_property
    def strain_rates(self) -> list[tuple[float, Floats]]:
        return self.strain_changes(self.v)

    @property
    def damping_tension(self) -> Floats:
        tau = float(self.part.parameters["material.relaxation_time"])
        pairs = zip(self.strain_rates, self.strain_changes(self.stretch_mode), strict=True)
        return 2.0 * tau / self.pitch * sum(w * rate * by for (w, rate), (_, by) in pairs)

    @cached_property
    def material_loss(self) -> Floats:
        tau = float(self.part.parameters["material.relaxation_time"])
        return 2.0 * tau * sum(w * rate**2 for w, rate in self.strain_rates).sum(1)

    @cached_property
    def stress(self) -> Floats:
        """Largest E times Green's strain xx at the section's corners, at the Gauss points of the axis, Pa."""
        largest = 0.0
        for x in gauss(4)[0]:
            for y in (-0.5 * self.wide, 0.5 * self.wide):
                for z in (-self.vehicle["section"]["outer_fibre"], self.vehicle["section"]["outer_fibre"]):
                    slope = self.slope(x, y, z)
                    largest = np.maximum(largest, abs(self.young * 0.5 * ((slope**2).sum(-1) - 1.0)))
        return largest

    @cached_property
    def pin_axes(self) -> Floats:
        axis = np.concatenate([self.e[:, :, 2], self.e[:, -1:, 6]], axis=1)[:, : self.nodes]
        return axis / np.linalg.norm(axis, axis=-1, keepdims=True)

    @cached_property
    def fibres(self) -> tuple[Floats, Floats]:
        """E times Green's strain xx at mid-width, mean along the link, outside and inside, Pa."""
        off, (x, w) = self.vehicle["section"]["outer_fibre"], gauss(4)
        return tuple(
            sum(b * self.young * 0.5 * ((self.slope(a, 0.0, z) ** 2).sum(-1) - 1.0)
                for a, b in zip(x, w, strict=True))
            for z in (off, -off)
        )  # fmt: skip

    def energies(self, e: Floats) -> Floats:
        """Strain energy of elements at coordinates ``e`` (..., 8, 3), J."""
        return sum(w * s**2 for w, s in self.parts(e))

    def parts(self, e: Floats) -> list[tuple[float, Floats]]:
        """The energy as weights, J, and strains; the energy is the sum of weight times strain squared.

        Saint-Venant-Kirchhoff: without lateral coupling over the section, the rest of Hooke's law on the axis. Shears
        xy and xz have the torsion factor over the section; on the axis they have the rest of the transverse shear.
        """
        section, material = self.vehicle["section"], self.vehicle["material"]
        E, nu = self.young, 0.5 * material["youngs_modulus"] / material["shear_modulus"] - 1.0
        G = 0.5 * E / (1.0 + nu)
        lame = 2.0 * G * nu / (1.0 - 2.0 * nu)
        twist = section["torsion"] / (section["bending"] + section["lateral_bending"])
        volume, terms = 0.5 * section["area"] * self.pitch, []
        (x, w), (s, m) = gauss(4), gauss(2)

        rows = np.ascontiguousarray(np.moveaxis(e, (-2, -1), (0, 1)))

        def dot(u: Floats, v: Floats) -> Floats:
            return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]

        def strains(y: float, z: float) -> tuple[list[Floats], list[Floats], Floats]:
            """Normal strains, the two shears with the axis, and the shear within the section."""
            r_x = axis + y / self.pitch * widening + z / self.pitch * thickening
            return [0.5 * (dot(r_x, r_x) - 1.0), *across], [dot(r_x, r_y), dot(r_x, r_z)], within

        widening, thickening = rows[6] - rows[2], rows[7] - rows[3]
        for a, wa in zip(x, w, strict=True):
            axis = np.tensordot(self.centreline(a, 1), rows, 1)
            r_y, r_z = rows[2] + a * widening, rows[3] + a * thickening  # the same over the section
            across, within = [0.5 * (dot(r, r) - 1.0) for r in (r_y, r_z)], dot(r_y, r_z)
            for b, wb in zip(s - 0.5, m, strict=True):
                for c, wc in zip(s - 0.5, m, strict=True):
                    normal, along, within = strains(b * self.wide, c * self.high)
                    w = volume * wa * wb * wc
                    terms += [(w * E, strain) for strain in normal]
                    terms += [(w * twist * G, shear) for shear in along] + [(w * G, within)]
            normal, along, _ = strains(0.0, 0.0)
            terms.append((volume * wa * lame, sum(normal)))
            terms += [(volume * wa * (2.0 * G - E), strain) for strain in normal]
            terms += [(volume * wa * (5.0 / 6.0 - twist) * G, shear) for shear in along]
        return terms
