"""The peers, one file each, imported when asked for."""

from __future__ import annotations

import importlib

from benchmarks.peers._peer import Answer, Failed, Peer, Unable

__all__ = ["LABELS", "NAMES", "QUICK", "Answer", "Failed", "Peer", "Unable", "get"]

LABELS = {  # in figures and tables, in the order of legends
    "actionopt_": "actionopt",
    "scipy_bvp": "solve_bvp",
    "dop853": "shooting, DOP853",
    "heyoka_": "shooting, heyoka",
    "casadi_collocation": "CasADi collocation",
    "rockit_": "rockit",
    "mpopt_": "mpopt",
    "dymos_": "dymos",
    "opty_": "opty",
    "lamberthub_": "lamberthub",
}
NAMES = tuple(LABELS)
QUICK = ("actionopt_", "scipy_bvp")


def get(name: str) -> Peer:
    """Return a peer by its file's name. Raises ImportError if its package is missing."""
    return importlib.import_module(f"benchmarks.peers.{name}").PEER
