"""Fuzzing: random calls, files and settings, with every find kept."""
