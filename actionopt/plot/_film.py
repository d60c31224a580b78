"""The motion in space as a film: the shapes at equal times, each body with its trail."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from subprocess import CalledProcessError

import numpy as np
from matplotlib.animation import FFMpegWriter, FuncAnimation
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from actionopt.analysis.solution import Solution
from actionopt.plot import _strobe as strobe
from actionopt.plot import _style as style
from actionopt.plot._names import NO_UNITS, UnitNames
from actionopt.plot.data.arguments import check_arguments
from actionopt.plot.data.motion import Draw, motion_data
from actionopt.plot.live.film import film_page
from actionopt.tools.files import ready, whole
from actionopt.tools.files import write as write_file

FILM_SECONDS, FPS = 5.0, 25
DPI, FINE_DPI = 100, 200  # of a film of images, and of one by ffmpeg, which presses it
NEAR_WHITE = 243
AHEAD_STRENGTH = 0.25  # strength of a trail that is still to come
CODECS = {".mp4": "h264", ".webm": "libvpx-vp9"}
IMAGES = (".gif", ".png")
PAGE_SUFFIX = ".html"
FFMPEG = [
    *("-pix_fmt", "yuv420p", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white"),  # for any player
    *("-fflags", "+bitexact", "-flags:v", "+bitexact"),  # no date, no version
]
Update = Callable[[int], None]


@check_arguments
def film(
    solution: Solution,
    draw: Draw,
    file: str | Path,
    *,
    seconds: float = FILM_SECONDS,
    fps: int = FPS,
    force: bool = False,
    units: UnitNames = NO_UNITS,
) -> None:
    """Write the motion to a film that lasts `seconds`, whatever the motion's own duration.

    A file that ends in .html is a page with a player, which needs no network; one in .gif or .png
    (an animated one) needs nothing else, one in .mp4 or .webm ffmpeg. The same motion makes the
    same file. With `force` the forces of constraint are arrows.

    Raises
    ------
    ValueError
        As `motion_data`; for another ending, or no ffmpeg where it is needed.
    OSError
        If the file cannot be written.
    """
    target = film_file(file, PAGE_SUFFIX)
    count = frames(seconds, fps)
    if target.suffix.lower() == PAGE_SUFFIX:
        data = motion_data(solution, draw, count, force)
        write_file(target, film_page(data, style.heading(solution), units.time))
        return
    figure, update = _reel(solution, draw, count, force, units)
    write(figure, update, count, file, fps)


@check_arguments
def animation(
    solution: Solution,
    draw: Draw,
    *,
    seconds: float = FILM_SECONDS,
    fps: int = FPS,
    force: bool = False,
    units: UnitNames = NO_UNITS,
) -> FuncAnimation:
    """Return the film as matplotlib's animation, which a notebook shows as a player."""
    count = frames(seconds, fps)
    figure, update = _reel(solution, draw, count, force, units)
    return Shown(figure, update, count, interval=1000 / fps)


class Shown(FuncAnimation):
    """An animation that is a player in a notebook, whatever matplotlib's settings."""

    def _repr_html_(self) -> str:
        """Return the player."""
        return self.to_jshtml()


def frames(seconds: float, fps: int) -> int:
    """Return the number of frames of a film. Raises ValueError for less than two."""
    count = round(seconds * fps) if seconds > 0 and fps > 0 else 0
    if count < 2:
        raise ValueError(
            f"expected a film of at least two frames, found {seconds} seconds at {fps} frames a "
            "second"
        )
    return count


def film_file(file: str | Path, *others: str) -> Path:
    """Return where a film goes. Raises as `film`, and before anything is drawn."""
    target = ready(file, *IMAGES, *CODECS, *others)
    ending = target.suffix.lower()
    if ending in CODECS and not FFMpegWriter.isAvailable():
        raise ValueError(
            f"expected ffmpeg on the path to write {ending}, found none; install it, or write "
            f"{' or '.join(IMAGES)}, which need nothing else"
        )
    return target


def write(
    figure: Figure,
    update: Update,
    count: int,
    file: str | Path,
    fps: int,
    front: float | None = None,
) -> None:
    """Write `figure` as it is after each update(k), k = 0 ... count - 1; raises as `film`.

    If nothing moves below the zorder `front`, images have that drawn once: text takes most time.
    """
    target = film_file(file)
    ending = target.suffix.lower()
    with whole(target) as part:
        if ending in CODECS:
            _encode(figure, update, count, str(part), fps, CODECS[ending])
        else:
            first, *rest = _images(figure, update, count, ending == ".gif", front)
            first.save(part, save_all=True, append_images=rest, duration=round(1000 / fps), loop=0)


def _encode(figure: Figure, update: Update, count: int, file: str, fps: int, codec: str) -> None:
    writer = FFMpegWriter(fps, codec, extra_args=FFMPEG)
    try:
        with writer.saving(figure, file, FINE_DPI):
            for k in range(count):
                update(k)
                writer.grab_frame()
    except CalledProcessError as error:
        raise ValueError(
            f"expected an ffmpeg that knows {codec}, found {error.stderr.strip()!r}; write "
            f"{' or '.join(IMAGES)} instead"
        ) from error


def _images(
    figure: Figure, update: Update, count: int, few: bool, front: float | None = None
) -> Iterator[Image.Image]:
    """Yield the frames, in the last one's colours if there may be but `few`."""
    figure.set_dpi(DPI)
    canvas = FigureCanvasAgg(figure)
    above = []
    if front is not None:
        children = [a for ax in figure.axes for a in ax.get_children()]
        above = sorted((a for a in children if a.get_zorder() >= front), key=Artist.get_zorder)
        for artist in above:
            artist.set_animated(True)  # left out by the canvas
        canvas.draw()
        behind = canvas.copy_from_bbox(figure.bbox)

    def image(k: int) -> Image.Image:
        update(k)
        if above:
            canvas.restore_region(behind)
            for artist in above:
                figure.draw_artist(artist)
        else:
            canvas.draw()
        size = canvas.get_width_height()
        return Image.frombytes("RGBA", size, bytes(canvas.buffer_rgba())).convert("RGB")

    palette = image(count - 1).quantize(256) if few else None
    if palette is not None:  # Pillow mistakes one near white for another: all are white
        colours = np.array(palette.getpalette()).reshape(-1, 3)
        colours[colours.min(axis=1) > NEAR_WHITE] = 255
        palette.putpalette(colours.ravel().tolist())
    for k in range(count):
        found = image(k)
        yield (
            found if palette is None else found.quantize(palette=palette, dither=Image.Dither.NONE)
        )


@style.styled
def _reel(
    solution: Solution, draw: Draw, count: int, force: bool, units: UnitNames
) -> tuple[Figure, Update]:
    """Return a figure, and the function that turns it to the k-th of `count` times."""
    data = motion_data(solution, draw, count, force).flat
    view = strobe.stage(data)
    at = np.linspace(0.0, 1.0, data.trails.shape[2])
    decimals = max(0, int(np.ceil(2 - np.log10(data.t[-1] - data.t[0]))))
    figure = Figure(style.figure_size(*strobe.inches(view)), layout="constrained")
    ax = figure.subplots()
    strobe.prepare(ax, data, view, units)
    trails = []
    for b, trail in enumerate(data.trails):
        colour = strobe.body_colour(b)
        ax.plot(*trail, color=strobe.faded(colour, AHEAD_STRENGTH), **strobe.TRAIL)
        trails += ax.plot([], [], color=colour, **strobe.TRAIL)
    lines = [strobe.shape(ax, data, s, 0) for s in range(len(data.kinds))]
    pulls = strobe.arrows(ax, data, 0) if force else None
    words, heading = ax.set_title(" "), style.heading(solution)
    style.freeze_layout(figure)

    def update(k: int) -> None:
        for s, line in enumerate(lines):
            line.set_data(*strobe.outline(data, s, k))
        past = at <= k / (count - 1)
        for line, trail, place in zip(trails, data.trails, data.bodies, strict=True):
            line.set_data(*np.c_[trail[:, past], place[:, k]])
        if pulls is not None and data.forces is not None:
            pulls.set_offsets(data.bodies[:, :, k])
            pulls.set_UVC(*data.forces[:, :, k].T)
        time = f"{data.t[k]:.{decimals}f} {units.time}".rstrip()
        words.set_text(f"{heading}: $t$ = {time}")

    return figure, update
