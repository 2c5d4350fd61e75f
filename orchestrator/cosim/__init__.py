"""Co-simulation of any FMI 2.0 FMUs: system graph, components, couplings, master, observers."""
