"""Runs of scenes: coupled or as a monolith, with their errors and their summary; replays of recorded components."""
