"""Scenes, systems of FMUs, their run, their logs."""
