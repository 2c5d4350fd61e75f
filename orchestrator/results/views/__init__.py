"""Views of a run in space: renderers of one description of the bodies (``bodies.py``)."""
