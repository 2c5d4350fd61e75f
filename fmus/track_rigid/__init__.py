"""Track of rigid links on pins."""
