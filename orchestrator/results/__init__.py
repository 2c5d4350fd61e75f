"""Evaluation of a log: arrays, energy ledger, measures, comparison with another run, side view."""
