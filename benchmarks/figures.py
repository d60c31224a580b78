"""The figures of the report."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

from actionopt.plot import profiles as draw
from actionopt.suite.profile import performance
from actionopt.tools.files import whole
from benchmarks import analysis as an
from benchmarks import peers

COLOURS = 160  # of a picture: ten lines on white, and what lies between
MARKS = "osD^v<>PX*"


def label(peer: str) -> str:
    """Return a peer's name in figures and tables."""
    return peers.LABELS[peer]


def rank(peer: str) -> int:
    """Return a peer's place in legends."""
    return peers.NAMES.index(peer)


def style(peer: str) -> dict:
    """Return how a peer's line is drawn."""
    k = rank(peer)
    look = {"color": f"C{k}", "marker": MARKS[k % len(MARKS)], "markersize": 4}
    if peer == an.OURS:
        return {**look, "color": "black", "linewidth": 2.0, "zorder": 3}
    return {**look, "linewidth": 1.0}


def work_precision(rows: an.Rows, titles: dict[str, str], kind: str, file: Path) -> None:
    """Draw one panel a problem: error across, time up; faster is lower, better is left."""
    count = len(rows)
    columns = min(4, count)
    lines = -(-count // columns)
    figure, axes = plt.subplots(
        lines, columns, figsize=(3.4 * columns, 2.9 * lines + 0.6), squeeze=False, sharex=True
    )
    handles = {}
    for ax, (case, by_peer) in zip(axes.flat, rows.items(), strict=False):
        for peer in sorted(by_peer, key=rank):
            errors, times = an.curve(by_peer[peer], kind)
            if errors.size:
                (handles[peer],) = ax.loglog(np.maximum(errors, 1e-16), times, **style(peer))
        if an.OURS in by_peer and not an.curve(by_peer[an.OURS], kind)[0].size:
            note = f"{label(an.OURS)}: another path, or none"
            ax.text(0.97, 0.04, note, transform=ax.transAxes, ha="right", fontsize=8)
        ax.set_title(titles[case], fontsize=10)
        ax.set_xlim(3e-2, 3e-17)
        ax.grid(True, which="major", alpha=0.3)
    for ax in axes.flat[count:]:
        ax.axis("off")
    for ax in axes[:, 0]:
        ax.set_ylabel("time (s)")
    for ax in axes[-1]:
        ax.set_xlabel("error")
    order = sorted(handles, key=rank)
    figure.suptitle(
        {
            "cold": "cold: from the definition to the path",
            "again": "again: other end points, from the last answer",
        }[kind]
        + " (lower is faster, right is more accurate)",
        fontsize=11,
    )
    figure.legend(
        [handles[p] for p in order],
        [label(p) for p in order],
        loc="lower center",
        ncols=min(6, len(order)),
        frameon=False,
    )
    figure.tight_layout(rect=(0, 0.09 / lines + 0.01, 1, 1))
    save(figure, file)


def profiles(rows: an.Rows, file: Path) -> None:
    """Draw the performance profiles at 1e-6 and 1e-9, cold and again."""
    figure, axes = plt.subplots(2, 2, figsize=(9, 6.5), sharex="row", sharey=True)
    for line, kind in zip(axes, an.KINDS, strict=True):
        for ax, target in zip(line, (1e-6, 1e-9), strict=True):
            steps = performance(an.costs(rows, kind, target))
            order = sorted(steps, key=rank)
            draw.profiles({label(p): steps[p] for p in order}, ax=ax)
            ax.get_legend().remove()
            for peer, stairs in zip(order, ax.lines, strict=True):
                look = {k: v for k, v in style(peer).items() if "mark" not in k}
                stairs.set(linestyle="-", **look)
            ax.set_title(f"{kind}, error at most {target:.0e}", fontsize=10)
    for ax in axes[-1]:
        ax.set_xlabel("within this factor of the fastest")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=6, fontsize=8, frameon=False)
    figure.tight_layout(rect=(0, 0.07, 1, 1))
    save(figure, file)


def save(figure, file: Path) -> None:
    """Write a figure with a palette, as few colours are in it: a third of the size."""
    figure.canvas.draw()
    picture = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert("RGB")
    with whole(file.with_suffix(".png")) as part:
        picture.quantize(COLOURS, Image.Quantize.MAXCOVERAGE).save(part, optimize=True)
    plt.close(figure)
