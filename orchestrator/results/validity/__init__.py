"""Validity of a run: checks of its parts (``*_checks.py``), one ledger, exceeded limits in ``exceedance.py``."""
