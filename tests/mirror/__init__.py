"""Every output of every component computed again, from its definition, by code that shares nothing with the kernels."""
