"""Every output of every component, recomputed from its definition by code that shares nothing with the kernels."""
