"""Validity of a run: checks of its parts (``*_checks.py``), one ledger, limits in ``limits.py``."""
