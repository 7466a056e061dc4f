"""The orders that are stated as expected of schemes for spins, and slopes of their errors."""

import math

import numpy as np
import pytest
from helpers import COMPILED, LANES
from test_expected_orders import expected

from spi.ensemble.increments import brownian
from spi.ensemble.loop import grid, integrated
from spi.ensemble.protocol import in_kernels
from spi.models.delegation import thermal
from spi.plugins.spins.models import Spins, Terms, Transport
from spi.schemes import SCHEMES, of_model, strong_order

CHAIN = {"lattice": "chain", "size": (2,), "bonds": (Terms(1.0),), "field": (0.3, -0.2, 0.5)}
SPINS = (0.6, 0.0, 0.8, 0.0, 1.0, 0.0)


@pytest.mark.skipif(not COMPILED, reason="thousands of steps")
@pytest.mark.parametrize(
    ("options", "temperature", "order"),
    [
        ({"noise": Transport(1.5)}, math.inf, 0.5),
        ({"noise": Transport(1.5, (0.0, 1.0, 1.0))}, math.inf, 1.0),
        ({"alpha": 0.5}, 1.0, 0.5),
        ({"alpha": 0.5}, math.inf, 2.0),
    ],
)
def test_spins(options, temperature, order):
    """1/2 where every spin turns about any axis, 1 about one, and 2 without noise, of a symmetric step."""
    model = thermal(Spins(**CHAIN, **options), temperature)
    record, entry = in_kernels(model), of_model(SCHEMES["splitting_symmetric"], model)
    assert strong_order(entry, model, SPINS) == order
    doublings, blocks = (9, 8, 7, 6, 5, 0), 4
    y, _ = integrated(
        entry.record, record, np.array(SPINS), grid(2.0**-12, 2**12, doublings), brownian(1), 0, blocks, blocks * LANES
    )
    ends = y[..., : record.d * LANES].reshape(blocks, len(doublings), record.d, LANES)
    errors = np.sqrt(((ends[:, :-1] - ends[:, -1:]) ** 2).sum(axis=2).mean(axis=(0, 2)))
    assert np.polyfit(doublings[:-1], np.log2(errors), 1)[0] == pytest.approx(order, abs=0.12)


def test_what_is_stated():
    """Euler-Maruyama has 1/2 also about one axis."""
    axis, any_axis = Spins(**CHAIN, noise=Transport(1.0, (0, 0, 1))), Spins(**CHAIN, noise=Transport(1.0))
    three = "euler_maruyama", "heun_renormalised", "midpoint"
    assert [expected(name, axis, SPINS)[0] for name in three] == [0.5, 1.0, 1.0]
    assert [expected(name, any_axis, SPINS)[0] for name in three] == [0.5] * 3
    assert [expected(name, Spins(**CHAIN), SPINS)[0] for name in ("splitting", "midpoint")] == [1.0, 2.0]
    assert expected("splitting_metropolis", thermal(Spins(**CHAIN, alpha=0.5), 1.0), SPINS) == (0.5, 1.0)
