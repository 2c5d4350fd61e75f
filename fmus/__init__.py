"""Components of a tracked vehicle, each an FMU; the modules that they share; the build of FMUs."""
