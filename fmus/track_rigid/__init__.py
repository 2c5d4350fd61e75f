"""A track of rigid links on pins."""
