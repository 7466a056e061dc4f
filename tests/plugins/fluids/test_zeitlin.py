"""The flows and steps of the model `zeitlin`, against sine-Euler, and against sums and matrices in NumPy."""

import fluids
import numpy as np
import pytest
from helpers import COMPILED
from zeitlin_cases import (
    DRIFT_FIELD,
    DRIFT_FLOW,
    ITO_CORRECTION,
    NOISE_FIELDS,
    NOISE_FLOW,
    SIZES,
    STEPPERS,
    apart,
    coins_of,
    field,
    increments,
    moved,
    noisy,
    states,
    take,
)

from spi.compiler.inlining import uncompiled
from spi.ensemble.protocol import drift_flow, noise_flow
from spi.ensemble.scheme_protocol import advance_large, of_arrays, report_row, work_size
from spi.models import SineEuler
from spi.numerics.angles import ANY_ANGLES
from spi.numerics.rng import LANES
from spi.plugins.fluids.models import ModeNoise, Zeitlin
from spi.plugins.fluids.models.kernels import tables
from spi.plugins.fluids.models.tables import lattice, lines, modes
from spi.schemes.splitting import splitting
from spi.schemes.stages import compositions, flows

SIGMA = (0.5, 0.75, 1.0, 1.25)
SINE_EULER = SineEuler(SIGMA)
#: The same equations by the general code, in which its modes are four lines, and its noises four groups.
ITS_TWIN = Zeitlin(3, tuple(ModeNoise(s, modes=(m,)) for m, s in zip(modes(3), SIGMA, strict=True)))

#: name of a scheme -> its step by the reference, (model, h, halves [half, noise], coin, y) -> y
BY_REFERENCE = {
    "splitting": lambda model, h, halves, coin, y: fluids.lie_trotter(model, h, sum(halves), y),
    "splitting_order2": lambda model, h, halves, coin, y: fluids.order_2(model, h, sum(halves), coin, y),
    "splitting_symmetric": lambda model, h, halves, coin, y: fluids.symmetric(model, h, halves, y),
    "euler_maruyama": lambda model, h, halves, coin, y: fluids.euler_maruyama(model, h, sum(halves), y),
}


def test_flows_of_sine_euler():
    y = states(3, 8)
    for k, t in enumerate((0.6, -0.4, 0.8, 0.2)):
        with uncompiled():
            of_drift = [drift_flow(SINE_EULER, k, t, tuple(one), ANY_ANGLES) for one in y]
            of_noise = [noise_flow(SINE_EULER, k, t, tuple(one), ANY_ANGLES) for one in y]
        assert apart(moved(ITS_TWIN, DRIFT_FLOW, k, t, y)[0], of_drift) < 1e-13
        assert apart(moved(ITS_TWIN, NOISE_FLOW, k, np.eye(4)[k] * t, y)[0], of_noise) < 1e-13
        assert apart(moved(ITS_TWIN, DRIFT_FLOW, k, -t, y)[0], of_drift) > 1e-2


def composed(flows, h, y, dW):
    """A step by flows of the built-in model, with shares of the time and of the increments."""
    for part, k, share in flows:
        flow, t = (drift_flow, h) if part == "drift" else (noise_flow, SIGMA[k] * dW[k])
        y = flow(SINE_EULER, k, share * t, y, ANY_ANGLES)
    return y


@pytest.mark.parametrize("name", ["splitting", "splitting_order2", "splitting_symmetric"])
def test_steps_of_sine_euler(name):
    """With equal increments over both halves; the compositions of a scheme with a coin differ from side to side."""
    h, y, coins = 0.5, states(3, 11), coins_of(11)
    half = increments(ITS_TWIN, h, 1, 11).mean(axis=1)
    ours = take(name, ITS_TWIN, h, np.stack([half, half], axis=1), y, coins).states
    sides = compositions(STEPPERS[name].stages, SINE_EULER)
    for path, coin in enumerate(coins):
        with uncompiled():
            found = [composed(flows, h, tuple(y[path]), 2 * half[0, :, path]) for _, flows in sides]
        side = 0 if coin == 1 else len(sides) - 1
        assert apart(ours[path], found[side]) < 1e-13
        assert len(sides) == 1 or apart(ours[path], found[1 - side]) > 1e-4


@pytest.mark.parametrize("normalisation", ["paper", "zeitlin"])
@pytest.mark.parametrize("n", SIZES)
def test_flows_of_the_drift(n, normalisation):
    """Of every line; the angle that is told bounds those by which components turn, and vanishes with t."""
    model, y = noisy(n, normalisation=normalisation), states(n, 1)
    for k in range(len(lines(n))):
        for t in (0.7, 40.0):
            ours, largest = moved(model, DRIFT_FLOW, k, t, y)
            assert apart(ours[0], fluids.drift_flow(model, k, t, y[0])) < 2e-13 * max(1, largest)
            assert largest >= largest_turn(model, k, t, y[0])
        assert apart(ours, y) > 1e-3


@pytest.mark.skipif(not COMPILED, reason="millions of operations")
@pytest.mark.parametrize("n", [67, 71])
def test_flows_by_transforms_in_blocks(n):
    """N is a prime for which matrices of length N are split into blocks."""
    assert lattice(n).blocks_of < n // 2 and lattice(31).blocks_of == 15
    model, y = Zeitlin(n, normalisation="zeitlin"), states(n, 8)
    for k in (0, 1, n // 2, n):
        ours, _ = moved(model, DRIFT_FLOW, k, 0.7, y)
        alone, _ = moved(model, DRIFT_FLOW, k, 0.7, y[5:6])
        assert np.array_equal(alone[0], ours[5])
        assert apart(ours[5], fluids.drift_flow(model, k, 0.7, y[5])) < 1e-12
        assert apart(ours, y) > 1e-3


def largest_turn(model, k, t, y):
    """The largest difference of two eigenvalues of the generator of the flow."""
    generator = fluids.generator(model, t * fluids.drift_gradient(model, y, own=lines(model.n)[k][1]))
    angles = np.linalg.eigvalsh(1j * generator)
    return (angles[-1] - angles[0]) * (1 - 1e-12)


@pytest.mark.parametrize("normalisation", ["paper", "zeitlin"])
@pytest.mark.parametrize("n", SIZES)
def test_flows_of_the_noise(n, normalisation):
    """Groups of one process and of several, quadratic and linear, each path with times of its own."""
    model, y = noisy(n, normalisation=normalisation), states(n, 8)
    groups, times = fluids.noise_lines(model), np.random.default_rng(2).standard_normal((tables(model).m, 8))
    assert sorted(map(len, groups)) == [1, 2, 2, 4]
    sigma = tables(model).sigma[:, np.newaxis]
    for group, numbers in enumerate(groups):
        ours, _ = moved(model, NOISE_FLOW, group, sigma * times, y)
        theirs = [fluids.noise_flow(model, numbers, times[:, path], y[path]) for path in range(8)]
        assert apart(ours, theirs) < 1e-12
        assert apart(ours, theirs[::-1]) > 1e-2
        for k in numbers:  # each process of the group counts
            other = times * (1 + np.eye(len(times))[k][:, np.newaxis])
            assert apart(moved(model, NOISE_FLOW, group, sigma * other, y)[0], ours) > 1e-3


@pytest.mark.parametrize("n", SIZES)
def test_fields(n):
    model, y = noisy(n, normalisation="zeitlin"), states(n, 8)
    times = np.random.default_rng(2).standard_normal((tables(model).m, 8))
    ours = field(model, DRIFT_FIELD, 0.7, y)
    assert apart(ours, 0.7 * fluids.drift_field(model, y)) < 1e-12
    ours = field(model, NOISE_FIELDS, times, y)
    assert apart(ours, np.einsum("kp,kpd->pd", times, fluids.noise_fields(model, y))) < 1e-12
    ours = field(model, ITO_CORRECTION, 0.7, y)
    assert apart(ours, 0.7 * fluids.ito_correction(model, y)) < 1e-12
    assert apart(field(model, ITO_CORRECTION, 0.7, y[:1])[0], ours[0]) < 1e-12


@pytest.mark.parametrize("n", SIZES)
def test_a_path_alone_and_in_company_has_the_same_bits(n):
    """Also where the angles of one path, but not of the others, are beyond reduction in three products."""
    model, y = noisy(n), states(n, 8)
    for scale in (1.0, 1e9):
        y[3] *= scale
        together, _ = moved(model, DRIFT_FLOW, 1, 0.3, y)
        alone = [moved(model, DRIFT_FLOW, 1, 0.3, one[np.newaxis])[0][0] for one in y]
        assert np.array_equal(together, alone)
        assert np.all(np.isfinite(together)) and apart(together, y) > 1e-3


@pytest.mark.parametrize("n", SIZES if COMPILED else SIZES[:1])
@pytest.mark.parametrize("name", STEPPERS)
def test_paths_do_not_depend_on_how_many_there_are(n, name):
    """Whether they go by eights or alone, and whatever the coins of others are."""
    model, h, most = noisy(n), 0.1, LANES if COMPILED else 11
    y, coins, dW = states(n, most), coins_of(most), increments(noisy(n), h, 2, most)
    whole = take(name, model, h, dW, y, coins).states
    for paths in (1, 3, 4, 8, 11):
        part = take(name, model, h, dW[..., :paths], y[:paths], coins[:paths]).states
        assert np.array_equal(part, whole[:paths])
    assert len(np.unique(whole, axis=0)) == most


@pytest.mark.parametrize("n", SIZES if COMPILED else (5, 9))
@pytest.mark.parametrize("name", STEPPERS)
def test_steps(n, name):
    """Two steps of several paths with coins on both sides, in both normalisations, against the reference."""
    h, y, coins = 0.1, states(n, 5), coins_of(5)
    for normalisation in ("paper", "zeitlin"):
        model = noisy(n, normalisation=normalisation)
        dW = increments(model, h, 2, 5)
        ours = take(name, model, h, dW, y, coins).states
        for path in range(5 if n < 9 else 2):
            theirs = y[path]
            for halves in dW[..., path]:
                theirs = BY_REFERENCE[name](model, h, halves, coins[path], theirs)
            assert apart(ours[path], theirs) < 1e-12
        wrong = take(name, model, h, dW[..., ::-1], y, coins).states
        assert apart(wrong, ours) > 1e-2


def test_coins_and_halves_of_increments_count_where_they_should():
    """Negative control: what one scheme must look at changes its step, and nothing of the others."""
    model, h, y, coins = noisy(7), 0.1, states(7, 8), coins_of(8)
    dW = increments(model, h, 1, 8)
    even = np.broadcast_to(dW.mean(axis=1, keepdims=True), dW.shape)
    for name in STEPPERS:
        step = take(name, model, h, dW, y, coins).states
        of_coins = apart(take(name, model, h, dW, y, -coins).states, step)
        of_halves = apart(take(name, model, h, even, y, coins).states, step)
        assert of_coins > 1e-4 if name == "splitting_order2" else of_coins == 0
        assert of_halves > 1e-4 if name == "splitting_symmetric" else of_halves < 1e-15


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
@pytest.mark.parametrize("name", STEPPERS)
def test_steps_without_the_compiler(name):
    """The words in Python, in which vectors are arrays, give what kernels give."""
    model, h, y, coins = ITS_TWIN, 0.1, states(3, 4), coins_of(4)
    dW = increments(model, h, 1, 4)
    compiled = take(name, model, h, dW, y, coins)
    with uncompiled():
        plain = take(name, model, h, dW, y, coins, in_python=True)
    assert apart(plain.states, compiled.states) < 1e-14 < apart(plain.states, y)
    assert np.array_equal(plain.report, compiled.report)


def test_noise_that_shares_the_increments_of_a_step():
    """Without the compiler: the palindrome with one increment in both halves."""
    model, h, y = ITS_TWIN, 0.3, states(3, 2)
    halves = increments(model, h, 1, 2)[0]
    around = flows("drift", fraction=1 / 2), flows("drift", "backwards", 1 / 2)
    of, block, report = tables(model), np.zeros((8, LANES)), report_row(end=2)
    shared = of_arrays(splitting(around[0], flows("noise", "symmetric", shared=True), around[1]), of)
    block[:, :2], dW = y.T, np.zeros((of.m, LANES))
    dW[:, :2] = halves.sum(axis=0)
    block = block.ravel()
    with uncompiled():
        advance_large(shared, of, h, dW.ravel(), np.ones(LANES), block, np.empty(work_size(shared, of)), report)
    for path, found in enumerate(block.reshape(8, LANES)[:, :2].T):
        even = [halves[:, :, path].mean(axis=0)] * 2
        assert apart(found, fluids.symmetric(model, h, even, y[path])) < 1e-13
        assert apart(found, fluids.symmetric(model, h, halves[:, :, path], y[path])) > 1e-3
