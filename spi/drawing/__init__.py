"""Tools for the figures of all kinds, and figures as bytes of files."""

import contextlib
import io
import logging
import os
import sys
from typing import Any


def _import_matplotlib() -> None:
    """Import matplotlib, which ends if the environment names a backend that it does not know; none is needed here.

    Nor does it matter for a figure that there is no folder for its settings and its list of fonts, of which it warns.
    """
    backend, log = os.environ.pop("MPLBACKEND", None), logging.getLogger("matplotlib")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        import matplotlib.font_manager
    finally:
        log.setLevel(level)
    if backend is not None:
        os.environ["MPLBACKEND"] = backend
        with contextlib.suppress(ValueError):
            matplotlib.rcParams["backend"] = backend


if "matplotlib" not in sys.modules:
    _import_matplotlib()

from matplotlib.axes import Axes as Axes  # noqa: E402
from matplotlib.figure import Figure as Figure  # noqa: E402 (for those who may not ask matplotlib)

from . import page  # noqa: E402

#: Without a date and the name of the program the same results give the same bytes.
_METADATA = {"pdf": {"CreationDate": None}, "png": {"Software": None}}


def as_bytes(figure: Figure, form: str, **options: Any) -> bytes:
    """A figure as "pdf" or "png"; `options` are those of matplotlib's ``savefig``."""
    content = io.BytesIO()
    with page.applied(page.of(figure)):
        figure.savefig(content, format=form, metadata=_METADATA[form], **options)
    return content.getvalue()


def as_svg(figure: Figure) -> str:
    """A figure as SVG.  It is drawn once: ``savefig`` would draw it twice, which takes half as long again."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    content = io.BytesIO()
    with page.applied(page.of(figure)), rc_context({"svg.hashsalt": "spi"}):  # without salt ids would be random
        FigureCanvasSVG(figure).print_svg(content, metadata={"Date": None, "Creator": None})
    return content.getvalue().decode()
