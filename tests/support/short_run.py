"""The command of a short run, and the object that a command prints."""

import json

SHORT = ("run", "hanging_chain", "--stop", "0.02", "--json")


def last(out):
    """JSON object in the last line of an output."""
    return json.loads(out.splitlines()[-1])
