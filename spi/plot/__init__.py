"""Pictures of stored results, as one would print them."""

import contextlib
import os
from pathlib import Path

from . import style
from .long_time import draw as _long_time
from .stability import draw as _stability
from .strong import draw as _strong
from .trajectory import draw as _trajectory
from .weak import draw as _weak
from .work_precision import draw as _work_precision

#: The kinds of study that have a figure, by ``results.attributes["kind"]``.
PLOTTERS = {
    "strong": _strong,
    "trajectory": _trajectory,
    "weak": _weak,
    "work_precision": _work_precision,
    "stability": _stability,
    "long_time": _long_time,
}


def figure(results):
    """The matplotlib figure of ``results``, drawn by the plotter of their kind."""
    kind = results.attributes.get("kind")
    if kind not in PLOTTERS:
        raise ValueError(f"there is no figure for results of kind {kind!r}; known kinds: {', '.join(PLOTTERS)}")
    with style.applied():
        return PLOTTERS[kind](results)


def save(results, folder, stem):
    """Write ``<stem>.pdf`` and ``<stem>.png`` into ``folder``, each aside first and then moved into place."""
    drawn, folder = figure(results), Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    # Without a date and the name of the program the same results give the same bytes.
    for form, metadata in (("pdf", {"CreationDate": None}), ("png", {"Software": None})):
        temporary = folder / f".{stem}.{form}.{os.getpid()}.tmp"
        try:
            with style.applied():
                drawn.savefig(temporary, format=form, metadata=metadata)
            os.replace(temporary, folder / f"{stem}.{form}")
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink()
    return folder / f"{stem}.pdf", folder / f"{stem}.png"
