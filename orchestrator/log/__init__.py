"""Log of a run: types, writing, reading, export, verification and recovery."""
