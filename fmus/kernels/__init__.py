"""Kernels: their compilation and linking."""
