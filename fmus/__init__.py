"""Components of a tracked vehicle, each an FMU; what they share; how they are built."""
