"""What the kernels are timed on: the paper's parameters and initial values of every model."""

import math

from spi.ensemble.protocol import large
from spi.models import MODELS
from spi.schemes import scheme_entry

#: The models whose kernels are timed; those whose states are arrays have a benchmark of their own, zeitlin.py.
TIMED = [name for name, cls in MODELS.items() if not large(cls)]

STEP = 2.0**-16
EPS = 0.1  # of the multiscale system; its explicit scheme is stable for STEP < 2 EPS^2

_TOP = ((2.0, 1.0, 2.0 / 3.0), (1.0, 2.0, 3.0)), (math.cos(1.1), 0.0, math.sin(1.1))
_EXAMPLES = {
    "lotka_volterra": ((), (1.0, 1.0)),
    "maxwell_bloch": ((), (1.0, 2.0, 3.0)),
    "rigid_body": _TOP,
    "rigid_body_shared_noise": _TOP,
    "sine_euler": ((), (0.1, 0.3, 0.2, 0.3, 0.3, 0.2, 0.4, 0.1)),
}


def example(name):
    """(model, initial state); for a model without an entry here its default parameters and some state."""
    cls = MODELS[name]
    parameters, initial = _EXAMPLES.get(name, ((), tuple(0.5 + 0.1 * i for i in range(cls.dimension))))
    return cls(*parameters), initial


def row(scheme):
    """The row of a scheme in the table of orders."""
    return scheme_entry(scheme, EPS)


def why_not(scheme, model):
    """Why a scheme is not for a model, or None."""
    needs = row(scheme).needs
    return None if needs is None or needs(model) else f"{needs.__name__} is false"
