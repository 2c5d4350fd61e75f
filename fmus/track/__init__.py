"""Base of all tracks: ports, start, kernels of a step, failures, outputs of links, contact partners."""
