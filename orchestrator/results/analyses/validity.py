"""Validity of a run: the ledger of ``results/validity`` as an analysis."""

from __future__ import annotations

from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.results.validity.ledger import Validity, validity


def of(run: RunData, window: Window = EVER) -> Validity:
    """Limits that the run passed, as far as its log has the signals; raises LogUnreadable."""
    return validity(run, window)
