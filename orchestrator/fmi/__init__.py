"""FMI 2.0 and 3.0 for co-simulation: files, descriptions and instances of FMUs."""
