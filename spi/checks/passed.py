"""The generic checks of a model that is no part of this package are made once; what has passed is kept on disk."""

import contextlib
import functools
import hashlib

import numpy as np

from .. import digest_of, sources
from ..compiler import modules
from ..compiler.dispatch import answers
from ..compiler.inlining import is_compiling, uncompiled
from ..ensemble.protocol import dimension
from ..ensemble.special import frozen
from .model_checks import check_model
from .states import states_around, states_on_surface

_PASSED: set[tuple[type, str]] = set()  # in this process: a class, and what of it


@functools.cache
def _digest_of_checks():
    """What a model has passed if it has passed the checks."""
    return digest_of(sources("checks", "compiler", "ensemble", "numerics"))


def check_once(record, initial):
    """What is wrong with a foreign model near an initial state, as :func:`check_model`.

    Nothing if these numbers have passed before with this class and this state, which is kept beside the stored modules.
    """
    cls = type(record)
    key = hashlib.sha256(repr((tuple(record), tuple(initial))).encode()).hexdigest()[:32]
    if not modules.is_foreign(cls) or (cls, key) in _PASSED:
        return []
    name = f"{cls.__module__}.{cls.__qualname__}.{modules.digest(cls)}.{_digest_of_checks()}.checked"
    path = modules.folder() / name
    known = _known(path) if modules.digest(cls) else set()
    if key in known:
        return []
    count = 2 if dimension(record) <= 12 else 1
    own = modules.system_of(cls) is not None
    states = (states_on_surface if own else states_around)(initial, record, count)
    found = check_model(
        _moving(record) if own else record, states, written=not own and not known, finite_at=[tuple(initial)] * own
    )
    if not found:
        _PASSED.add((cls, key))
        if modules.digest(cls) and is_compiling():
            with contextlib.suppress(OSError):  # then it is checked again in the next process
                path.parent.mkdir(parents=True, exist_ok=True)
                with open(path, "a", encoding="ascii") as file:
                    file.write(key + "\n")
    return found


def _moving(record):
    """A generated model at a time at which none of its functions of time vanishes, as one may at the beginning."""
    if not answers(frozen, record):
        return record
    with uncompiled(), np.errstate(all="ignore"):
        at = [frozen(record, begin, 0.0) for begin in (0.618, 1.7, 2.9, 0.1)]
    return max(at, key=lambda model: min(map(abs, model.driving), default=0.0))


def _known(path):
    """What has passed in this process or another."""
    with contextlib.suppress(OSError, ValueError):
        return set(path.read_text(encoding="ascii").split())
    return set()
