"""Start of a vehicle: its pose, and the stance of its parts."""
