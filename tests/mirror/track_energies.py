"""Expected energies of a track, and its deepest penetration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from mirror.check import View
from mirror.forces import across, pulls
from mirror.links import Rigid
from mirror.motion import rotation_of
from mirror.record import Floats
from mirror.touch import CAUSES, covering_energy
from mirror.track_series import integrated, wheel_names

MOMENT = 1e-7  # s, for differences of stored energies


def kinetic(view: View, names: Sequence[str]) -> Floats:
    return view.chain.kinetic[:, None]


def strain(view: View, names: Sequence[str]) -> Floats:
    return (view.chain.strain_energy * np.ones(len(view.part.t)))[:, None]


def gravity(view: View, names: Sequence[str]) -> Floats:
    c = view.chain
    return (c.mass * c.gravity * (c.height - c.origin[2]).sum(1))[:, None]


def contact_energy(view: View, names: Sequence[str]) -> Floats:
    return view.touch.stored[:, None]


def losses(view: View, names: Sequence[str]) -> Floats:
    """Energy lost in contacts, in the material of links, and by damping across the chain."""
    c = view.chain
    powers = {cause: view.touch.losses[:, k] for k, cause in enumerate(CAUSES)}
    powers["material"] = np.zeros(len(view.part.t)) if isinstance(c, Rigid) else c.material_loss
    powers["joints"] = across(c)[1]
    powers["pins"] = np.zeros(len(view.part.t))  # no run has bushed pins: see tests/fmus/test_bushing.py
    energies = {cause: integrated(view, power) for cause, power in powers.items()}
    for k, cause in enumerate(CAUSES):
        energies[cause] = energies[cause] + np.cumsum(view.touch.lost[:, k])
    energies["dissipated"] = sum(energies.values())
    return np.stack([energies[name.rpartition(".")[2]] for name in names], axis=1)


def causes_together(view: View, names: Sequence[str]) -> Floats:
    return sum(view.part[name] for name in view.part.outputs if name.startswith("energy.dissipated."))[:, None]


def ledger(view: View, names: Sequence[str]) -> Floats:
    """Work of wheels and end loads that is neither stored nor lost by covering.

    A wheel whose next position differs from its extrapolation has jumped; the wrenches of both steps do work on it.
    """
    part, put_in = view.part, np.zeros(len(view.part.h))
    for m, wheel in enumerate(wheel_names(view)):
        wrench = np.hstack([part.vector(f"{wheel}.{what}")[1:] for what in ("force", "torque")])
        rates = np.hstack([part.input_vectors(f"{wheel}.{what}") for what in ("velocity", "angular_velocity")])
        shift = part.input_vectors(f"{wheel}.position")[1:] - view.wheels.centre[1:-1, m]
        input_attitude = rotation_of(part.input_vectors(f"{wheel}.orientation", "wxyz"))
        end_attitude = (
            Rotation.from_rotvec(part.h[:, None] * part.input_vectors(f"{wheel}.angular_velocity")) * input_attitude
        )
        jump = np.hstack([shift, (input_attitude[1:] * end_attitude[:-1].inv()).as_rotvec()])
        put_in -= part.h * (wrench * rates).sum(1)
        put_in[1:] -= (0.5 * (wrench[1:] + wrench[:-1]) * jump).sum(1)
    stored_energy = sum(part[f"energy.{name}"] for name in ("kinetic", "strain", "gravity", "contact", "covered"))
    balance = np.concatenate([[0.0], np.cumsum(put_in)]) + part["energy.work"] - (stored_energy - stored_energy[0])
    return balance[:, None]


def patch_defect(view: View, names: Sequence[str]) -> Floats:
    """Power into contacts less their losses and the growth of stored energy a moment later, integrated, J."""
    c, w = view.chain, view.wheels
    after, before = (covering_energy(c.advanced(tau), w.advanced(tau)) for tau in (MOMENT, -MOMENT))
    return integrated(view, view.touch.covering - (after - before) / (2.0 * MOMENT))[:, None]


def end_load_work(view: View, names: Sequence[str]) -> Floats:
    """Work of the constant end forces, J."""
    c = view.chain
    first, last = pulls(c)
    way = c.pins - c.pins[0]
    return (way[:, 0] @ first + way[:, -1] @ last)[:, None]


def deepest(view: View, names: Sequence[str]) -> Floats:
    return view.touch.depth[:, None]
