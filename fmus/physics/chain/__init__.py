"""Chains of links of any kind: contact, state, time steps, start."""
