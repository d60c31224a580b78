"""The package where only Ipopt may find the first path."""

from functools import partial

from benchmarks.peers._peer import TOLERANCES, Peer
from benchmarks.peers.actionopt_ import again, cold

PEER = Peer(
    ("actionopt", "casadi"),
    TOLERANCES,
    partial(cold, method="ipopt"),
    partial(again, method="ipopt"),
)
