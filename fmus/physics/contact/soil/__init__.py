"""Soil that gives way under a contact point, and keeps the rut."""
