"""Coupling algorithms: each module has ``ORDER`` and ``advance(stages, t, h, pool)``."""
