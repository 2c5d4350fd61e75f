"""One page about a run, or about a run and its reference: a file that needs nothing else but a browser."""
