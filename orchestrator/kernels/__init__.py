"""Compiled kernels of the orchestrator without Python's lock: communication step, packing of rows."""
