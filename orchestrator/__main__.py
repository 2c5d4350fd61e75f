"""``python -m orchestrator`` is the command ``cotrack``."""

import sys

from orchestrator.log.extra import lacking


def main() -> None:
    """Run the command line; a package that is missing or broken is one sentence, with exit status 2."""
    try:
        from orchestrator.cli import main as command
    except ImportError as error:
        sys.stderr.write(f"cotrack: {lacking(error)}\n")
        sys.exit(2)
    command()


if __name__ == "__main__":
    main()
