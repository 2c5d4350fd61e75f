"""Time integrators as coefficients and stage formulas, each with a declared order."""
