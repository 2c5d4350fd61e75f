"""Scenes and their tables, the gallery, assembly from components, FMUs for other tools."""
