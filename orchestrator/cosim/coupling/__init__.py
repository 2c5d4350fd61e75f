"""Coupling algorithms, one per module: a class with ``NAME``, ``ORDER`` and ``advance(t, h)``."""

from __future__ import annotations

from orchestrator.cosim.coupling.gauss_seidel import GaussSeidel
from orchestrator.cosim.coupling.iterative import Iterative
from orchestrator.cosim.coupling.jacobi import Jacobi
from orchestrator.cosim.coupling.tracks_first import TracksFirst

SCHEMES = {scheme.NAME: scheme for scheme in (TracksFirst, Jacobi, GaussSeidel, Iterative)}
