"""``python -m orchestrator`` is the command ``cotrack``."""

from orchestrator.cli import main

main()
