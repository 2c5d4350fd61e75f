"""What a log says of a run: its arrays, energy ledger, measures, difference from another run, side view."""
