"""The generic checks of a model that is no part of this package are made once; what has passed is kept on disk."""

import contextlib
import functools

from .. import digest_of, sources
from ..compiler import modules
from ..compiler.inlining import is_compiling
from ..ensemble.protocol import dimension
from .model_checks import check_model, states_around

_PASSED: set[type] = set()  # in this process


@functools.cache
def _digest_of_checks():
    """What a model has passed if it has passed the checks."""
    return digest_of(sources("checks", "compiler", "ensemble", "numerics"))


def check_once(record, initial):
    """What is wrong with a foreign model near an initial state, as :func:`check_model`.

    Nothing if a class of this code has passed before, which is kept beside the stored modules.
    """
    cls = type(record)
    if not modules.is_foreign(cls) or cls in _PASSED:
        return []
    name = f"{cls.__module__}.{cls.__qualname__}.{modules.digest(cls)}.{_digest_of_checks()}.checked"
    passed = modules.folder() / name
    if modules.digest(cls) and passed.exists():
        return []
    states = states_around(initial, record, 2 if dimension(record) <= 12 else 1)
    if not (found := check_model(record, states, written=modules.system_of(cls) is None)):
        _PASSED.add(cls)
        if modules.digest(cls) and is_compiling():
            with contextlib.suppress(OSError):  # then it is checked again in the next process
                passed.parent.mkdir(parents=True, exist_ok=True)
                passed.touch()
    return found
