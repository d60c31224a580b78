"""Write the pages, two at a time, each file whole or not at all; what stands is not made again.

The manifest keeps with every page written a digest of all that it was made from. It is written
after each page, so that an interrupted build goes on where it stopped.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import re
import signal
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import closing, contextmanager
from functools import partial
from hashlib import sha256
from importlib.metadata import version
from itertools import chain, count
from pathlib import Path
from typing import Any

from actionopt import scenes
from actionopt.gallery.index_page import index_page
from actionopt.gallery.page import Page
from actionopt.mechanics.question.problem import Problem
from actionopt.scenes import Scene
from actionopt.tools.checks import check_jobs
from actionopt.tools.files import write
from actionopt.tools.texts import PACKAGE, PACKED, read
from actionopt.tools.words import SPOKEN, language, say

LIBRARIES = ("casadi", "matplotlib", "numpy")
MANIFEST = "manifest.json"
STORY, COURSE = "least", "course"
LINK = re.compile(r'<a href="(?:\.\./)?(\w+)/index\.html">(.*?)</a>')
THREADS = "OMP_NUM_THREADS"

Show = Callable[[int, int, str], None]


def build(
    directory: str | Path,
    names: Sequence[str | Scene | Problem] = (),
    *,
    show: Show | None = None,
    jobs: int = 1,
    lang: str = "en",
) -> list[str]:
    """Write the pages of what is asked for (all scenes by default), story, course and index.

    Parameters
    ----------
    directory : path
        Where to; made if it is not there.
    names : sequence of str, Scene or Problem
        Names of scenes. A scene of one's own has a page as theirs, with its words, source, film,
        formulas and facts in SI units; a problem one to bend its path. Either is made anew every
        time, in a folder of its name.
    show : callable, optional
        `show(done, total, name)` is called after each page.
    jobs : int
        Pages made at the same time, each in a process of its own; 1 makes them in this one. In a
        script that asks for more, put the call behind `if __name__ == "__main__":`.
    lang : str
        Language of the pages: "en", "de" or "fr".

    Returns
    -------
    list of str
        The names of the pages that were made. The index has all the pages there are.

    Raises
    ------
    ValueError
        If there is no such scene, the directory has files that are not a gallery's, or a page
        cannot show a problem.
    SolveError
        If a problem of one's own is not solved.
    """
    if isinstance(names, (str, Scene, Problem)):
        raise ValueError(f"expected a list of scenes or problems, found {names!r}; put it in []")
    known = [name for name in names if isinstance(name, str)]
    for name in known:
        scenes.title(name)  # raises for one that does not exist
    own = _by_folder([question for question in names if not isinstance(question, str)])
    if lang not in SPOKEN:
        raise ValueError(f"expected a language of {', '.join(SPOKEN)}, found {lang!r}")
    check_jobs(jobs)
    target = Path(directory)
    target.mkdir(parents=True, exist_ok=True)
    written = _manifest(target)
    _keep(target, written)
    wanted = [STORY, COURSE, *dict.fromkeys(known or (() if own else scenes.SCENES))]
    key = f"{lang} {sources()}"
    there = {*wanted, *written}
    ahead = [name for name in wanted if not _stands(target, written.get(name), key, there)]
    total = len(wanted) + len(own)
    for name, content in common_files().items():
        write(target / name, content)
    done = len(wanted) - len(ahead)
    with language(lang), closing(_build_pages(ahead, jobs, lang)) as made:
        for name, page in chain(((name, _own(own[name])) for name in own), made):
            files = {
                f"{name}/{file}" if name in own else file: text for file, text in page.files.items()
            }
            without: set[str] = set()
            for file, text in files.items():
                write(target / file, _relink(text, there, without))
            before = written.get(name, {}).get("files", [])
            for file in set(before) - set(files):
                (target / file).unlink(missing_ok=True)
            written[name] = {
                "key": key,
                "files": sorted(files),
                "tags": page.tags,
                "motion": page.motion,
                "without": sorted(without),
                "title": page.title,
            }
            _keep(target, written)
            done += 1
            if show is not None:
                show(done, total, name)
    shown = {name: entry for name, entry in written.items() if name in scenes.SCENES}
    others = {name: entry for name, entry in written.items() if name not in (*shown, STORY, COURSE)}
    with language(lang):
        write(target / "index.html", index_page(shown, others))
    return [*ahead, *own]


def _by_folder(questions: Sequence[Scene | Problem]) -> dict[str, Scene | Problem]:
    """Return questions by the names of their folders: no scene's of the catalogue, each another."""
    found: dict[str, Scene | Problem] = {}
    for question in questions:
        if not isinstance(question, (Scene, Problem)):
            raise ValueError(
                f"expected names of scenes, scenes or problems, found {question!r}; a file is read "
                "by `actionopt gallery`, or by `scenes.from_file`"
            )
        plain = re.sub(r"\W+", "_", question.name).strip("_") or "problem"
        tries = chain([plain], (f"{plain}_{k}" for k in count(2)))
        found[next(x for x in tries if x not in (STORY, COURSE, *scenes.SCENES, *found))] = question
    return found


def _own(question: Scene | Problem) -> Page:
    """Return the page of a scene or a problem of the user's own, its files without a folder."""
    from actionopt.gallery.scene_page import own_page  # matplotlib, only now
    from actionopt.plot.live.page import heading_of, whole

    if isinstance(question, Scene):
        return own_page(question)
    above = '<p class="crumb"><a href="../index.html">' + say("All scenes") + "</a></p>\n"
    return Page({"index.html": whole(question, above=above)}, title=heading_of(question))


def common_files() -> dict[str, str | bytes]:
    """Return what all pages use, by the names of files: a font, styles, scripts."""
    from actionopt.plot.live.page import SCRIPTS, STATIC  # matplotlib, only now

    files = {file.name: file.read_bytes() for file in (PACKAGE / "gallery" / "static").iterdir()}
    return files | {name: read(STATIC / name) for name in ("style.css", "film.js", *SCRIPTS)}


def sources(folder: Path = PACKAGE) -> str:
    """Return a digest of all that pages are made from: the package's files, and the libraries."""
    digest = sha256("".join(f"{name} {version(name)}\n" for name in LIBRARIES).encode())
    for file in sorted(folder.rglob("*")):
        if file.suffix in (".py", ".html", ".json", PACKED.suffix):
            digest.update(f"{file.relative_to(folder)}\n".encode() + file.read_bytes())
    return digest.hexdigest()


def make(name: str) -> Page:
    """Return the page of a scene, the story, or the course."""
    from actionopt.gallery import scene_page, story  # matplotlib, only now
    from actionopt.gallery.course import pages

    if name == COURSE:
        return pages.course()
    return story.story() if name == STORY else scene_page.scene_page(name)


def _page_in(name: str, lang: str) -> Page:
    """Return a page in a language."""
    with language(lang):
        return make(name)


def _build_pages(
    names: Sequence[str], jobs: int, lang: str
) -> Generator[tuple[str, Page], None, None]:
    """Yield names and pages, as they are made."""
    if jobs == 1 or not names:
        yield from ((name, make(name)) for name in names)
        return
    # Spawned, not forked: libraries with threads of their own do not survive a fork.
    context = multiprocessing.get_context("spawn")
    leave = partial(signal.signal, signal.SIGINT, signal.SIG_IGN)  # interruptions are ours
    others = set(multiprocessing.active_children())
    with ProcessPoolExecutor(jobs, context, initializer=leave) as pool:
        with _one_thread():  # each, or they get in each other's way
            waiting = {pool.submit(_page_in, name, lang): name for name in names}
        try:
            for future in as_completed(waiting):
                yield waiting[future], future.result()
        except BaseException:  # nobody waits for the pages that have begun
            for process in set(multiprocessing.active_children()) - others:
                process.terminate()
            raise


@contextmanager
def _one_thread() -> Generator[None, None, None]:
    """Let the processes that are started now compute with one thread."""
    before = os.environ.get(THREADS)
    os.environ[THREADS] = "1"
    try:
        yield
    finally:
        del os.environ[THREADS]
        if before is not None:
            os.environ[THREADS] = before


def _relink(text: str, there: set[str], without: set[str]) -> str:
    """Return a page whose links to scenes that are not there are words alone; add those names."""

    def keep(link: re.Match[str]) -> str:
        if link[1] in there or link[1] not in scenes.SCENES:
            return link[0]
        without.add(link[1])
        return link[2]

    return LINK.sub(keep, text)


def _manifest(target: Path) -> dict[str, Any]:
    """Return what is known of the pages there; nothing of a new gallery."""
    file = target / MANIFEST
    if file.is_file():
        return json.loads(file.read_text(encoding="utf-8"))
    if any(target.iterdir()):
        raise ValueError(
            f"expected a gallery or an empty directory, found other files in {str(target)!r}; "
            "choose a directory of its own, which is made if it is not there"
        )
    return {}


def _keep(target: Path, written: Mapping[str, Any]) -> None:
    write(target / MANIFEST, json.dumps(written, indent=1, sort_keys=True))


def _stands(target: Path, entry: Mapping[str, Any] | None, key: str, there: set[str]) -> bool:
    """Return whether a page has this key, all its files, and all links to pages that are there."""
    return (
        entry is not None
        and entry["key"] == key
        and not there.intersection(entry["without"])
        and all((target / file).is_file() for file in entry["files"])
    )
