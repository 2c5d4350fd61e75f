"""Analyses of a run, one per module: ``of(run, ...)`` returns a NamedTuple of arrays with ``table()``."""
