"""Pure kernels: mechanics without FMI, files or vehicles."""
