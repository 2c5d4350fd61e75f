"""SSP archives of anyone: systems in systems, connectors, parameter sets, read as one system of FMUs.

Source: System Structure and Parameterization 1.0 (Modelica Association, 2019), and 2.0 where it is the same. What is
not supported is refused by name, because it would change the results.
"""
