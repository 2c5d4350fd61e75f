"""Analyses of a run, one a module: each has ``of(run, ...)``, a NamedTuple of arrays with ``table()`` for its rows."""
