"""The same physics without co-simulation: everything of a scene as one ordinary differential equation."""
