"""The pictures of the README, and of the page on families by the examples.

python docs/pictures.py
"""

import runpy
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot

import actionopt as ao
from actionopt import plot, scenes

FOLDER = Path(__file__).parent


def solved(name, **parameters):
    """Return a scene and its solution."""
    scene = scenes.get(name, **parameters)
    return scene, ao.solve(scene.problem, guess=scene.guess)


def first(file):
    """Draw a motion, a path among its neighbours and the action around a saddle."""
    scene, motion = solved("double_pendulum")
    _, least = solved("oscillator", duration=2.5)
    _, saddle = solved("oscillator", duration=4.4)
    with matplotlib.rc_context(plot.STYLE):
        figure = pyplot.figure(figsize=(13, 4.3), layout="constrained")
        left, middle, right = figure.subplots(1, 3, width_ratios=(0.7, 1.2, 1.2))
        plot.motion(motion, scene.draw, left, count=12, units=plot.SI)
        plot.bundle(least, middle, units=plot.SI)
        plot.landscape(saddle, right, units=plot.SI)
        titles = ("between two events", "the action of its neighbours", "or stationary only")
        for ax, title in zip((left, middle, right), titles, strict=True):
            ax.set_title(title)
        figure.savefig(file, dpi=110)


def maps(name, families, file):
    """Draw an example's maps of many members."""
    example = runpy.run_path(str(FOLDER.parent / "examples" / name))
    with matplotlib.rc_context(plot.STYLE):
        axes = example["visualize"](families(example))
        axes[0].figure.savefig(file, dpi=80)


if __name__ == "__main__":
    maps(
        "09_pork_chop.py",
        lambda example: [example["transfers"](300, way) for way in (0, 1)],
        FOLDER / "pork_chop.png",
    )
    maps(
        "10_fronts.py",
        lambda example: [example["fronts"](80, T) for T in example["TIMES"]],
        FOLDER / "fronts.png",
    )
    first(FOLDER / "first.png")
    plot.save(solved("double_pendulum")[1], FOLDER / "double_pendulum.png")
    plot.relaxation_film(solved("pendulum")[1], FOLDER / "relaxation.gif", units=plot.SI)
