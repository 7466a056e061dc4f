"""The flows and steps of the model `zeitlin`, against sine-Euler, and against sums and matrices in NumPy."""

import fluids
import numpy as np
import pytest
from helpers import COMPILED, composed
from zeitlin_cases import (
    CASIMIRS,
    DRIFT_FIELD,
    DRIFT_FLOW,
    ITO_CORRECTION,
    NOISE_FIELDS,
    NOISE_FLOW,
    SIZES,
    STEPPERS,
    apart,
    casimirs_of,
    energy_of,
    field,
    increments,
    moved,
    noisy,
    quadratic,
    states,
    take,
)

from spi.angles import ANY_ANGLES
from spi.inlining import uncompiled
from spi.models import SineEuler
from spi.models.zeitlin import Noise, Zeitlin
from spi.models.zeitlin.kernels import tables
from spi.models.zeitlin.lattice import lines, modes
from spi.protocol import advance_large, casimirs, drift_flow, hamiltonian, in_kernels, noise_flow, work_size
from spi.rng import LANES
from spi.schemes.rows import compositions

SIGMA = (0.5, 0.75, 1.0, 1.25)
SINE_EULER = SineEuler(SIGMA)
#: The same equations by the general code, in which its modes are four lines, and its noises four groups.
ITS_TWIN = Zeitlin(3, tuple(Noise(s, modes=(m,)) for m, s in zip(modes(3), SIGMA, strict=True)))

#: name of a scheme -> its step by the reference, (model, h, halves [half, noise], coin, y) -> y
BY_REFERENCE = {
    "splitting": lambda model, h, halves, coin, y: fluids.lie_trotter(model, h, sum(halves), y),
    "splitting_order2": lambda model, h, halves, coin, y: fluids.order_2(model, h, sum(halves), coin, y),
    "splitting_symmetric": lambda model, h, halves, coin, y: fluids.symmetric(model, h, halves, y),
    "half_noise": lambda model, h, halves, coin, y: fluids.strang(model, h, halves, y),
    "euler_maruyama": lambda model, h, halves, coin, y: fluids.euler_maruyama(model, h, sum(halves), y),
}
SPLITTINGS = [name for name in STEPPERS if name != "euler_maruyama"]


def coins_of(paths):
    """Both sides of the coin, in no regular order."""
    return np.where(np.arange(paths) % 3 == 1, -1.0, 1.0)


# --- N = 3: the built-in model ---------------------------------------------------------------------------------------


def test_flows_of_sine_euler():
    y = states(3, 8)
    with uncompiled():
        for k, t in enumerate((0.6, -0.4, 0.8, 0.2)):
            built_in = [drift_flow(SINE_EULER, k, t, tuple(one), ANY_ANGLES) for one in y]
            assert apart(moved(ITS_TWIN, DRIFT_FLOW, k, t, y)[0], built_in) < 1e-13
            assert apart(moved(ITS_TWIN, DRIFT_FLOW, k, -t, y)[0], built_in) > 1e-2
            built_in = [noise_flow(SINE_EULER, k, t, tuple(one), ANY_ANGLES) for one in y]
            assert apart(moved(ITS_TWIN, NOISE_FLOW, k, np.eye(4)[k] * t, y)[0], built_in) < 1e-13


@pytest.mark.parametrize("name", ["splitting", "splitting_order2", "splitting_symmetric"])
def test_steps_of_sine_euler(name):
    h, y, coins = 0.1, states(3, 11), coins_of(11)
    dW = increments(ITS_TWIN, h, 1, 11)
    if name == "splitting_symmetric":
        dW = np.repeat(dW.sum(axis=1, keepdims=True) / 2, 2, axis=1)  # `composed` halves increments
    by_coin = [flows for _, flows in compositions(STEPPERS[name].rows, SINE_EULER)]
    ours = take(name, ITS_TWIN, h, dW, y, coins[np.newaxis]).states
    with uncompiled():
        for path, coin in enumerate(coins):
            flows = by_coin[0] if coin == 1 else by_coin[-1]
            theirs = composed(SINE_EULER, flows, h, tuple(y[path]), dW[0].sum(axis=0)[:, path])
            assert apart(ours[path], theirs) < 1e-13
            assert len(by_coin) == 1 or apart(ours[path], composed_wrongly(by_coin, coin, h, y[path], dW)) > 1e-5


def composed_wrongly(by_coin, coin, h, y, dW):
    raise NotImplementedError


def test_three_modes_take_the_flows_of_sine_euler():
    """The record for kernels has its parameters; other equations of N = 3 take the general code."""
    y = fluids.random_state(3)
    ours = in_kernels(ITS_TWIN)
    assert ours.sigma == SIGMA and not getattr(type(ours), "large", False)
    assert drift_flow(ours, 1, 0.3, tuple(y), ANY_ANGLES) == drift_flow(SINE_EULER, 1, 0.3, tuple(y), ANY_ANGLES)
    for other in (
        ITS_TWIN._replace(normalisation="zeitlin"),
        Zeitlin(3, (Noise(0.5, modes=((1, 0),), hamiltonian="linear"),)),
    ):
        assert in_kernels(other) is tables(other)
    assert in_kernels(Zeitlin(3)).sigma == (None,) * 4
    assert in_kernels(Zeitlin(3, (Noise(0.5, modes=((-1, -1),)),))).sigma == (None, 0.5, None, None)


@pytest.mark.parametrize("name", STEPPERS)
def test_without_the_compiler(name):
    """The words in Python, vectors being arrays, give what they give compiled."""
    model, h, y, coins = noisy(5), 0.1, states(5, 4), coins_of(4)
    of, scheme, dW = tables(model), STEPPERS[name], increments(model, h, 1, 4)
    raise NotImplementedError
