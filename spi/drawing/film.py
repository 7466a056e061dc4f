"""A film: a figure that changes from frame to frame, written as a GIF."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from matplotlib.animation import PillowWriter
from matplotlib.figure import Figure

from .. import scratch_folder
from . import page

_DPI = 100
_SECONDS = 8  # length of a film, unless it has few frames or very many
_SLOWEST, _FASTEST = 2, 25  # frames a second


class Film(NamedTuple):
    """A figure and the function that changes it from frame to frame."""

    figure: Figure
    frames: int
    show: Callable[[int], None]  #: makes the figure that of frame 0, ..., frames - 1


def as_gif(film: Film, report: Callable[[int, int], None]) -> bytes:
    """Content of the GIF file of a film; `report` is called with the number of frames drawn, and of all."""
    writer = PillowWriter(fps=min(max(film.frames // _SECONDS, _SLOWEST), _FASTEST))
    with scratch_folder() as folder, page.applied():
        path = Path(folder, "film.gif")
        # Not `with writer.saving(...)`, which finishes the film also when it is interrupted, and fails without a frame.
        writer.setup(film.figure, str(path), _DPI)
        for number in range(film.frames):
            report(number, film.frames)
            film.show(number)
            writer.grab_frame()
        writer.finish()
        return path.read_bytes()
