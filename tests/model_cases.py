"""What the tests of models share: the models under test, states, and how results are compared.

A new model is tested by one more row in MODELS_UNDER_TEST.
"""

import numpy as np
import pytest
from helpers import RIGID_BODY

from spi.compiler.inlining import uncompiled
from spi.models import LotkaVolterra, MaxwellBloch, RigidBody, SineEuler


def around_the_origin(generator, dimension=3):
    """No component near 0, where a rotation about its axis is too slow to tell right from wrong."""
    return generator.choice([-1.0, 1.0], dimension) * generator.uniform(0.4, 1.4, dimension)


def eight_components(generator):
    return around_the_origin(generator, 8)


def populations(generator):
    """Positive, and away from the equilibrium (1, 2), where nothing moves."""
    return generator.choice([0.7, 3.0], 2) * generator.uniform(0.9, 1.1, 2)


# (name, record, function that draws a state)
MODELS_UNDER_TEST = [
    ("rigid_body", RIGID_BODY, around_the_origin),
    ("rigid_body_strengths", RigidBody((1.3, 0.4, 2.2), (0.7, 5.0, 0.5), (0.5, 2.0, 0.1)), around_the_origin),
    ("rigid_body_noise_off", RigidBody((0.9, 3.0, 1.7), (1.1, 0.6, 2.5), (None, 1.5, None)), around_the_origin),
    ("maxwell_bloch", MaxwellBloch((0.7, 1.6)), around_the_origin),
    ("maxwell_bloch_noise_off", MaxwellBloch((None, 1.3)), around_the_origin),
    ("sine_euler", SineEuler((0.5, 1.5, 1.0, 0.7)), eight_components),
    ("lotka_volterra", LotkaVolterra((0.8,)), populations),
]

POINTS = 4


@pytest.fixture(params=range(POINTS), ids=lambda number: f"point{number}")
def point(request):
    return request.param


@pytest.fixture(params=MODELS_UNDER_TEST, ids=[name for name, _, _ in MODELS_UNDER_TEST])
def case(request, point):
    """(model, a random state); a generator for each, so that every test is the same when it runs alone."""
    _, model, sampler = request.param
    with uncompiled():
        yield model, tuple(sampler(np.random.default_rng([7, point])).tolist())


def close(a, b, tolerance):
    a, b = np.asarray(a), np.asarray(b)
    return np.linalg.norm(a - b) <= tolerance * max(1.0, np.linalg.norm(b))
