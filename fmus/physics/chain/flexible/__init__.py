"""Chains of flexible links: cables, planar cables and beams."""
