"""The multiscale system: the law of its processes, the limit for small steps, and how the comparators fail."""

import mpmath
import multiscale_cases
import numpy as np
import pytest
from helpers import COMPILED, INITIAL, RIGID_BODY, WithoutCorrection
from mpmath import mpf
from multiscale_cases import (
    EXPLICIT,
    IMPLICIT,
    MIDPOINT,
    NAMES,
    PAIRS,
    RULES,
    at_rest,
    distance,
    go,
    mean_square_distance,
    normals,
    slope,
    start,
)

from spi.schemes import SCHEMES
from spi.schemes.asymptotic import AsymptoticPreserving, MultiscaleEuler, increment_and_process
from spi.schemes.splitting import LIE_TROTTER

# fixtures
generator = multiscale_cases.generator


def summed(dW, times):
    """Increments of steps that are so many times as large."""
    return dW.reshape(-1, times, *dW.shape[1:]).sum(axis=1)


@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
def test_increments_add_up_to_the_wiener_process_less_the_change_of_z(rule, generator):
    """As eps xi_k/eps dt = dW_k - eps d xi_k says; nothing of the Wiener process is lost."""
    with mpmath.workdps(60):
        eps, h, z = mpf("0.1"), mpf("0.015"), mpf("0.03")
        total, first, dW = mpf(0), z, [mpf(x) for x in generator.standard_normal(50)]
        for x in dW:
            increment, z = increment_and_process(rule, eps, h, x, z)
            total += increment
        assert abs(total - (sum(dW) + first - z)) < mpf(10) ** -57
        assert abs(total - sum(dW)) > 1e-3
    z = first = generator.standard_normal(1000)
    total, walk = np.zeros(1000), np.zeros(1000)
    for _ in range(1000):
        x = 0.1 * generator.standard_normal(1000)
        increment, z = increment_and_process(rule, 0.1, 0.015, x, z)
        total, walk = total + increment, walk + x
    assert np.abs(total - (walk + first - z)).max() < 1e-12


#: u = h/eps^2 -> the stationary variance of z over eps^2, and the correlation of neighbours; see the recursions.
STATIONARY = {
    "implicit Euler": (lambda u: 1 / (2 + u), lambda u: 1 / (1 + u)),
    "midpoint": (lambda u: 1 / 2, lambda u: (2 - u) / (2 + u)),
    "explicit Euler": (lambda u: 1 / (2 - u), lambda u: 1 - u),
}


@pytest.mark.share
@pytest.mark.parametrize("u", [0.1, 1.0, 1.8, 10.0])
@pytest.mark.parametrize("name", RULES)
def test_law_of_the_processes(name, u, generator):
    """Variance, fourth moment and correlation of neighbours, after so many steps that the beginning is forgotten."""
    if name == "explicit Euler" and u > 2:
        pytest.skip("unstable")
    eps, paths = 0.3, 20_000
    h = u * eps * eps
    z = np.zeros(paths)
    for _ in range(100):
        before = z
        _, z = increment_and_process(RULES[name], eps, h, np.sqrt(h) * generator.standard_normal(paths), z)
    ratio, correlation = (f(u) for f in STATIONARY[name])
    v = ratio * eps * eps
    assert abs((z**2).mean() / v - 1) < 4 * np.sqrt(2 / paths)
    assert abs((z**4).mean() / (3 * v * v) - 1) < 4 * np.sqrt(96 / paths) / 3
    assert abs((before * z).mean() / v - correlation) < 4 * np.sqrt((1 + correlation**2) / paths)
    if u >= 1 and name != "midpoint":  # negative control: the variance of the process in continuous time
        assert abs((z**2).mean() / (eps * eps / 2) - 1) > 8 * np.sqrt(2 / paths)


def test_for_a_fixed_eps_all_schemes_have_one_limit_and_order_1(generator):
    """The equation is a random ODE and its noise additive, so that the strong order is 1 for all of them."""
    model, eps = RIGID_BODY, 0.5
    finest, powers = (2**12, range(4, 9)) if COMPILED else (2**6, range(2, 5))
    y, dW = at_rest(), np.sqrt(1 / finest) * normals(generator, model, finest)
    finals = {
        (name, n): go(kind(eps, rule), model, 1 / n, summed(dW, finest // n), y)[0]
        for name, (kind, rule) in zip(NAMES, PAIRS, strict=True)
        for n in [finest, *(2**p for p in powers)]
    }
    h = 2.0 ** -np.array(powers)
    for name in NAMES:
        errors = [mean_square_distance(finals[name, 2**p], finals["AP midpoint", finest]) for p in powers]
        if COMPILED:
            assert 0.9 < slope(h, errors) < 1.15
        assert np.all(np.diff(errors) < 0)
        apart = [mean_square_distance(finals[name, n], finals["AP", n]) for n in (*(2**p for p in powers), finest)]
        if name != "AP":
            assert 0.85 < slope([*h, 1 / finest], apart) < 1.15
    without, _ = go(LIE_TROTTER, model, 1 / finest, dW, y)  # negative control: eps = 0 is another equation
    assert mean_square_distance(without, finals["AP", finest]) > 0.1


def test_the_explicit_scheme_explodes_for_h_above_2_eps_squared(generator):
    eps, y = 0.05, at_rest()
    noise = normals(generator, RIGID_BODY, 400 if COMPILED else 60)

    def after(scheme, u):
        """Steps of size u eps^2."""
        with np.errstate(all="ignore"):
            return go(scheme, RIGID_BODY, u * eps * eps, np.sqrt(u) * eps * noise, y)

    explicit = MultiscaleEuler(eps, EXPLICIT)
    for u in (0.1, 0.9, 1.9):
        _, z = after(explicit, u)
        assert np.abs(z).max() < 6 * eps / np.sqrt(2 - u)  # six standard deviations
    kept, _ = after(explicit, 0.1)
    assert np.abs(np.linalg.norm(kept, axis=0) - 1.0).max() < 0.2
    lost, z = after(explicit, 4.0)  # z triples at each step
    assert np.abs(z).min() > 1e20
    assert not np.isfinite(lost).any()
    for rule in (IMPLICIT, MIDPOINT):
        kept, z = after(AsymptoticPreserving(eps, rule), 4.0)
        assert np.abs(np.linalg.norm(kept, axis=0) - 1.0).max() < 1e-13
        assert np.abs(z).max() < 6 * eps / np.sqrt(2)


def test_the_semi_implicit_scheme_becomes_that_of_the_equation_in_itos_sense(generator):
    """Step by step y + h B grad H + sum_k sigma_k f_k dW_k, without the Itô correction."""
    h, y = 0.01, start(generator, RIGID_BODY)
    dW = np.sqrt(h) * normals(generator, RIGID_BODY, 10)
    for steps in range(1, 11):
        read, _ = go(WithoutCorrection(), RIGID_BODY, h, dW[:steps], y)
        assert distance(go(MultiscaleEuler(1e-6, IMPLICIT), RIGID_BODY, h, dW[:steps], y)[0], read).max() < 1e-9
        assert np.array_equal(go(MultiscaleEuler(0.0, IMPLICIT), RIGID_BODY, h, dW[:steps], y)[0], read)
    right, _ = go(SCHEMES["euler_maruyama"].record, RIGID_BODY, h, dW, y)
    assert np.median(distance(right, read)) > 1e-2


def test_its_weak_limit_is_wrong_and_that_of_the_ap_schemes_is_right():
    """Noise alone: E y is constant in Itô's sense, |y|^2 grows; in Stratonovich's |y| is kept and E y decays.

    Each scheme has its own paths.
    """
    model = RIGID_BODY._replace(inertia=(1e40, 1e40, 1e40), noise_inertia=(1.0, 1.0, 1.0))
    steps, blocks = (16, 400) if COMPILED else (8, 5)
    h = 0.5 / steps

    def sample(scheme, seed):
        """Mean and standard error of y_1 and |y|^2."""
        generator = np.random.default_rng(seed)
        ends = [
            go(scheme, model, h, np.sqrt(h) * normals(generator, model, steps), at_rest())[0] for _ in range(blocks)
        ]
        y = np.concatenate(ends, axis=1)
        values = np.array([y[0], (y**2).sum(axis=0)])
        return values.mean(axis=1), values.std(axis=1) / np.sqrt(values.shape[1])

    limit, limit_stderr = sample(LIE_TROTTER, 1)
    wrong, stderr = sample(MultiscaleEuler(1e-6, IMPLICIT), 2)
    for seed, rule in ((3, IMPLICIT), (4, MIDPOINT)):
        mean, stderr_ap = sample(AsymptoticPreserving(1e-6, rule), seed)
        assert abs(mean[0] - limit[0]) < 4 * np.hypot(stderr_ap[0], limit_stderr[0])
        assert abs(mean[1] - 1.0) < 1e-13
    assert abs(wrong[0] - INITIAL[0]) < 4 * stderr[0]
    assert wrong[1] > 1.0 + 4 * stderr[1]
    if COMPILED:
        assert wrong[0] - limit[0] > 20 * np.hypot(stderr[0], limit_stderr[0])
