"""Where a run stops being valid: one kind of entry a module, its limits in ``limits.py``."""
