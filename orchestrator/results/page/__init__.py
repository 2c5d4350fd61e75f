"""Report: one HTML file about a run, or a run and its reference, from the results of the analyses."""
