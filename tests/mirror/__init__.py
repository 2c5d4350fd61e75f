"""Independent computation of every output of every component from its definition, without kernels."""
