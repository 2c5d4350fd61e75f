"""Time integrators as coefficients and stage formulas, each with its declared order."""
