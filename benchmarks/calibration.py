"""Is the error estimate true? Estimate against true error wherever the path is known.

    python -m benchmarks.calibration [--quick]

All scenes with a closed form, harder members of their families and layers, at four tolerances.
The page `docs/calibration.md` is written by this command.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

import actionopt as ao
from actionopt import scenes
from actionopt.scenes import Known
from actionopt.tools.files import write
from actionopt.tools.progress import steps
from benchmarks.results import DOCS, made_by, table
from benchmarks.stress.case import deviation
from benchmarks.stress.families import bodies, kink, layers, turning

PAGE = DOCS / "calibration.md"
TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
SAMPLES = 801
MEASURABLE = 1e-15  # a smaller true error cannot be told from rounding
FAR = 10.0  # times the tolerance: never, unless the status says so


@dataclass(frozen=True)
class Cell:
    """One solve: what was asked, estimated and true; `pairs` are (estimate, true) by quantity."""

    tol: float
    status: str
    success: bool
    pairs: dict[str, tuple[float, float]]

    @property
    def estimate(self) -> float:
        """Of the error of q."""
        return self.pairs["position"][0]

    @property
    def true(self) -> float:
        """Error of q."""
        return self.pairs["position"][1]


def known(quick: bool) -> dict[str, Callable[[], Known]]:
    """Return all problems by name, each built when called."""
    names = [n for n in scenes.SCENES if scenes.get(n).exact is not None]
    found: dict[str, Callable[[], Known]] = {name: partial(scenes.get, name) for name in names}
    if quick:
        return dict(list(found.items())[:5])
    for label, name, parameters in (
        ("oscillator, 10 s", "oscillator", {"duration": 10.0}),
        ("oscillator, 30.5 pi", "oscillator", {"duration": 30.5 * np.pi}),
        ("pendulum, 2.5 rad", "pendulum", {"amplitude": 2.5}),
        ("rod pendulum, 2.5 rad", "rod_pendulum", {"amplitude": 2.5}),
        ("Kepler, e = 0.9", "kepler", {"eccentricity": 0.9}),
        ("Kepler, e = 0.97", "kepler", {"eccentricity": 0.97}),
    ):
        found[label] = partial(scenes.get, name, **parameters)
    found |= {f"perihelion, e = {e}": partial(bodies.perihelion, e) for e in (0.6, 0.95, 0.99)}
    found |= {f"layer, {e:g}": partial(layers.layer, e) for e in (1e-1, *layers.WIDTHS)}
    found |= {f"P15, {e:g}": partial(turning.p15, e) for e in (1e-2, 1e-3, 1e-4)}
    found |= {f"P20, {e:g}": partial(turning.p20, e) for e in (0.5, 0.1, 0.06)}
    found |= {f"Bratu, {w}": partial(turning.bratu, w) for w in turning.BRATU}
    found |= {f"kink, {e:g}": partial(kink.kink, e) for e in (0.2, 0.1, 0.02)}
    return found


def measure(k: Known, tol: float) -> Cell:
    """Solve once and compare."""
    solution = ao.solve(k.problem, tol=tol, guess=k.guess, throw=False)
    problem = solution.problem  # with its duration, where that was to be found
    true = deviation(solution, k.exact, problem, solution.mesh.nodes)
    pairs = {"position": (float(solution.error), true or 0.0)}
    t = np.linspace(problem.start.t, problem.end.t, SAMPLES)
    velocity, forces = k.facts.velocity, k.facts.multipliers
    if velocity is None or k.exact is None:
        return Cell(tol, solution.status.name, solution.success, pairs)
    q, v = k.exact(t), velocity(t)
    least = np.max(np.abs(q), axis=1, keepdims=True) / problem.duration
    pairs["velocity"] = (float(solution.velocity_error), _relative(solution.velocity(t), v, least))
    if forces is not None:
        pairs["multiplier"] = (
            float(solution.multiplier_error),
            _relative(solution.multipliers(t), forces(q, v, t)),
        )
    return Cell(tol, solution.status.name, solution.success, pairs)


def _relative(found, exact, least=0.0) -> float:
    """Return the largest |found - exact| in units of each row's largest, or of `least` if more."""
    size = np.maximum(np.max(np.abs(exact), axis=1, keepdims=True), least)
    return float(np.max(np.abs(found - exact) / np.where(size > 0, size, 1.0)))


def page(cells: dict[str, list[Cell]]) -> str:
    """Return the page."""
    head = ["problem", *(f"tol {t:.0e}" for t in TOLERANCES)]
    lines = [
        "# Error estimates against true errors",
        "",
        made_by("calibration", "actionopt", "casadi", "numpy"),
        "",
        "The true error is the largest over time of |q - exact|, each coordinate in units of the",
        "largest |q| it reaches: what `tol` bounds and `solution.error` estimates. Velocities are",
        "measured likewise (a coordinate that hardly moves in its size over the duration), and so",
        "are multipliers.",
        "",
        *summary(cells),
        "",
        "## Cell by cell",
        "",
        "True error / estimate. Where the verdict is not SOLVED it is given.",
        "",
        *table(head, [[name, *map(_cell, row)] for name, row in cells.items()]),
    ]
    return "\n".join(lines)


def _cell(c: Cell) -> str:
    text = f"{c.true:.0e} / {c.estimate:.0e}"
    text = text if c.true <= c.tol or not c.success else f"**{text}**"
    return text if c.success else f"{text} {c.status}"


def summary(cells: dict[str, list[Cell]]) -> list[str]:
    """Return what the cells say together, with what is expected of them."""
    named = [(name, c) for name, row in cells.items() for c in row]
    good = [c for _, c in named if c.success]
    warned = [f"{name} {c.tol:.0e} {c.status}" for name, c in named if not c.success]
    met, count = sum(c.true <= c.tol for c in good), len(named)
    far = sum(c.true > FAR * c.tol for c in good)
    share = f"{met} of {count}, {100 * met / count:.1f} %"
    rows = [
        ["true error <= tol, of all cells", ">= 95 %", share],
        [f"true error > {FAR:g} tol without a warning", "never", f"{far}"],
        ["cells with a warning in `status`", "", f"{len(warned)}: {', '.join(warned)}"],
    ]
    for name in ("position", "velocity", "multiplier"):
        own = [c for c in good if name in c.pairs]
        if not own:
            continue
        estimate, true = np.array([c.pairs[name] for c in own]).T
        safe = np.mean(true <= np.maximum(estimate, MEASURABLE))
        ratio = estimate / np.maximum(true, MEASURABLE)
        medians = {t: np.median(ratio[[c.tol == t for c in own]]) for t in TOLERANCES}
        by_tol = ", ".join(f"{t:.0e}: {m:.2g}" for t, m in medians.items())
        spread = f"smallest {ratio.min():.2g}, largest {ratio.max():.1e}"
        wanted = (">= 95 %", "< 100") if name == "position" else ("", "")
        rows += [
            [f"{name}: true error <= estimate", wanted[0], f"{100 * safe:.1f} % of {len(own)}"],
            [
                f"{name}: median of estimate / true",
                wanted[1],
                f"{np.median(ratio):.2g} ({by_tol}); {spread}",
            ],
        ]
    return table(["", "expected", "found"], rows)


def main(arguments: list[str] | None = None) -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.calibration", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="five scenes; no page")
    options = parser.parse_args(arguments)
    problems = known(options.quick)
    cells = {}
    for name in steps(list(problems)):
        k = problems[name]()
        cells[name] = [measure(k, tol) for tol in TOLERANCES]
    print("\n".join(summary(cells)))
    if not options.quick:
        write(PAGE, page(cells) + "\n")


if __name__ == "__main__":
    main()
