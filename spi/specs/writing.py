"""Specs that are Python data instead of files: written as YAML, so that they are read, checked and stored as any other.

NumPy numbers and arrays become numbers and lists, complex numbers texts such as ``0.1+0.3i``, records mappings.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import yaml

_WIDTH = 110  # of a line of a stored spec


def as_yaml(data: Mapping[str, Any]) -> str:
    """The text of a spec file; SpecError is raised when that is read, if anything is wrong with the data."""
    return yaml.safe_dump(plain(data), sort_keys=False, allow_unicode=True, default_flow_style=None, width=_WIDTH)


def as_override(key: str, value: Any) -> str:
    """``key=value`` as ``spi.specs.load`` takes overrides, in one line."""
    text = yaml.safe_dump(plain(value), sort_keys=False, allow_unicode=True, default_flow_style=True, width=2**31)
    value_text = text.removesuffix("...\n").strip()  # the end of a document, which follows a number or a word
    return f"{key}={value_text}"


def plain(value: Any) -> Any:
    """Some data as dicts with texts as keys, lists, texts, numbers, True, False and None."""
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list | tuple | range):
        return [plain(inner) for inner in value]
    if isinstance(value, complex):
        return f"{value.real!r}{value.imag:+}i"
    return value if value is None or isinstance(value, bool | int | float) else str(value)
