"""Python interface: runs as objects, for scripts and notebooks."""
