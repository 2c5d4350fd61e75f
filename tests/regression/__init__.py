"""Regression: whether two checkouts compute the same bits."""
