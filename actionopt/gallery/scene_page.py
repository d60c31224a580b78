"""The page of one scene."""

from __future__ import annotations

import io
from contextlib import redirect_stdout

from actionopt import scenes
from actionopt.gallery import film
from actionopt.gallery.page import Page, escape, frame, prose
from actionopt.gallery.texts import texts
from actionopt.solution import Solution

PROGRAM = """\
import actionopt as ao
from actionopt import scenes

scene = scenes.get("{name}")
solution = ao.solve(scene.problem, tol=1e-10, guess=scene.guess)

print("action  ", solution.action, "J s")
print("error   ", solution.error)
print("forward ", solution.compare().position)
"""


def run(name: str) -> tuple[str, str, Solution]:
    """Run the program of a scene; return it, what it printed, and its solution."""
    program, output, names = PROGRAM.format(name=name), io.StringIO(), {}
    with redirect_stdout(output):
        exec(compile(program, f"<{name}>", "exec"), names)
    return program, output.getvalue(), names["solution"]


def scene_page(name: str) -> Page:
    """Return the page of the scene `name`."""
    scene, words = scenes.get(name), texts(name)
    program, output, solution = run(name)
    main = f"""<article class="scene">
<header class="title">
<p class="crumb"><a href="../index.html">All scenes</a></p>
<h1>{escape(scene.title[0].upper() + scene.title[1:])}</h1>
<p class="source">{escape(scene.source)}</p>
</header>
<section class="opening">
<div>
<p class="statement">{escape(words.statement)}</p>
<pre class="sketch" role="img" aria-label="Sketch: {escape(words.statement)}">{escape(words.sketch)}
</pre>
{prose(words.remarks)}
</div>
{film.film(scene, solution)}
</section>
<section><h2>The program</h2>
<pre class="code" tabindex="0"><code>{escape(program)}</code></pre>
<pre class="output" tabindex="0"><samp>{escape(output)}</samp></pre>
</section>
</article>"""
    html = frame(
        f"{scene.title} - actionopt", main, root="../", description=scene.title, scripts=["film.js"]
    )
    return Page({f"{name}/index.html": html, f"{name}/motion.svg": film.thumbnail(scene, solution)})
