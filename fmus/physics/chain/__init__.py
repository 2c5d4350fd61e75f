"""Chains of links of any kind: what they touch."""
