"""Where a run stops being valid: the ledger of ``results/validity`` as an analysis."""

from __future__ import annotations

from orchestrator.results.run_data import EVER, RunData, Window
from orchestrator.results.validity.ledger import Validity, validity


def of(run: RunData, window: Window = EVER) -> Validity:
    """All limits that were passed, as far as the signals of the log go; raises LogUnreadable."""
    return validity(run, window)
