"""Chains of rigid links."""
