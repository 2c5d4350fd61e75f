"""Before a run, in child processes: kernels compiled, and what a scene loads."""
