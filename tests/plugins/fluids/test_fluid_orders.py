"""The orders that are stated as expected of schemes for the fluid, and of judged noises without friction."""

import math

import numpy as np
import pytest
from helpers import LANES
from test_expected_orders import expected

from spi.compiler.inlining import uncompiled
from spi.ensemble.protocol import dimension, in_kernels, noises
from spi.ensemble.scheme_protocol import advance_large, memory_size, of_arrays, report_row, work_size
from spi.models.delegation import thermal
from spi.plugins.fluids.models import ModeNoise, Zeitlin
from spi.schemes import SCHEMES, of_model

ONE = Zeitlin(3, (ModeNoise(1.0, modes=((1, 0),), hamiltonian="linear"),))
LINES = Zeitlin(3, (ModeNoise(1.0, modes=((1, 0), (0, 1))),))
VORTICITY = (0.5, 0.3, -0.4, 0.2, 0.6, -0.3, 0.1, 0.7)


def test_what_is_stated():
    """With N = 9 modes of two lines may commute."""
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
                scheme = of_arrays(of_model(SCHEMES[name], model).record, record)
                y = np.append(np.repeat(scale * np.array(VORTICITY), LANES), np.zeros(memory_size(scheme, record)))
                with uncompiled():
                    advance = (scheme, record, h, dW, coins, y)
                    advance_large(*advance, np.zeros(work_size(scheme, record)), report_row())
                ends.append(y[: dimension(record) * LANES].reshape(-1, LANES))
            squares.append(((ends[0] - ends[1]) ** 2).sum(axis=0))
        errors.append(math.sqrt(np.mean(squares)))
    slope = math.log(errors[0] / errors[1]) / math.log(steps[0] / steps[1])
    assert slope == pytest.approx(0.75, abs=0.15)
