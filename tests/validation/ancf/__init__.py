"""Meshes of the elements of ``fmus.physics.ancf``, with joints, and what is computed of them."""
