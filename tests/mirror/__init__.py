"""Every output of every component, recomputed by code that shares nothing with the kernels."""
