"""What the figures of all kinds share, and how a figure becomes files."""

import contextlib
import os
from pathlib import Path

from matplotlib.figure import Figure as Figure  # for those who may not ask matplotlib

from . import style


def save(figure: Figure, folder: str | Path, stem: str) -> tuple[Path, Path]:
    """Write ``<stem>.pdf`` and ``<stem>.png`` into ``folder``, each aside first and then moved into place."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    # Without a date and the name of the program the same results give the same bytes.
    for form, metadata in (("pdf", {"CreationDate": None}), ("png", {"Software": None})):
        temporary = folder / f".{stem}.{form}.{os.getpid()}.tmp"
        try:
            with style.applied():
                figure.savefig(temporary, format=form, metadata=metadata)
            os.replace(temporary, folder / f"{stem}.{form}")
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink()
    return folder / f"{stem}.pdf", folder / f"{stem}.png"
