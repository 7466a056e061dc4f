"""Expectations of the rigid body without sampling, against quadrature over the increments, exact cases and orders."""

import itertools
import math

import numpy as np
import pytest
from helpers import composed
from scipy.integrate import solve_ivp

from spi.exact.kolmogorov import sphere
from spi.exact.kolmogorov.harmonics import CLASSES, Harmonics, shifted
from spi.exact.kolmogorov.operators import Step, factors, semigroup
from spi.exact.kolmogorov.sphere import expectations
from spi.models import RigidBody

DRIFT = [("drift", k, 1.0) for k in range(3)]
NOISE = [("noise", k, 1.0) for k in range(3)]
STRANG = [("drift", 0, 0.25), ("drift", 1, 0.25), ("drift", 2, 0.5), ("drift", 1, 0.25), ("drift", 0, 0.25)]
LIE_TROTTER = ((1.0, (*NOISE, *DRIFT)),)
EXCHANGED = ((1.0, (*DRIFT, *NOISE)),)
ORDER_2 = ((0.5, (*STRANG, *NOISE, *STRANG)), (0.5, (*STRANG, *NOISE[::-1], *STRANG)))
SCHEMES = {"lie_trotter": LIE_TROTTER, "exchanged": EXCHANGED, "order_2": ORDER_2}

INERTIA = (2.0, 1.0, 2.0 / 3.0)
STRONG = RigidBody(INERTIA, INERTIA, (1.0, 1.0, 1.0))
UNEQUAL = RigidBody(INERTIA, (1.0, 2.0, 3.0), (1.0, 0.6, None))
OFF = RigidBody(INERTIA, INERTIA, (None, None, None))
INITIAL = np.array([math.cos(1.1), 0.0, math.sin(1.1)])
GENERAL = np.array([0.5, -0.3, 0.7])


@pytest.fixture(scope="module", autouse=True)
def _each_limit_once():
    """The tests ask for the same limits with several schemes, and at the same degrees."""
    known = {}

    def remembered(harmonics, which, turn, spread, time, V):
        key = (harmonics.L, which, *turn, *spread, time, V.shape, V.tobytes())
        if key not in known:
            known[key] = semigroup(harmonics, which, turn, spread, time, V)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sphere, "semigroup", remembered)
        yield


def sines(y):
    return np.sin(2 * np.pi * y).sum(axis=0)


def mixed(y):
    """Not symmetric, and in all four classes."""
    return np.exp(y[0] - 0.5 * y[1]) * (1 + y[2] * y[0]) + y[0] * y[1] * y[2]


def by_quadrature(model, compositions, initial, h, n, phi, points):
    """E phi after n steps: all words in turn, Gauss-Hermite in each increment."""
    on = [k for k in range(3) if model.sigma[k] is not None]
    x, w = np.polynomial.hermite_e.hermegauss(points)
    grid = np.array(np.meshgrid(*[x] * (n * len(on)))).reshape(n * len(on), -1)  # rows, for one type of the flows
    weight = math.prod(np.meshgrid(*[w / w.sum()] * (n * len(on)))).ravel()
    total = 0.0
    for words in itertools.product(compositions, repeat=n):
        y = tuple(np.full(weight.shape, v) for v in initial)
        for i, (_, word) in enumerate(words):
            increments = {k: math.sqrt(h) * grid[i * len(on) + j] for j, k in enumerate(on)}
            y = composed(model, word, h, y, increments)
        total += math.prod(p for p, _ in words) * np.sum(weight * phi(np.array(y)))
    return total


# --- against independent roads ----------------------------------------------------------------------------------------


@pytest.mark.share
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("length", [1.0, 1.3])
def test_without_noise(scheme, length):
    initial, time, steps = length * INITIAL, 0.75, [0.75, 0.125]
    found = expectations(OFF, SCHEMES[scheme], initial, time, steps, [sines, mixed], 1e-9)

    def field(t, y):
        return np.cross(y, y / np.array(INERTIA))

    end = solve_ivp(field, (0, time), initial, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    for i, phi in enumerate((sines, mixed)):
        assert abs(found.limit[i] - phi(end)) < found.limit_bound[i] + 1e-12 < 1e-9
        for j, h in enumerate(steps):
            expected = 0.0
            for p, word in SCHEMES[scheme]:  # without noise the words of order 2 are the same
                y = tuple(initial)
                for _ in range(round(time / h)):
                    y = composed(OFF, word, h, y, None)
                expected += p * phi(np.array(y))
            assert abs(found.value[i, j] - expected) < found.value_bound[i, j] < 1e-9
            assert abs(found.weak_error[i, j] - (expected - phi(end))) < found.weak_error_bound[i, j] + 1e-12


@pytest.mark.share
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize(("n", "points", "h"), [(1, 24, 0.25), (2, 24, 0.25)])
@pytest.mark.parametrize("initial", [INITIAL, 1.3 * GENERAL])
def test_one_and_two_steps_against_quadrature(scheme, n, points, h, initial):
    compositions = SCHEMES[scheme]
    found = expectations(UNEQUAL, compositions, initial, n * h, [h], [mixed], 1e-6)
    expected = by_quadrature(UNEQUAL, compositions, initial, h, n, mixed, points)
    assert abs(found.value[0, 0] - expected) < found.value_bound[0, 0] < 1e-6


def test_three_noises_against_quadrature():
    model = UNEQUAL._replace(sigma=(0.7, 1.0, 0.9))
    for compositions in SCHEMES.values():
        found = expectations(model, compositions, GENERAL, 0.5, [0.5], [mixed], 1e-4)
        expected = by_quadrature(model, compositions, GENERAL, 0.5, 1, mixed, 40)
        assert abs(found.value[0, 0] - expected) < found.value_bound[0, 0] < 1e-4


def test_a_noise_may_occur_several_times_with_increments_of_its_own():
    """Two halves of a noise around the drift, by quadrature over independent increments; and the order of that scheme.

    Negative control: one increment for both halves gives another expectation.
    """
    halves = [(part, k, share / 2) for part, k, share in NOISE]
    around = ((1.0, (*halves, *DRIFT, *halves[::-1])),)
    h, model = 0.25, RigidBody(INERTIA, (1.0, 2.0, 3.0), (1.0, None, None))
    found = expectations(model, around, GENERAL, h, [h], [mixed], 1e-8)
    x, w = np.polynomial.hermite_e.hermegauss(40)
    w = w / w.sum()

    def mean(first, second, weights):
        y = composed(model, halves, h, tuple(np.full(weights.shape, v) for v in GENERAL), {0: first})
        y = composed(model, (*DRIFT, *halves[::-1]), h, y, {0: second})
        return np.sum(weights * mixed(np.array(y)))

    first, second = np.array(np.meshgrid(*[math.sqrt(h / 2) * x] * 2)).reshape(2, -1)
    assert abs(found.value[0, 0] - mean(first, second, np.outer(w, w).ravel())) < found.value_bound[0, 0] < 1e-8
    assert abs(found.value[0, 0] - mean(math.sqrt(h / 2) * x, math.sqrt(h / 2) * x, w)) > 1e-4

    whole = expectations(model, ((1.0, (NOISE[0],)),), GENERAL, h, [h], [mixed], 1e-8)
    parts = expectations(model, ((1.0, (halves[0], halves[0])),), GENERAL, h, [h], [mixed], 1e-8)
    np.testing.assert_allclose(parts.value, whole.value, atol=1e-14)


@pytest.mark.parametrize("k", range(3))
def test_one_axis_is_exact(k):
    """y_k stays; z = y_{k+1} + i y_{k+2} turns by -y_k t / I_k - sigma y_k W / Î_k: E z^m = exp(...) z_0^m."""
    inertia, sigma = [math.inf] * 3, [None] * 3
    inertia[k], sigma[k] = 0.8, 1.1
    model, time = RigidBody(tuple(inertia), (1.5, 0.7, 1.2), tuple(sigma)), 1.5
    a, b = (k + 1) % 3, (k + 2) % 3
    functions = [lambda y: y[k], lambda y: y[a], lambda y: y[b] ** 2, lambda y: y[a] * y[b], lambda y: 1.0]
    found = expectations(model, ORDER_2, GENERAL, time, [time, time / 8], functions, 1e-11)

    def moment(m):
        width = sigma[k] * GENERAL[k] / model.noise_inertia[k]
        turn = np.exp(-1j * m * GENERAL[k] * time / inertia[k] - (m * width) ** 2 * time / 2)
        return turn * (GENERAL[a] + 1j * GENERAL[b]) ** m

    both = GENERAL[a] ** 2 + GENERAL[b] ** 2
    expected = [GENERAL[k], moment(1).real, (both - moment(2).real) / 2, moment(2).imag / 2, 1.0]
    np.testing.assert_allclose(found.limit, expected, atol=1e-12)
    np.testing.assert_allclose(found.value, np.array([expected, expected]).T, atol=1e-12)
    np.testing.assert_allclose(found.weak_error, 0, atol=1e-13)


def test_generator():
    """d/dt E y_j at 0: (y x grad H)_j - sum_{k != j} (sigma_k y_k / Î_k)^2 y_j / 2, the second part from Itô."""
    model, time = UNEQUAL._replace(sigma=(1.0, 0.6, 0.8)), 1e-6
    found = expectations(model, LIE_TROTTER, GENERAL, time, [time], [lambda y, k=k: y[k] for k in range(3)])
    squares = (np.array(model.sigma) * GENERAL / model.noise_inertia) ** 2
    expected = np.cross(GENERAL, GENERAL / np.array(INERTIA)) - (squares.sum() - squares) * GENERAL / 2
    np.testing.assert_allclose((found.limit - GENERAL) / time, expected, atol=1e-5)


def test_fixed_points_and_bounds():
    """An axis is an equilibrium of every flow; elsewhere expectations stay within the range of phi."""
    for y in np.vstack([np.eye(3), np.zeros(3)]):
        found = expectations(STRONG, LIE_TROTTER, y, 1.0, [0.25, 1.0], [sines, mixed])
        for i, phi in enumerate((sines, mixed)):
            np.testing.assert_allclose(found.value[i], phi(y[:, None])[0], atol=1e-10)
    functions = [sines, lambda y: y[0], lambda y: sines(y) + 2 * y[0], lambda y: (y**2).sum(axis=0)]
    found = expectations(STRONG, LIE_TROTTER, 0.8 * INITIAL, 2.0, [0.25, 2.0], functions, 1e-3)
    assert np.all(abs(found.value[0]) < 3) and np.all(abs(found.value[1]) < 0.8)
    np.testing.assert_allclose(found.value[2], found.value[0] + 2 * found.value[1], atol=1e-12)
    np.testing.assert_allclose(found.value[3], 0.64, atol=1e-12)


# --- orders and errors ------------------------------------------------------------------------------------------------


def test_orders():
    steps = 2.0 ** -np.arange(5, 9)
    ratio = {}
    for name, compositions in SCHEMES.items():
        found = expectations(UNEQUAL, compositions, INITIAL, 1.0, steps, [sines])
        assert np.all(found.weak_error_bound < abs(found.weak_error) / 20)
        # the limit from the generator is the one to which the scheme converges
        assert abs(found.notes["extrapolated_minus_limit"][0]) < 1e-6
        ratio[name] = found.weak_error[0, :-1] / found.weak_error[0, 1:]
    np.testing.assert_allclose(ratio["lie_trotter"][-1], 2, atol=0.03)
    np.testing.assert_allclose(ratio["exchanged"][-1], 2, atol=0.03)
    np.testing.assert_allclose(ratio["order_2"][-1], 4, atol=0.03)


def test_the_order_of_the_flows_matters():
    found = [expectations(STRONG, c, INITIAL, 1.0, [0.125], [sines]) for c in (LIE_TROTTER, EXCHANGED)]
    backwards = expectations(STRONG, ((1.0, LIE_TROTTER[0][1][::-1]),), INITIAL, 1.0, [0.125], [sines])
    values = [f.weak_error[0, 0] for f in (*found, backwards)]
    errors = [f.weak_error_bound[0, 0] for f in (*found, backwards)]
    for i, j in itertools.combinations(range(3), 2):
        assert abs(values[i] - values[j]) > 20 * (errors[i] + errors[j])


def test_tiny_weak_errors_survive_cancellation():
    """Weak errors of 1e-9 to four digits, where rounding of 4096 steps would otherwise be seen."""
    model = STRONG._replace(sigma=(1e-3, None, None))
    found = expectations(model, ORDER_2, INITIAL, 1.0, [2.0**-8, 2.0**-12, 2.0**-16], [sines])
    c = found.weak_error[0] / found.h**2
    assert abs(c[1] / c[0] - 1) < 1e-4
    assert np.all(
        abs(found.weak_error[0] - c[0] * found.h**2) < found.weak_error_bound[0] + 1e-5 * abs(c[0]) * found.h**2
    )
    assert np.all(found.value_bound[0] < 1e-10)


@pytest.mark.share(1)
@pytest.mark.parametrize("model", [STRONG, UNEQUAL._replace(sigma=(1.0, 1.0, 1.0))], ids=["equal", "unequal"])
def test_refining_moves_results_by_less_than_the_stated_error(model, monkeypatch):
    found = {}
    for levels in ((24, 32, 48), (24, 32, 48, 64), (48, 64, 96)):
        monkeypatch.setattr(sphere, "LEVELS", levels)
        monkeypatch.setattr(sphere, "RELATIVE", 0.0)
        found[levels] = expectations(model, LIE_TROTTER, INITIAL, 1.0, [1.0, 2.0**-5], [sines, mixed])
    *coarse, fine = found.values()
    for result in coarse:
        assert np.all(abs(result.value - fine.value) < result.value_bound)
        assert np.all(abs(result.limit - fine.limit) < result.limit_bound)
        assert np.all(abs(result.weak_error - fine.weak_error) < result.weak_error_bound)
        assert np.all(result.weak_error_bound < 0.05 * abs(result.weak_error))


def test_what_is_not_resolved_is_said(monkeypatch):
    monkeypatch.setattr(sphere, "LEVELS", (16, 24, 32))
    found = expectations(STRONG, LIE_TROTTER, INITIAL, 1.0, [0.25, 0.5, 1.0], [lambda y: np.cos(100 * y[0]), mixed])
    assert np.all(np.isinf(found.value_bound[0])) and np.all(np.isinf(found.weak_error_bound[0]))
    assert np.all(np.isfinite(found.value_bound[1]))


def test_a_wanted_accuracy_is_met():
    model = STRONG._replace(noise_inertia=tuple(10 * i for i in INERTIA))
    found = expectations(model, LIE_TROTTER, INITIAL, 1.0, [2.0**-4], [sines, mixed], accuracy=1e-10)
    assert np.all(found.value_bound < 1e-10) and np.all(found.limit_bound < 1e-10)


@pytest.mark.parametrize(
    ("steps", "compositions", "message"),
    [
        ([0.3], LIE_TROTTER, "divide"),
        ([0.5], ((0.4, tuple(NOISE)),), "add up"),
        ([0.5], ((1.0, (("jump", 0, 1.0),)),), "jump"),
    ],
)
def test_bad_questions(steps, compositions, message):
    with pytest.raises(ValueError, match=message):
        expectations(STRONG, compositions, INITIAL, 1.0, steps, [sines])


# --- the parts --------------------------------------------------------------------------------------------------------


def test_harmonics():
    """Functions are the sum of their classes, and the shift acts as it says."""
    harmonics = Harmonics(24)
    coefficients, evaluation = harmonics.project([mixed], 1.0), harmonics.evaluation(GENERAL / np.linalg.norm(GENERAL))
    value = sum(evaluation[c] @ coefficients[c][:, 0] for c in CLASSES)
    assert abs(value - mixed(GENERAL / np.linalg.norm(GENERAL))) < 1e-13
    turned = harmonics.project([lambda y: mixed(y[[1, 2, 0]])], 1.0)
    for c in CLASSES:
        at = harmonics.starts[c]
        shift = [u @ coefficients[c][at[i] : at[i + 1]] for i, u in enumerate(harmonics.turn[c])]
        np.testing.assert_allclose(np.concatenate(shift), turned[shifted(c)], atol=1e-13)


@pytest.mark.parametrize("c", CLASSES)
def test_powers_do_not_depend_on_the_way(c, monkeypatch):
    harmonics = Harmonics(20)
    words = [(p, factors([1.0, 0.5, 2.0], [0.3, 0.0, 0.8], word, 0.01)) for p, word in ORDER_2]
    step = Step(harmonics, c, words)
    V = harmonics.project([mixed, sines], 1.0)[c]
    found = []
    for doublings in (None, 0, 3):
        monkeypatch.setattr("spi.exact.kolmogorov.operators.cheapest", lambda *_, k=doublings: (0.0, k))
        found.append(step.power(V, 37))
    np.testing.assert_allclose(found[1], found[0], atol=1e-13)
    np.testing.assert_allclose(found[2], found[0], atol=1e-13)
    one, other = (Step(harmonics, c, [(1.0, word)]).increment(V) for _, word in words)
    np.testing.assert_allclose(step.increment(V), (one + other) / 2, atol=1e-15)
