"""What the figures of all kinds share, and how a figure becomes files."""

import contextlib
import io
import os
import sys


def _import_matplotlib() -> None:
    """Import matplotlib, which ends if the environment names a backend that it does not know; none is needed here."""
    backend = os.environ.pop("MPLBACKEND", None)
    import matplotlib

    if backend is not None:
        os.environ["MPLBACKEND"] = backend
        with contextlib.suppress(ValueError):
            matplotlib.rcParams["backend"] = backend


if "matplotlib" not in sys.modules:
    _import_matplotlib()

from matplotlib.figure import Figure as Figure  # noqa: E402 (for those who may not ask matplotlib)

from . import page  # noqa: E402


def as_files(figure: Figure) -> dict[str, bytes]:
    """The content of the files of a figure: ending -> bytes, PDF and PNG."""
    files = {}
    # Without a date and the name of the program the same results give the same bytes.
    for form, metadata in (("pdf", {"CreationDate": None}), ("png", {"Software": None})):
        content = io.BytesIO()
        with page.applied(page.of(figure)):
            figure.savefig(content, format=form, metadata=metadata)
        files[form] = content.getvalue()
    return files
