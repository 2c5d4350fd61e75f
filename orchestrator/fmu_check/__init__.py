"""Checks of any FMI 2.0 co-simulation FMU, each in a child process: one module per check, with a function ``check``."""
