"""Of which spec, and of which code, the results in a file are."""

from pathlib import Path
from typing import Any

from .files import StorageError
from .results import read_root


def is_finished(path: str | Path, identity: dict[str, Any]) -> bool:
    """Whether a file holds the results of this very spec, text and all, computed by this very code."""
    if not Path(path).exists():
        return False
    stored = read_root(path)
    return bool(stored.get("complete")) and all(stored.get(name) == value for name, value in identity.items())


def check_replaceable(path: str | Path, identity: dict[str, Any]) -> None:
    """Refuse to replace results of another spec; a missing file is fine, and so are fewer samples of the same spec."""
    if not Path(path).exists():
        return
    stored = read_root(path)
    if stored.get("spec_hash") == identity["spec_hash"]:
        return
    if stored.get("paths_hash") != identity["paths_hash"]:
        raise StorageError(
            f"{path}: holds results of another spec, or of this one before it was edited; "
            "use --fresh to replace it or --out for another folder"
        )
    if any(old > new for old, new in zip(stored["samples"], identity["samples"], strict=True)):
        raise StorageError(
            f"{path}: holds results of more samples; use --fresh to replace it or --out for another folder"
        )


def replaced_hash(path: str | Path) -> str | None:
    """The hash of the spec of which a file holds the results; None if there is no such file."""
    try:
        return read_root(path).get("spec_hash")
    except StorageError:
        return None
