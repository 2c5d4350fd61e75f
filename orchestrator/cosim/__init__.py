"""Co-simulation of any FMI 2.0 FMUs: the graph, loaded components, couplings, the master and what watches it."""
