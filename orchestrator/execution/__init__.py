"""Runs of scenes, coupled or monolithic, with error estimate and summary; replays of components."""
