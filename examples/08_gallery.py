"""Scenes, and pages about them: what is known exactly, what is found, and a film of the motion.

A scene is a problem whose answer somebody has written down. Here two are solved and compared with
their books; then the gallery writes a page about each, with its film, figures and numbers, the
story of least and stationary action, and an index: static files, to be opened in any browser.
The command does the same: `actionopt gallery FOLDER pendulum kepler`.

Expect: actions that agree with the closed forms to ten digits; pages in a temporary folder. Takes
ten seconds, and none when run again: what has not changed is not made again.
"""

import tempfile
from pathlib import Path

import actionopt as ao
from actionopt import gallery, scenes

chosen = ("pendulum", "kepler")
folder = Path(tempfile.gettempdir()) / "actionopt-gallery"

found = [scenes.get(name) for name in chosen]
solutions = [ao.solve(scene.problem, tol=1e-10) for scene in found]


def visualize():
    """Write the pages and return the first one to open."""
    gallery.build(folder, chosen, jobs=1)
    return folder / "index.html"


if __name__ == "__main__":
    for scene, solution in zip(found, solutions, strict=True):
        print(f"{scene.title}\n  {scene.source}")
        print(
            f"  S = {solution.action:.10f} J s, {solution.kind}; in closed form {scene.action:.10f}"
        )
    print(f"open {visualize()}")
