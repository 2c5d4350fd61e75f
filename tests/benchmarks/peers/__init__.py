"""Other codes on the same motion; each is known by one module and runs in a process of its own.

A peer has ``measure(case, quick, repeats)``: one dict a run with ``code``, ``step`` (s), ``cpu`` (s over the whole
motion), and ``pins`` at its end.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any, NamedTuple

from tests.benchmarks.process import Failed, isolated


class Peer(NamedTuple):
    """Another code."""

    name: str
    package: str  # to be installed
    module: str  # of this folder


PEERS = (Peer("Exudyn", "exudyn", "exudyn_loops"), Peer("MuJoCo", "mujoco", "mujoco_loops"))


def runs(peer: Peer, case: str, quick: bool, repeats: int) -> tuple[list[dict[str, Any]], str]:
    """What a peer did of a case, or why there is nothing."""
    if find_spec(peer.package) is None:
        return [], f"{peer.name} is not installed: pip install 'cotrack[benchmark]'"
    try:
        return isolated(f"peers.{peer.module}", case=case, quick=quick, repeats=repeats), ""
    except Failed as reason:
        return [], f"{peer.name}, {case}: {reason}"
