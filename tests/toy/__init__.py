"""A mass on a spring as an FMU: the smallest model that uses all of the slave."""
