"""The orders that tables and runs state as expected: array models, noises that are off, judged noises.

Slopes of the fluid: tests/models/test_zeitlin_structure.py; of systems of few components: test_systems_limits.py.
"""

import math

import numpy as np
import pytest
from helpers import COMPILED, LANES, RIGID_BODY, SCHEMES, take_step
from scipy.integrate import solve_ivp

from spi.compiler.inlining import uncompiled
from spi.ensemble.increments import brownian
from spi.ensemble.loop import grid, integrated
from spi.ensemble.protocol import dimension, in_kernels, noises
from spi.ensemble.scheme_protocol import advance_large, memory_size, of_arrays, report_row, substeps, work_size
from spi.models.delegation import thermal
from spi.plugins.fluids.models import ModeNoise, Zeitlin
from spi.plugins.spins.models import Spins, Terms, Transport
from spi.schemes import SCHEMES as ALL_SCHEMES
from spi.schemes import of_model, strong_order, weak_order

CHAIN = {"lattice": "chain", "size": (2,), "bonds": (Terms(1.0),), "field": (0.3, -0.2, 0.5)}
SPINS = (0.6, 0.0, 0.8, 0.0, 1.0, 0.0)
ONE = Zeitlin(3, (ModeNoise(1.0, modes=((1, 0),), hamiltonian="linear"),))
LINES = Zeitlin(3, (ModeNoise(1.0, modes=((1, 0), (0, 1))),))
VORTICITY = (0.5, 0.3, -0.4, 0.2, 0.6, -0.3, 0.1, 0.7)


def expected(scheme, model, initial=SPINS):
    entry = of_model(ALL_SCHEMES[scheme], model)
    return strong_order(entry, model, initial), weak_order(entry, model)


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
    record, entry = in_kernels(model), of_model(ALL_SCHEMES["splitting_symmetric"], model)
    assert strong_order(entry, model, SPINS) == order
    doublings, blocks = (9, 8, 7, 6, 5, 0), 4
    y, _ = integrated(
        entry.record, record, np.array(SPINS), grid(2.0**-12, 2**12, doublings), brownian(1), 0, blocks, blocks * LANES
    )
    ends = y[..., : record.d * LANES].reshape(blocks, len(doublings), record.d, LANES)
    errors = np.sqrt(((ends[:, :-1] - ends[:, -1:]) ** 2).sum(axis=2).mean(axis=(0, 2)))
    assert np.polyfit(doublings[:-1], np.log2(errors), 1)[0] == pytest.approx(order, abs=0.12)


def test_what_is_stated_of_arrays():
    """Euler-Maruyama has 1/2 also about one axis; with N = 9 modes of two lines may commute."""
    axis, any_axis = Spins(**CHAIN, noise=Transport(1.0, (0, 0, 1))), Spins(**CHAIN, noise=Transport(1.0))
    assert [expected(name, axis)[0] for name in ("euler_maruyama", "heun_renormalised", "midpoint")] == [0.5, 1.0, 1.0]
    assert [expected(name, any_axis)[0] for name in ("euler_maruyama", "heun_renormalised", "midpoint")] == [0.5] * 3
    assert [expected(name, Spins(**CHAIN))[0] for name in ("splitting", "midpoint")] == [1.0, 2.0]
    assert expected("splitting_metropolis", thermal(Spins(**CHAIN, alpha=0.5), 1.0)) == (0.5, 1.0)
    assert [expected("splitting", model, VORTICITY)[0] for model in (ONE, LINES)] == [1.0, 0.5]
    assert expected("splitting", Zeitlin(9, (ModeNoise(1.0, modes=((3, 0), (0, 3))),)), (1.0,) * 80)[0] == 1.0
    assert expected("splitting", Zeitlin(9, (ModeNoise(1.0, modes=((3, 0), (0, 1))),)), (1.0,) * 80)[0] == 0.5


@pytest.mark.parametrize(("model", "scale"), [(ONE, 4.0), (LINES, 2.0)], ids=["one line", "two lines"])
def test_judged_noises_without_friction(model, scale):
    """Refused with probability sqrt(h), and then wrong by sqrt(h): (E |.|^2)^(1/2) = h^(3/4) a step, 1/4 in the end.

    The splitting on the same increments, whose error of a step is h at most, stands for the equation.
    """
    model = thermal(model, 0.02)
    record = in_kernels(model)
    assert expected("splitting_metropolis", model, VORTICITY) == (0.25, 0.5)
    generator, errors, steps = np.random.default_rng(1), [], (2.0**-12, 2.0**-16)
    for h in steps:
        squares = []
        for _ in range(8):
            dW = math.sqrt(h) * generator.standard_normal(noises(record) * LANES)
            coins = np.concatenate([np.ones(LANES), generator.random((noises(record) + 1) * LANES)])
            ends = []
            for name in ("splitting_metropolis", "splitting"):
                scheme = of_arrays(of_model(ALL_SCHEMES[name], model).record, record)
                y = np.append(np.repeat(scale * np.array(VORTICITY), LANES), np.zeros(memory_size(scheme, record)))
                with uncompiled():
                    advance = (scheme, record, h, dW, coins, y)
                    advance_large(*advance, np.zeros(work_size(scheme, record)), report_row())
                ends.append(y[: dimension(record) * LANES].reshape(-1, LANES))
            squares.append(((ends[0] - ends[1]) ** 2).sum(axis=0))
        errors.append(math.sqrt(np.mean(squares)))
    slope = math.log(errors[0] / errors[1]) / math.log(steps[0] / steps[1])
    assert slope == pytest.approx(0.75, abs=0.15)


@pytest.mark.parametrize("name", SCHEMES)
def test_without_noise(name):
    """A step is wrong by h^(p + 1), by comparison with a solver of ordinary differential equations."""
    model = RIGID_BODY._replace(sigma=(None, None, None))
    initial = np.random.default_rng(3).standard_normal((3, LANES)) / 2
    record, order, errors = SCHEMES[name].record, strong_order(SCHEMES[name], model, tuple(initial[:, 0])), []
    for h in (0.1, 0.05):

        def field(t, y):
            y = y.reshape(3, LANES)
            return np.cross(y, y / np.array(model.inertia)[:, np.newaxis], axis=0).ravel()

        exact = solve_ivp(field, (0.0, h), initial.ravel(), method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        y, _ = take_step(SCHEMES[name].record, model, h, np.zeros((3 * (2 * substeps(record) - 1), LANES)), initial)
        errors.append(np.linalg.norm(y.ravel() - exact))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order + 1, abs=0.1)
    assert weak_order(SCHEMES[name], model) == order
