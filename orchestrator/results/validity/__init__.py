"""Validity of a run: one kind of entry per module, limits in ``limits.py``."""
