"""Mutation test: one-line faults are planted, one at a time, and the tests must detect them."""
