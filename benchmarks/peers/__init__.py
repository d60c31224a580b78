"""The peers, one file each, imported when asked for."""

from __future__ import annotations

import importlib

from benchmarks.peers._peer import Answer, Failed, Peer, Unable

__all__ = ["NAMES", "QUICK", "Answer", "Failed", "Peer", "Unable", "get"]

NAMES = (
    "actionopt_",
    "scipy_bvp",
    "dop853",
    "heyoka_",
    "casadi_collocation",
    "rockit_",
    "mpopt_",
    "dymos_",
    "opty_",
    "lamberthub_",
)
QUICK = ("actionopt_", "scipy_bvp")


def get(name: str) -> Peer:
    """Return a peer by its file's name. Raises ImportError if its package is missing."""
    return importlib.import_module(f"benchmarks.peers.{name}").PEER
