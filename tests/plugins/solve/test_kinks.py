"""Expectations of functions with kinks and jumps without sampling: what is stated holds."""

import warnings

import numpy as np
import pytest
from phis import functions_of
from scipy.integrate import quad
from scipy.special import eval_legendre, gamma, rgamma

from spi.exact.expectations import refiner
from spi.models import MaxwellBloch, RigidBody
from spi.plugins.dynamics.exact.gibbs import law_of
from spi.plugins.solve.exact import kinks
from spi.plugins.solve.exact.harmonics import harmonics_up_to
from spi.plugins.solve.exact.refining import outlook, refined


@pytest.mark.parametrize(
    ("text", "truth", "last"),
    [
        # a grid of 8,640 by 3,456 points at which the function is asked for, 960 by 384 waves, 256 steps
        ("abs(y3-0.3)", 2.34676307, 1e-3),
        ("sqrt(abs(y2))", 1.4778266421, 1e-6),  # from `on_torus` of test_kinks_truths.py with 256 steps
    ],
)
def test_the_error_holds_at_a_kink(text, truth, last):
    """Once stated 2.34692875 +- 0.00012804 and 2.3467711 +- 0.0000022, and of the root 1.4778014 +- 0.0000210."""
    one = refiner(MaxwellBloch((0.5, 0.5)), (1.0, 2.0, 3.0), 1.0, functions_of([text], 3), last)
    values, uncertain, _ = zip(*(one.refine(number) for number in range(5)), strict=True)
    for number in (4, 5):
        found = refined(values[:number], uncertain[:number], one.rough)
        assert one.rough.all() and abs(found.value[0] - truth) < found.bound[0] < 1e-3
    assert abs(found.value[0] - truth) < last


def test_kinks_are_seen_by_where_parts_are_zero():
    texts = ["y1^2", "abs(y3 - 0.3)", "abs(y3 + 5)", "sqrt(y1)", "1/(y1 + 3)", "1/y2", "2^y1", "tan(2*y1)", "y1^16"]
    points = np.random.default_rng(1).standard_normal((3, 2000))
    points /= np.linalg.norm(points, axis=0)
    rough = [kinks.roughness(f, points) > 0.0 for f in functions_of(texts, 3)]
    assert rough == [False, True, False, True, False, True, False, True, False]


def test_the_power_at_a_kink_is_that_of_the_formula():
    texts = ["abs(y1)", "sqrt(abs(y1))", "abs(y1)^1.5", "abs(y1)^0.3*y2", "y1/abs(y1)", "sqrt(sqrt(y1^2))", "log(y1)"]
    powers = [min(part.power for part in f.singular) for f in functions_of(texts, 3)]
    assert powers == [1.0, 0.5, 1.0, 0.3, 0.0, 0.25, 0.0]


@pytest.mark.parametrize("p", [0.3, 0.5, 0.7, 1.0, 1.5])
@pytest.mark.parametrize("turned", [False, True])
def test_waves_of_a_power_lack_little_wherever_the_kink_lies(p, turned):
    """Of |cos x|^p, whose coefficients are Gamma(1 + p) 2^-p / (Gamma(1 + p/2 + k) Gamma(1 + p/2 - k)) of exp(2 i k x).

    Grids of n points that know values alone lack up to n^-(1+p) times about 1 to 3.
    """
    k = np.arange(4)
    true = gamma(1 + p) * 2.0**-p * rgamma(1 + p / 2 + k) * rgamma(1 + p / 2 - k)
    for n in (48, 96, 192):
        for share in (0.0, 0.1, 0.37, 0.5, 0.83):  # of a cell
            x, other = 2 * np.pi / n * (np.arange(n) + share), 2 * np.pi / 48 * np.arange(48)
            f = functions_of([f"abs(y1)^{p}"], 3)[0]

            def point(a, b):
                a = b if turned else a
                return np.array([np.cos(a), np.sin(a), 0.0 * b])

            found = kinks.waves(f, point, *((other, x) if turned else (x, other)), 8, 8)
            found = (found[0] if turned else found[:, 0])[2 * k] * np.exp(-2j * k * 2 * np.pi / n * share)
            assert abs(found - true).max() < 2e-3 * (2 * np.pi / n) ** (1 + p) + (7 / n) ** 4


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8)])
@pytest.mark.parametrize(
    "text", ["abs(z - 0.3)", "sqrt(abs(z - 0.3))", "((z - 0.3 + abs(z - 0.3))/2)^0.7", "abs(z)^0.3"]
)
def test_harmonics_of_powers(text, axis):
    """After the heat flow over s: sum_l (2 l + 1)/2 int phi P_l dz P_l(n . y) exp(-l (l + 1) s), phi of z = n . y."""
    s, y, degrees = 0.25, np.array([0.48, 0.6, 0.64]), np.arange(13)
    f = functions_of([text.replace("z", f"({axis[0]}*y1 + {axis[2]}*y3)")], 3)[0]
    weights = (2 * degrees + 1) / 2 * eval_legendre(degrees, np.dot(axis, y)) * np.exp(-degrees * (degrees + 1) * s)

    def part(z):
        return np.ravel(f(z * np.array(axis)[:, None]))[0] * (weights @ eval_legendre(degrees, z))

    true = sum(quad(part, a, b, epsabs=1e-10, limit=400)[0] for a, b in ((-1, 0), (0, 0.3), (0.3, 1)))
    p = min(each.power for each in f.singular)
    for L in (32, 48):
        harmonics = harmonics_up_to(L)
        found = harmonics.project([f], 1.0, [0.5])
        degree = {c: np.repeat(np.arange(L + 1), [len(m) for m in harmonics.orders[c]]) for c in found}
        e = harmonics.evaluation(y)
        value = sum(e[c] @ (found[c][:, 0] * np.exp(-degree[c] * (degree[c] + 1) * s)) for c in found)
        assert abs(value - true) < 1e-3 * L ** -(1 + p)


def test_an_error_is_not_told_before_the_order_is_seen():
    values = 1.0 + 0.5 ** np.arange(6)[:, None]
    found = [refined(values[:k], 0.0 * values[:k], [0.5]).bound[0] for k in range(1, 7)]
    assert np.isinf(found[:3]).all() and all(b >= 0.5 ** (k + 3) for k, b in enumerate(found[3:]))
    ahead = outlook(refined(values, 0.0 * values, [0.5]), 6, [1.0] * 12, 1e-2)
    assert np.isfinite(ahead.seconds) and ahead.refinements > 0


def test_a_law_of_a_function_without_values_warns_of_nothing():
    law = law_of(RigidBody((2.0, 1.0, 0.5), (1.0, 2.0, 3.0), (1.0, 1.0, 1.0)), (0.5, -0.3, 0.7), 1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        law.probabilities(functions_of(["log(y1)"], 3)[0], np.linspace(-4.0, 0.0, 3))
