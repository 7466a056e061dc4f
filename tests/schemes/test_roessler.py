"""RS2 of Rößler: the mean of one step against the equation, without sampling."""

import itertools

import numpy as np
from helpers import INITIAL, RIGID_BODY
from numpy.polynomial.hermite_e import hermegauss

from spi.compiler.inlining import uncompiled
from spi.ensemble.increments import first_lane
from spi.ensemble.scheme_protocol import advance, report_row, work_size
from spi.exact.expectations import exact_expectations
from spi.numerics.rng import LANES
from spi.schemes.explicit import RoesslerRS2

TWO_NOISES = RIGID_BODY._replace(sigma=(1.0, 0.8, None))  # which do not commute
FUNCTIONS = (lambda y: y[0], lambda y: y[2] ** 2 * y[0], lambda y: y[0] * y[1] + y[2] ** 3)


def mean_after_a_step(h, spread=1.0):
    """E phi of each function after one step, by Gauss and Hermite's rule; `spread` scales what tells halves apart."""
    nodes, weights = hermegauss(4)  # exact up to degree 7, so up to the order h^3
    z = np.array(list(itertools.product(nodes, repeat=4))).T
    w = np.prod(list(itertools.product(weights / weights.sum(), repeat=4)), axis=1)
    blocks = -(-len(w) // LANES)
    z, w = (np.pad(one, [(0, 0)] * (one.ndim - 1) + [(0, blocks * LANES - len(w))]) for one in (z, w))
    found = np.zeros(len(FUNCTIONS))
    for block in np.split(np.arange(blocks * LANES), blocks):
        dW = np.zeros(9 * LANES)
        for k in range(2):
            whole, apart = np.sqrt(h) * z[k, block], np.sqrt(h) * spread * z[2 + k, block]
            for part, values in ((0, whole), (1, (whole + apart) / 2), (2, (whole - apart) / 2)):
                first = k * LANES if part == 0 else first_lane(TWO_NOISES, k, 2, part - 1)
                dW[first : first + LANES] = values
        y, work = np.repeat(INITIAL, LANES), np.zeros(work_size(RoesslerRS2(), TWO_NOISES))
        with uncompiled():
            advance(RoesslerRS2(), TWO_NOISES, h, dW, np.zeros(0), y, work, report_row())
        found += [w[block] @ phi(y.reshape(3, LANES)) for phi in FUNCTIONS]
    return found


def local_errors(spread):
    """(2, functions) at h and h / 2."""
    found = []
    for h in (2.0**-5, 2.0**-6):
        truth, _ = exact_expectations(TWO_NOISES, INITIAL, h, FUNCTIONS, 1e-11)
        found.append(np.abs(mean_after_a_step(h, spread) - truth))
    return np.array(found)


def test_a_step_is_right_to_third_order():
    """The error of one step falls by 8 when h is halved; without the areas by 4, as it is of second order."""
    errors = local_errors(1.0)
    assert np.all(np.abs(errors[0] / errors[1] - 8) < 0.8)
    without = local_errors(0.0)
    assert np.all(without[0, 1:] / without[1, 1:] < 5) and np.all(without[1, 1:] > 4 * errors[1, 1:])
