"""Mechanics as pure kernels, without FMI, files or vehicles."""
