"""Checks of any co-simulation FMU of FMI 2.0 or 3.0, each in a child process."""
