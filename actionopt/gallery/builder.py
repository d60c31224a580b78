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
from pathlib import Path
from typing import Any

from actionopt import scenes
from actionopt.gallery.index_page import index_page
from actionopt.gallery.page import Page
from actionopt.tools.files import write

PACKAGE = Path(scenes.__file__).parent.parent
STATIC = Path(__file__).parent / "static"  # what all pages share
LIBRARIES = ("casadi", "matplotlib", "numpy")
MANIFEST = "manifest.json"
STORY, COURSE = "least", "course"
LINK = re.compile(r'<a href="(?:\.\./)?(\w+)/index\.html">(.*?)</a>')
JOBS = 2
THREADS = "OMP_NUM_THREADS"

Show = Callable[[int, int, str], None]


def build(
    directory: str | Path, names: Sequence[str] = (), *, show: Show | None = None, jobs: int = JOBS
) -> list[str]:
    """Write the pages of the scenes `names` (all by default), story, course and index.

    Parameters
    ----------
    directory : path
        Where to; made if it is not there.
    names : sequence of str
    show : callable, optional
        `show(done, total, name)` is called after each page.
    jobs : int
        Pages made at the same time, each in a process of its own; 1 makes them in this one.

    Returns
    -------
    list of str
        The names of the pages that were made. The index has all the pages there are.

    Raises
    ------
    ValueError
        If there is no such scene, or the directory has files that are not a gallery's.
    """
    for name in names:
        scenes.title(name)  # raises for one that does not exist
    target = Path(directory)
    target.mkdir(parents=True, exist_ok=True)
    written = _manifest(target)
    _keep(target, written)
    wanted = [STORY, COURSE, *dict.fromkeys(names or scenes.SCENES)]
    key = sources()
    there = {*wanted, *written}
    ahead = [name for name in wanted if not _stands(target, written.get(name), key, there)]
    for file in STATIC.iterdir():
        write(target / file.name, file.read_bytes())
    done = len(wanted) - len(ahead)
    with closing(_made(ahead, jobs)) as made:
        for name, page in made:
            without: set[str] = set()
            for file, text in page.files.items():
                write(target / file, _linked(text, there, without))
            before = written.get(name, {}).get("files", [])
            for file in set(before) - set(page.files):
                (target / file).unlink(missing_ok=True)
            written[name] = {
                "key": key,
                "files": sorted(page.files),
                "tags": page.tags,
                "motion": page.motion,
                "without": sorted(without),
            }
            _keep(target, written)
            done += 1
            if show is not None:
                show(done, len(wanted), name)
    shown = {name: entry for name, entry in written.items() if name in scenes.SCENES}
    write(target / "index.html", index_page(shown))
    return ahead


def sources(folder: Path = PACKAGE) -> str:
    """Return a digest of all that pages are made from: the package's files, and the libraries."""
    digest = sha256("".join(f"{name} {version(name)}\n" for name in LIBRARIES).encode())
    for file in sorted(folder.rglob("*")):
        if file.suffix in (".py", ".html", ".json"):
            digest.update(f"{file.relative_to(folder)}\n".encode() + file.read_bytes())
    return digest.hexdigest()


def make(name: str) -> Page:
    """Return the page of a scene, the story, or the course."""
    from actionopt.gallery import scene_page, story  # matplotlib, only now
    from actionopt.gallery.course import pages

    if name == COURSE:
        return pages.course()
    return story.story() if name == STORY else scene_page.scene_page(name)


def _made(names: Sequence[str], jobs: int) -> Generator[tuple[str, Page], None, None]:
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
            waiting = {pool.submit(make, name): name for name in names}
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


def _linked(text: str, there: set[str], without: set[str]) -> str:
    """Return a page whose links to scenes that are not there are words alone; add those names."""

    def kept(link: re.Match[str]) -> str:
        if link[1] in there or link[1] not in scenes.SCENES:
            return link[0]
        without.add(link[1])
        return link[2]

    return LINK.sub(kept, text)


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
