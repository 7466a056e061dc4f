"""Figures as they stand in a page: SVG among the HTML, or PNG where an SVG would be too large."""

import base64
import re
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from multiprocessing import get_context

from markupsafe import Markup, escape

from ..report import views
from ..running.compiling import processors
from ..running.orphans import end_all
from ..storage.records import Results

#: Bytes of the largest SVG that stands in a page.
LARGEST_SVG = 400_000

_DPI = 120  # of a PNG
_HEAD = re.compile(r"^.*?(?=<svg)|<metadata>.*?</metadata>|<!--.*?-->", re.DOTALL)
_DRAWN = re.compile(r'(?<= d=")[^"]*|(?<= [xy]=")[^"]*')
_DIGITS = re.compile(r"(\.\d\d)\d+(?!\d*e)")
_REFERENCE = re.compile(r'(\bid="|href="#|url\(#)')


#: Fewer figures than that are drawn by this process alone, since others would take longer to start.
_MANY = 4


def drawn(found: Sequence[Results], prefixes: Sequence[str]) -> Iterator[Markup | Exception]:
    """The :func:`picture` of each of the results, in their order, or why there is none; several processes draw many."""
    if len(found) < _MANY or processors() == 1:
        yield from map(_tried, found, prefixes)
        return
    size = min(processors(), len(found))
    ignore = signal.SIGINT, signal.SIG_IGN  # which stops this process, and it the others
    executor = ProcessPoolExecutor(size, get_context("spawn"), initializer=signal.signal, initargs=ignore)
    done = 0
    try:
        for one in executor.map(_tried, found, prefixes):
            done += 1
            yield one
    except BrokenExecutor:  # one of them was killed; this process does what is left
        yield from map(_tried, found[done:], prefixes[done:])
    finally:
        end_all(executor)


def _tried(results: Results, prefix: str) -> Markup | Exception:
    """The picture, or the error of one that cannot be drawn, so that the others are."""
    try:
        return picture(results, prefix)
    except Exception as error:
        return error


def picture(results: Results, prefix: str) -> Markup:
    """The figure of results as HTML, the ids in it beginning with `prefix`.

    ValueError if there is none for their kind or nothing to draw.
    """
    from ..drawing import as_bytes, as_svg

    figure, title = views.figure(results), escape(results.attributes.get("title", ""))
    holds_images = any(axes.images for axes in figure.axes)  # of many pixels, which an SVG would repeat
    svg = "" if holds_images else _inline(as_svg(figure), prefix)
    if 0 < len(svg) <= LARGEST_SVG:
        return Markup(svg.replace("<svg ", f'<svg role="img" aria-label="{title}" ', 1))
    png = base64.b64encode(as_bytes(figure, "png", dpi=_DPI)).decode()
    width, height = (round(96 * inches) for inches in figure.get_size_inches())
    return Markup(f'<img src="data:image/png;base64,{png}" width="{width}" height="{height}" alt="Figure: {title}">')


def _inline(svg: str, prefix: str) -> str:
    """An SVG as it may stand among HTML: without its head, its ids unlike those of others, with two decimals."""
    svg = _DRAWN.sub(lambda drawn: _DIGITS.sub(r"\1", drawn.group()), _HEAD.sub("", svg))
    return _REFERENCE.sub(rf"\g<1>{prefix}-", svg)
