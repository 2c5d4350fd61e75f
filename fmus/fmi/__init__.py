"""FMUs that run in Python: their build, modelDescription.xml, calls, phases and saved states."""
