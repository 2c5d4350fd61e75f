"""Every output of every component, recomputed from its definition.

The code shares nothing with the kernels.
"""
