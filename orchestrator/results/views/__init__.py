"""Views of a run in space: what stands where (``bodies.py``), for viewers and films."""
