"""The log of a run: its types, its writing and reading, and what can be done to a log as a whole."""
