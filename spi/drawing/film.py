"""A film: a figure that changes from frame to frame, written as a GIF, or by ffmpeg as an MP4."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.animation import FFMpegWriter, PillowWriter
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


def fault(form: str) -> str:
    """Why no films of a format, "gif" or "mp4", can be written here; empty if they can."""
    lacking = form == "mp4" and not FFMpegWriter.isAvailable()
    return "needs ffmpeg, which is not installed; install it, or use --film for a GIF" if lacking else ""


def as_bytes(film: Film, form: str, report: Callable[[int, int], None], fps: float | None = None) -> bytes:
    """Content of a file of a film, a "gif" or an "mp4", at `fps` frames a second.

    `report` is called with the number of frames drawn, and of all.  ValueError if there is no ffmpeg for an "mp4".
    """
    if message := fault(form):
        raise ValueError(f"a film as {form.upper()} {message}")
    speed: Any = fps or min(max(film.frames // _SECONDS, _SLOWEST), _FASTEST)
    writer = (FFMpegWriter if form == "mp4" else PillowWriter)(fps=speed)
    with scratch_folder() as folder, page.applied(page.of(film.figure)):
        path = Path(folder, f"film.{form}")
        # Not `with writer.saving(...)`, which finishes the film also when it is interrupted, and fails without a frame.
        writer.setup(film.figure, str(path), _DPI)
        for number in range(film.frames):
            report(number, film.frames)
            film.show(number)
            writer.grab_frame()
        writer.finish()
        return path.read_bytes()
