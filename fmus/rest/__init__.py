"""Vehicle at rest: its static equilibrium, and the place of the idler."""
