"""Coupling algorithms, one a module: a class with ``NAME``, ``ORDER`` and ``advance(t, h)`` over given components."""

from __future__ import annotations

from orchestrator.coupling.energy_corrected import EnergyCorrected
from orchestrator.coupling.gauss_seidel import GaussSeidel
from orchestrator.coupling.iterative import Iterative
from orchestrator.coupling.jacobi import Jacobi
from orchestrator.coupling.tracks_first import TracksFirst

SCHEMES = {scheme.NAME: scheme for scheme in (TracksFirst, Jacobi, GaussSeidel, Iterative, EnergyCorrected)}
