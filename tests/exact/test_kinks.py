"""Expectations of functions with kinks and jumps without sampling: what is stated holds."""

import warnings

import numpy as np

from spi.exact.gibbs import law_of
from spi.exact.kolmogorov import kinks, refiner
from spi.exact.kolmogorov.refining import outlook, refined
from spi.expressions import functions_of
from spi.models import MaxwellBloch, RigidBody

#: E|y3 - 0.3| of Maxwell-Bloch from a grid of 8,640 by 3,456 points at which the function is asked for, 960 by 384
#: waves and 256 steps, where no kink is looked for.
TRUTH = 2.34676307


def test_the_error_holds_at_a_kink():
    """Once stated 2.34692875 +- 0.00012804, and 2.3467711 +- 0.0000022 by more work."""
    one = refiner(MaxwellBloch((0.5, 0.5)), (1.0, 2.0, 3.0), 1.0, functions_of(["abs(y3-0.3)"], 3), 1e-3)
    values, uncertain = zip(*(one.refine(number) for number in range(4)), strict=True)
    found = refined(values, uncertain, one.rough)
    assert one.rough.all() and abs(found.value[0] - TRUTH) < found.bound[0] < 1e-3


def test_kinks_are_seen_by_where_parts_are_zero():
    texts = ["y1^2", "abs(y3 - 0.3)", "abs(y3 + 5)", "sqrt(y1)", "1/(y1 + 3)", "1/y2", "2^y1", "tan(2*y1)", "y1^16"]
    points = np.random.default_rng(1).standard_normal((3, 2000))
    points /= np.linalg.norm(points, axis=0)
    rough = [kinks.is_rough(f, points) for f in functions_of(texts, 3)]
    assert rough == [False, True, False, True, False, True, False, True, False]


def test_an_error_is_not_told_before_the_order_is_seen():
    values = 1.0 + 0.5 ** np.arange(6)[:, None]
    found = [refined(values[:k], 0.0 * values[:k], [True]).bound[0] for k in range(1, 7)]
    assert np.isinf(found[:3]).all() and all(b >= 0.5 ** (k + 3) for k, b in enumerate(found[3:]))
    ahead = outlook(refined(values, 0.0 * values, [True]), 6, [1.0] * 12, 1e-2)
    assert np.isfinite(ahead.seconds) and ahead.refinements > 0


def test_a_law_of_a_function_without_values_warns_of_nothing():
    law = law_of(RigidBody((2.0, 1.0, 0.5), (1.0, 2.0, 3.0), (1.0, 1.0, 1.0)), (0.5, -0.3, 0.7), 1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        law.probabilities(functions_of(["log(y1)"], 3)[0], np.linspace(-4.0, 0.0, 3))
