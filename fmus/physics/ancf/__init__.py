"""Elements of the absolute nodal coordinate formulation (ANCF)."""
