"""FMUs that are not ours, each in a process of its own, which cannot harm that of the run."""
