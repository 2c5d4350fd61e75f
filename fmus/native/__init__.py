"""Components as machine code alone: the kernels of a model, an FMI shell in C, no Python."""
