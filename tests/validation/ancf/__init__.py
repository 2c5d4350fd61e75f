"""Meshes of the elements of ``fmus.physics.ancf`` with joints; their statics, dynamics and modes."""
