"""What runs: scenes and their tables, the gallery, the assembly of a scene from components, the FMUs to keep."""
