"""Mass on a spring as an FMU: the smallest model that uses all features of the slave."""
