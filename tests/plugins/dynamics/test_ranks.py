"""Rank histograms: counts by hand, flat where the verifying values are like members, and not where they are others."""

import numpy as np
import pytest
from scipy import stats

import spi


def ensembles(*, spread=1.0, shift=0.0, count=4000, members=9, seed=5):
    """Members (count, members) about centres of their own, and verifying values with another spread or mean"""
    generator = np.random.default_rng(seed)
    centre = generator.normal(size=count)
    each = centre[:, None] + generator.normal(size=(count, members))
    return each, centre + shift + spread * generator.normal(size=count)


def test_counts_by_hand():
    found = spi.rank_histogram(np.tile([1.0, 2.0, 4.0], (20, 1)), np.repeat([0.0, 1.5, 3.0, 5.0], [8, 4, 6, 2]))
    assert found.counts.tolist() == [8, 4, 6, 2]
    assert found.chi_square == (3**2 + 1 + 1 + 3**2) / 5
    assert found.p_value == pytest.approx(stats.chi2.sf(4.0, 3))
    assert found.spread == pytest.approx(np.std([1, 2, 4], ddof=1))
    squares = (np.repeat([0.0, 1.5, 3.0, 5.0], [8, 4, 6, 2]) - 7 / 3) ** 2
    assert found.error == pytest.approx(np.sqrt(squares.mean() * 3 / 4))
    assert spi.rank_histogram(np.tile([1.0, 2.0, 4.0], (20, 1)), np.full(20, 3.0), bins=2).counts.tolist() == [0, 20]


def test_it_is_flat_where_the_verifying_values_are_like_members():
    found = spi.rank_histogram(*ensembles())
    assert found.p_value > 1e-3 and found.error == pytest.approx(found.spread, rel=0.03)
    of_five = spi.rank_histogram(*ensembles(), bins=5)
    assert of_five.counts.tolist() == found.counts.reshape(5, 2).sum(axis=1).tolist()


@pytest.mark.parametrize(
    ("change", "shape"), [({"spread": 1.3}, "U"), ({"spread": 0.7}, "bump"), ({"shift": 0.2}, "/")]
)
def test_it_is_not_flat_for_a_wrong_ensemble(change, shape):
    found = spi.rank_histogram(*ensembles(**change))
    ends, middle = found.counts[[0, -1]].mean(), found.counts[4:6].mean()
    assert found.p_value < 1e-6
    assert {"U": ends > middle, "bump": ends < middle, "/": found.counts[-1] > 1.2 * found.counts[0]}[shape]


def test_equal_values_are_put_in_order_at_random():
    found = spi.rank_histogram(np.zeros((1000, 4)), np.zeros(1000))
    assert found.p_value > 1e-3 and found.counts.min() > 150


def test_what_is_refused():
    members, verifying = ensembles(count=40)
    for given, message in (
        ((members, verifying[1:]), "not .K, M., M > 1, and .K,."),
        ((members[:, :1], verifying), "not .K, M."),
        ((members + np.inf, verifying), "not all values are finite"),
        ((members, verifying), "40 ensembles are too few for 10 bins; 50 are enough, or fewer bins"),
    ):
        with pytest.raises(ValueError, match=message):
            spi.rank_histogram(*given)
    with pytest.raises(ValueError, match="bins is 3, no divisor of 10"):
        spi.rank_histogram(members, verifying, bins=3)
