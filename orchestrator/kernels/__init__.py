"""Compiled functions of the orchestrator: a communication step and the packing of rows, without Python's lock."""
