"""Validation: mechanics, couplings, comparison with the paper; studies as in ``orchestrator/studies``."""
