"""Other codes (peers) on the same motion, one per module, each in a process of its own.

A peer has ``measure(case, quick, repeats)``, which returns one dict per run with ``code``, ``step`` (s), ``cpu`` (s,
whole motion) and ``pins`` at the end.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any, NamedTuple

from orchestrator.log.extra import installation
from tests.benchmarks.process import Failed, isolated


class Peer(NamedTuple):
    """Another code."""

    name: str
    package: str  # to be installed
    module: str  # module of this folder


PEERS = (
    Peer("Exudyn", "exudyn", "exudyn_loops"),
    Peer("MuJoCo", "mujoco", "mujoco_loops"),
    Peer("Pinocchio", "pinocchio", "pinocchio_loops"),
)


def runs(peer: Peer, case: str, quick: bool, repeats: int) -> tuple[list[dict[str, Any]], str]:
    """Runs of a case by a peer, or the reason why there are none."""
    if find_spec(peer.package) is None:
        return [], f"{peer.name} is not installed: {installation('benchmark')}"
    try:
        return isolated(f"peers.{peer.module}", case=case, quick=quick, repeats=repeats), ""
    except Failed as reason:
        return [], f"{peer.name}, {case}: {reason}"
