"""Quantiles from counts: against exact quantiles of laws with heavy tails, narrow laws, atoms and constants."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import COMPILED
from scipy import stats
from strong_results import strong_group
from whole_dynamics import MEANS

from spi.drawing import page
from spi.numerics.rng import LANES
from spi.plugins.dynamics.ensemble.counting import rank_values
from spi.plugins.dynamics.kinds.statistics.figure import draw
from spi.plugins.dynamics.kinds.statistics.results import Quantiles
from spi.plugins.dynamics.statistics.quantiles import EDGES, edges_around, quantiles_of
from spi.storage.stored import Description

LEVELS = (1e-4, 1e-3, 0.01, 0.05, 0.5, 0.95, 0.99, 0.9999)

#: Of a standard normal number: the variable, and its law.
LAWS = {
    "exp(3 W)": lambda z: np.exp(3 * z),
    "1e-20 exp(-3 W)": lambda z: -1e-20 * np.exp(-3 * z),
    "a narrow law": lambda z: 0.4725 + 1e-9 * z,
    "an atom": lambda z: np.maximum(z, 0.0),
    "Cauchy's": lambda z: np.tan(np.pi * (stats.norm.cdf(z) - 0.5)),
}


def counted(values, edges):
    """(EDGES + 1,) counts of values, whose number is a multiple of 64."""
    counts = np.zeros((1, 1, EDGES + 1), np.int64)
    rank_values(values.reshape(-1, 1, 1, LANES), 0, len(values), edges[np.newaxis, np.newaxis], counts, (0, 1))
    return counts[0, 0]


@pytest.mark.parametrize("name", LAWS)
def test_intervals_of_quantiles_hold_whatever_the_law_is(name):
    """Of each level in 95 % of seeds or more; the bins make them wider than ranks alone by less than half."""
    of, seeds, n = LAWS[name], (100 if COMPILED else 5), 64 * (160 if COMPILED else 40)
    exact, held, wide = of(stats.norm.ppf(LEVELS)), np.zeros(len(LEVELS)), []
    for seed in range(seeds):
        x = of(np.random.default_rng(seed).standard_normal(n))
        found = quantiles_of(counted(x, edges := edges_around(x[:1024])), edges, LEVELS)
        held += (found.low <= exact) & (exact <= found.high)
        ordered = np.sort(x)
        ranks = np.array([ordered[stats.binom.ppf([0.025, 0.975], n, p).astype(int)] for p in (0.05, 0.95)])
        with np.errstate(divide="ignore", invalid="ignore"):
            wide.append((found.high - found.low)[[3, 5]] / np.diff(ranks)[:, 0])
    assert (stats.binom.cdf(held, seeds, 0.95) > 1e-3).all(), held
    assert np.nanmedian(wide) < 1.5


def test_the_quantiles_of_the_issue():
    """5 % and 50 % of exp(3 W) were printed as 1.664 and 16.72: bins of equal width see one bin of all that."""
    x = np.exp(3 * np.random.default_rng(1).standard_normal(64 * 640))
    found = quantiles_of(counted(x, edges := edges_around(x[:1024])), edges, (0.05, 0.5))
    np.testing.assert_allclose(found.value, [0.00719, 1.0], rtol=0.08)
    low, width = x[:1024].min(), 2 * np.ptp(x[:1024]) / 1024
    assert np.mean(x < low + width) > 0.5  # the control: more than half of all in the first of as many equal bins


@pytest.mark.parametrize("value", [0.0, 0.4725, -1e-300, 1e300])
def test_quantiles_of_a_constant_are_that_constant(value):
    x = np.full(640, value)
    found = quantiles_of(counted(x, edges := edges_around(x)), edges, LEVELS)
    assert (np.array(found) == value)[0].all() and not np.isnan(found.low).any()
    middle = LEVELS.index(0.5)
    assert found.low[middle] == found.high[middle] == value


def test_counts_add_up_in_any_order_and_are_those_of_a_search():
    x = np.random.default_rng(3).standard_cauchy(64 * 8)
    x[[1, 70, 200]] = np.inf, np.nan, -np.inf
    edges = edges_around(x[:128])
    assert (np.diff(edges[np.isfinite(edges)]) > 0).all() and len(edges) == EDGES
    whole, parts = counted(x, edges), sum(counted(part, edges) for part in x.reshape(8, 64)[::-1])
    assert (whole == parts).all() and whole.sum() == len(x)
    place = np.where(np.isnan(x), EDGES, np.searchsorted(edges, x, side="right"))
    assert (whole == np.bincount(place, minlength=EDGES + 1)).all()


def test_a_law_that_the_first_values_do_not_show_has_wide_intervals_and_no_wrong_ones():
    """The first values are all 0; of the others one in ten is anywhere up to 1e6."""
    rng = np.random.default_rng(4)
    x = np.where(rng.random(64 * 200) < 0.1, 10 ** rng.uniform(-3, 6, 64 * 200), 0.0)
    found = quantiles_of(counted(x, edges := edges_around(np.zeros(1024))), edges, (0.5, 0.95, 0.99))
    exact = np.array([0.0, 10**1.5, 10**5.1])
    assert ((found.low <= exact) & (exact <= found.high)).all() and found.value[0] == 0
    assert np.isfinite(found.high).all()


def test_without_values_there_are_no_quantiles():
    edges = edges_around(np.full(64, np.nan))
    assert np.isnan(quantiles_of(np.zeros(EDGES + 1, np.int64), edges, (0.5,))).all()


def test_bands_of_several_schemes_have_one_entry_and_no_names_beside_panels():
    """Two panels, so that lines of one name in two colours would be named at the ends of the first one."""
    values = np.linspace([[0, 1, 2], [1, 3, 5]], [[0, 1, 3], [1, 4, 6]], 2)  # (function, t, level)
    levels = Quantiles(level=np.array([0.05, 0.5, 0.95]), quantile=values, quantile_low=values, quantile_high=values)
    two = {name: getattr(MEANS, name).repeat(2, axis=0) for name in ("mean", "mean_stderr", "variance", "finite")}
    one = replace(MEANS, functions=("a", "b"), texts=("y1", "y2"), quantiles=levels, reference=None, **two)
    schemes = [replace(one, about=Description.of(strong_group(scheme))) for scheme in ("splitting", "euler_maruyama")]
    with page.applied(page.named(panels=("mean",))):
        fig = draw("A", [schemes])
    assert [text.get_text() for text in fig.legends[0].texts].count("quantiles 0.05, 0.5, 0.95") == 1
    assert not [text.get_text() for ax in fig.panels for text in ax.texts if "quantiles" in text.get_text()]
    assert [sum(line.get_linestyle() == ":" for line in ax.lines) for ax in fig.panels] == [6, 6]  # edges are drawn
