"""A film: a figure that changes from frame to frame, written as a GIF or, where ffmpeg is installed, as MP4."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.figure import Figure

from . import page

FORMS = ("gif", "mp4")

_DPI = 100
_SECONDS = 8  # that a film takes, unless it has few frames or very many
_SLOWEST, _FASTEST = 2, 25  # frames a second


class Film(NamedTuple):
    """A figure and what changes it."""

    figure: Figure
    frames: int
    show: Callable[[int], None]  #: makes the figure that of frame 0, ..., frames - 1


def as_file(film: Film, form: str, report: Callable[[int, int], None]) -> bytes:
    """The content of the file of a film, "gif" or "mp4"; `report` is told the frames drawn and how many there are.

    ValueError if the program that makes MP4 is not installed.
    """
    writer = _writer(form, film.frames)
    with tempfile.TemporaryDirectory(prefix="spi-", ignore_cleanup_errors=True) as folder, page.applied():
        path = Path(folder, f"film.{form}")
        # Not `with writer.saving(...)`, which finishes the film also when it is interrupted, and fails without a frame.
        writer.setup(film.figure, str(path), _DPI)
        for number in range(film.frames):
            report(number, film.frames)
            film.show(number)
            writer.grab_frame()
        writer.finish()
        return path.read_bytes()


def _writer(form: str, frames: int) -> AbstractMovieWriter:
    rate = min(max(frames // _SECONDS, _SLOWEST), _FASTEST)
    if form == "gif":
        return PillowWriter(fps=rate)
    if not FFMpegWriter.isAvailable():
        raise ValueError("an MP4 film needs the program ffmpeg, which is not installed; install it or make a GIF")
    # Most players want both sides to be even numbers of pixels, and this way of writing colours.
    arguments = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white", "-pix_fmt", "yuv420p"]
    return FFMpegWriter(fps=rate, codec="libx264", extra_args=arguments)
