"""Of which spec, and of which code, the results in a file are."""

from pathlib import Path
from typing import Any

from .files import StorageError
from .results import read_root


def finished(path: str | Path, identity: dict[str, Any]) -> dict[str, Any] | None:
    """The root attributes of the results of this very spec, text and all, by whichever sources.

    None if a file does not hold them.
    """
    if not Path(path).exists():
        return None
    stored = read_root(path)
    same = all(stored.get(name) == value for name, value in identity.items() if name != "source_digest")
    return stored if same and stored.get("complete") else None


def check_replaceable(path: str | Path, identity: dict[str, Any]) -> None:
    """Refuse to replace results of another spec, or that other sources computed.

    A missing file is fine, and so are fewer samples of the same spec.
    """
    if not Path(path).exists():
        return
    stored = read_root(path)
    if stored.get("source_digest") != identity["source_digest"] and stored.get("paths_hash") == identity["paths_hash"]:
        raise StorageError(
            f"{path}: holds results that {computed_by(stored)}; they are kept: use --fresh to compute all anew and "
            "replace them, or --out for another folder"
        )
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


def computed_by(about: dict[str, Any]) -> str:
    """By which sources of spi results or sums were computed, of which this is known, as a clause about them."""
    version = f"spi {about['spi_version']}, " if about.get("spi_version") else ""
    return f"other sources of spi computed ({version}digest {str(about.get('source_digest'))[:8]})"


def spec_and_sources(path: str | Path) -> tuple[str, str] | None:
    """Of which spec, and by which sources, a file has results: two digests; None if there is no such file."""
    try:
        stored = read_root(path)
        return str(stored.get("spec_hash")), str(stored.get("source_digest"))
    except StorageError:
        return None
