"""Validation: the mechanics, the couplings and the paper's comparison, each a study (``orchestrator/studies``)."""
