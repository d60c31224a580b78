"""From rows to curves, ratios and profiles; no drawing here."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)
KINDS = ("cold", "again")
OURS = "actionopt_"
SPECIAL = ("lamberthub_",)  # solve one problem only

Rows = dict[str, dict[str, list[dict]]]


def curve(rows: Iterable[dict], kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Return errors and times of the successful rows of a kind, each (P,), by setting."""
    good = [r for r in rows if r["kind"] == kind and not r["status"]]
    return np.array([r["error"] for r in good]), np.array([r["time"] for r in good])


def time_at(rows: Iterable[dict], kind: str, target: float) -> float:
    """Return the least time of any setting with an error at or below the target, or infinity.

    Every peer is thus given its best setting in hindsight.
    """
    errors, times = curve(rows, kind)
    enough = errors <= target
    return float(np.min(times[enough])) if np.any(enough) else np.inf


def table(rows: Rows, kind: str, target: float) -> dict[str, dict[str, float]]:
    """Return times by problem and peer, without the peers that cannot express a problem."""
    return {
        case: {p: time_at(r, kind, target) for p, r in by_peer.items() if not unable(r)}
        for case, by_peer in rows.items()
    }


def unable(rows: Iterable[dict]) -> bool:
    """Whether a peer cannot express a problem, or is not installed."""
    return all(r["status"].startswith("unable") for r in rows)


def geometric_mean(values: Iterable[float]) -> float:
    """Return the geometric mean of the finite values; NaN if there are none."""
    logs = np.log([v for v in values if np.isfinite(v) and v > 0])
    return float(np.exp(np.mean(logs))) if logs.size else np.nan


def against(rows: Rows, kind: str, target: float, peers: Iterable[str]) -> list[float]:
    """Return the time of the fastest of `peers` / ours on each problem that one of both solved.

    Infinity where none of them came to the target, 0 where we did not and another did.
    """
    ratios = []
    for times in table(rows, kind, target).values():
        ours = times.get(OURS, np.inf)
        best = min((t for p, t in times.items() if p in peers), default=None)
        if best is not None and np.isfinite(min(ours, best)):
            ratios.append(best / ours)
    return ratios


def costs(rows: Rows, kind: str, target: float) -> dict[str, np.ndarray]:
    """Return each peer's times of all problems, infinite where it did not come to the target."""
    times = table(rows, kind, target)
    names = sorted({p for by_peer in times.values() for p in by_peer})
    return {p: np.array([t.get(p, np.inf) for t in times.values()]) for p in names}


def outcome(rows: Iterable[dict], target: float = 1e-6) -> str:
    """Return in a few words how a peer fared on a problem: how it got to the target, or not."""
    rows = [r for r in rows if r["kind"] == "cold"]
    good = [r for r in rows if not r["status"]]
    reached = [r for r in good if r["error"] <= target]
    if reached:
        return "" if reached[0]["start"] == "line" else f"{reached[0]['start']} guess"
    if good:
        return f"only {min(r['error'] for r in good):.0e}"
    said = [r["status"] for r in rows if r["status"]]
    return said[-1] if said else "not run"
