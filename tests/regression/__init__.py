"""Regression test: bitwise comparison of two checkouts."""
