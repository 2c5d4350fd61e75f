"""The log of a short run of a hanging chain, and altered copies of it."""

import json

from mutated import Content

from orchestrator.execution.simulate import simulate
from orchestrator.scene.scene import load

SETTINGS = ("run.stop=0.02", "chain.links=8", "run.links=7", "expect={}")


def chain_log(tmp_path_factory):
    """Log of a hanging chain of eight links."""
    path = tmp_path_factory.mktemp("replay") / "chain.mcap"
    assert simulate(load("hanging_chain", "flexible", SETTINGS), path)["status"] == "ok"
    return path


def altered(log, path, change):
    """The log with another system.json and scene.json; all checksums are valid."""
    content = Content(log)
    tables = {name: json.loads(content.attachments[f"{name}.json"]) for name in ("system", "scene")}
    change(**tables)
    content.attachments |= {f"{name}.json": json.dumps(table).encode() for name, table in tables.items()}
    return content.write(path)
