"""What the tests of single steps share: models, states and increments, and the equation of the rigid body by hand."""

import numpy as np
import pytest
from helpers import BY_HAND, LANES, ONE_NOISE, RIGID_BODY, SCHEMES, random_states

from spi.ensemble.protocol import strengths
from spi.ensemble.scheme_protocol import REPORT
from spi.models import RigidBody

MODELS = {
    "three_noises": RIGID_BODY,
    "one_noise": ONE_NOISE,
    "other_parameters": RigidBody((1.3, 0.4, 2.2), (0.7, 2.0, 0.5), (0.5, 2.0, 0.3)),
}
SPLITTINGS = tuple(BY_HAND)
JOINT = ("splitting_joint_lie", "splitting_joint", "splitting_joint_areas")
RENORMALISED = SCHEMES["euler_maruyama_renormalised"].record
SOLVES, ITERATIONS, FAILURES, RESIDUAL, ANGLE = map(REPORT.index, (*REPORT[:3], *REPORT[-2:]))


@pytest.fixture
def generator():
    return np.random.default_rng(2024)


@pytest.fixture(params=MODELS.values(), ids=MODELS.keys())
def model(request):
    return request.param


def on_the_sphere(generator):
    """States of length 1, for which the implicit equations are solvable at every h and truncated dW used here."""
    y = random_states(generator)
    return y / np.linalg.norm(y, axis=0)


def increments(generator, h, steps=None):
    shape = (3, LANES) if steps is None else (steps, 3, LANES)
    return np.sqrt(h) * np.clip(generator.standard_normal(shape), -3.0, 3.0)


def tosses(generator, steps=None):
    """Fair coins."""
    return generator.choice([-1.0, 1.0], LANES if steps is None else (steps, LANES))


def relative(a, b):
    """The largest distance of two arrays of states [component, lane], relative to the length of the second."""
    return np.max(np.linalg.norm(np.asarray(a) - b, axis=0) / np.linalg.norm(b, axis=0))


def field(model, h, dW, y):
    """h B grad H + sum_k sigma_k dW_k B grad Ĥ_k as the paper prints them (y x grad, component by component)."""
    y1, y2, y3 = y
    g1, g2, g3 = (
        h * y[k] / model.inertia[k] + strengths(model)[k] * dW[k] * y[k] / model.noise_inertia[k] for k in range(3)
    )
    return np.array([y2 * g3 - y3 * g2, y3 * g1 - y1 * g3, y1 * g2 - y2 * g1])


LOCKED = 1e40  # a moment of inertia so large that nothing turns about its axis
