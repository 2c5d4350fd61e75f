"""Models without an FMU: mechanics that the master steps directly, as it steps components."""
