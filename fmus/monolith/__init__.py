"""The physics of a whole scene as one ordinary differential equation, without co-simulation."""
