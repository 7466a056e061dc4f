"""Spec files: YAML in, typed records out; every error names the file, the line and the key.

What reads them is imported when it is first asked for: a shell that completes the names of experiments cannot wait.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .cases import BaseCase
    from .document import SpecError, text_of
    from .experiment import PROFILES, Experiment, Layers, load

__all__ = ["PROFILES", "BaseCase", "Experiment", "Layers", "SpecError", "load", "text_of"]


def __getattr__(name: str) -> Any:
    """One of the names above."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.experiment"), name)
