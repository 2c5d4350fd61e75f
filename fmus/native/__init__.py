"""Native FMUs: the kernels of a model as machine code behind an FMI shell in C, without Python."""
