"""Crossings of two curves of which the crossing is known: their 95 % intervals."""

import numpy as np
from scipy.optimize import brentq
from scipy.stats import t as student
from test_curves import at

from spi.statistics.claims import quantity
from spi.statistics.crossings import crossings
from spi.statistics.curves import curves

DEGREES = 15  # of freedom of each standard error, as of batches of time
REPETITIONS = 200
T = np.array([1.3, 1.38, 1.41, 1.43, 1.4429, 1.46, 1.48, 1.52, 1.6])
STDERR = np.array(
    [[5e-5, 2e-4, 7e-4, 1e-3, 2e-3, 3e-3, 4e-3, 6e-3, 5e-3], [1e-4, 6e-4, 7e-4, 9e-4, 1e-3, 2e-3, 2e-3, 2e-3, 4e-3]]
)


def cumulant(T, length):
    """A curve like that of Binder's cumulant of a lattice."""
    return 0.444 + 0.111 * (1 - np.tanh(((T - 1.4429) * length**1.406 - 1.9) / 5))


WHERE = brentq(lambda T: cumulant(T, 16) - cumulant(T, 8), 1.4, 1.48)
TRUTH = np.array([WHERE, cumulant(WHERE, 16)])


def covered(scale=1.0):
    """Shares of intervals of the parameter and the quantity that have the truth, whose halves are scaled."""
    rng, inside = np.random.default_rng(5), []
    for _ in range(REPETITIONS):
        lines = []
        for length, stderr in zip((16, 8), STDERR, strict=True):
            values = cumulant(T, length) + stderr * rng.standard_normal(len(T))
            half = student.ppf(0.975, DEGREES) * stderr * np.sqrt(rng.chisquare(DEGREES, len(T)) / DEGREES)
            points = [quantity("derived", at(x), v, h) for x, v, h in zip(T, values, half, strict=True)]
            lines.append((str(length), *curves(points, ["derived"])))
        ((_, _, (place,)),) = crossings(lines)
        away = np.abs(TRUTH - [place.at, place.value])
        inside.append(away <= scale * np.array([place.at_half, place.value_half]))
    return np.mean(inside, axis=0)


def test_intervals_of_a_crossing_have_the_truth_as_often_as_they_say():
    sigma = np.sqrt(0.95 * 0.05 / REPETITIONS)
    assert (np.abs(covered() - 0.95) < 3 * sigma).all()
    assert (covered(scale=0.6) < 0.95 - 3 * sigma).all()


def test_each_line_crosses_the_next_where_that_is_certain():
    """Lines through 1.44 with the slopes 1, 2 and 3, and a fourth above all of them."""

    def line(slope, shift=0.0):
        points = [quantity("derived", at(x), shift + slope * (x - 1.44), 1e-3) for x in T]
        return curves(points, ["derived"])[0]

    found = crossings([("a", line(1)), ("b", line(2)), ("c", line(3)), ("d", line(3, 1.0))])
    assert [(one.first[0], one.second[0], len(one.places)) for one in found] == [
        ("a", "b", 1),
        ("b", "c", 1),
        ("c", "d", 0),
    ]
    for one in found[:2]:
        np.testing.assert_allclose([one.places[0].at, one.places[0].value], [1.44, 0.0], atol=1e-9)
