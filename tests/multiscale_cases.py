"""What the tests of the multiscale system share: models, schemes and paths for them."""

import numpy as np
import pytest
from helpers import INITIAL, LANES, take_steps

from spi.ensemble.protocol import dimension, noises
from spi.ensemble.scheme_protocol import memory_size
from spi.models import LotkaVolterra
from spi.schemes.asymptotic import AsymptoticPreserving, ExplicitEuler, ImplicitEuler, ImplicitMidpoint, MultiscaleEuler

RULES = {"implicit Euler": ImplicitEuler(), "midpoint": ImplicitMidpoint(), "explicit Euler": ExplicitEuler()}
IMPLICIT, MIDPOINT, EXPLICIT = RULES.values()
#: What is tested for all models: scheme and rule.
PAIRS = [
    (AsymptoticPreserving, IMPLICIT),
    (AsymptoticPreserving, MIDPOINT),
    (MultiscaleEuler, EXPLICIT),
    (MultiscaleEuler, IMPLICIT),
]
NAMES = ["AP", "AP midpoint", "explicit", "semi-implicit"]


@pytest.fixture
def generator():
    return np.random.default_rng(42)


def normals(generator, model, steps):
    return generator.standard_normal((steps, noises(model), LANES))


def start(generator, model):
    """States of length about 1, positive ones for populations."""
    y = generator.standard_normal((dimension(model), LANES))
    return np.exp(0.5 * y) if isinstance(model, LotkaVolterra) else y / np.linalg.norm(y, axis=0)


def at_rest(y=INITIAL):
    """The same state in all lanes."""
    return np.repeat(np.array(y)[:, np.newaxis], LANES, axis=1)


def go(scheme, model, h, dW, y, z=None):
    """States and processes after steps with increments dW; the processes begin at 0 unless given."""
    d = dimension(model)
    if memory_size(scheme, model):
        y = np.vstack([y, np.zeros((noises(model), LANES)) if z is None else z])
    end, _ = take_steps(scheme, model, h, dW, y)
    return end[:d], end[d:]


def distance(a, b):
    """Of states [component, lane], in every lane."""
    return np.linalg.norm(a - b, axis=0)


def mean_square_distance(a, b):
    return np.sqrt((distance(a, b) ** 2).mean())


def slope(x, y):
    """Of a line through the logarithms."""
    return np.polyfit(np.log(x), np.log(y), 1)[0]
