"""Interface of a component: its model, ports, parameters, numbers and sentences."""
