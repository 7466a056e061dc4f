"""The Gibbs law by quadrature and by transfer matrices: closed forms, balance along Hamiltonian fields, sampling."""

import numpy as np
import pytest
from helpers import INITIAL, RIGID_BODY
from scipy.special import iv, ndtr
from scipy.stats import chi2
from yaml_cases import SYSTEMS, made

from spi.ensemble.increments import brownian
from spi.ensemble.protocol import casimirs, hamiltonian
from spi.ensemble.random_states import first_states
from spi.models import MaxwellBloch
from spi.plugins.dynamics.exact.chains import ChainLaw
from spi.plugins.dynamics.exact.gibbs import law_of, mean_divergence
from spi.specs.initial import state_in

HEIGHT = made("{algebra: so(3), hamiltonian: y3, noises: [y1]}").record
SPINS = made("{algebra: so(3)^2, hamiltonian: y1*y4 + y2*y5 + y3*y6 + y1^2 - y6, noises: [y3]}").record
EDGES = np.linspace(-1.0, 1.0, 11)


def langevin(K):
    return 1 / np.tanh(K) - 1 / K


# --- one sphere ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("temperature", [0.5, -0.5, 0.02, np.inf])
def test_the_height_on_a_sphere(temperature):
    law, K = law_of(HEIGHT, (0.6, 0.0, 0.8), temperature), 1.0 / temperature
    below = np.exp(-K * EDGES) if K else -EDGES
    for f, exact in ((lambda y: y[2], -langevin(K) if K else 0.0), (lambda y: y[0], 0.0)):
        value, error = law.expectation(f)
        assert abs(value - exact) <= 2 * error + 1e-15 and error < 1e-12
    assert law.expectation(lambda y: y[2] ** 2)[0] == pytest.approx(1 - 2 * langevin(K) / K if K else 1 / 3)
    np.testing.assert_allclose(
        law.probabilities(lambda y: y[2], EDGES), np.diff(below) / (below[-1] - below[0]), atol=2e-6
    )
    if not K:
        np.testing.assert_allclose(law.probabilities(lambda y: y[0], EDGES), 0.1, atol=2e-5)


def test_states_that_are_drawn_have_its_law():
    """On a sphere and on two that are coupled: the mean of H, on the sphere chi squared of its histogram; not of 1."""
    chi_squared = []
    for model, point in ((RIGID_BODY, INITIAL), (SPINS, (0.0, 0.6, 0.8, 1.0, 0.0, 0.0))):
        given = {"law": "gibbs", "through": [repr(v) for v in map(float, point)], "temperature": "0.7"}
        drawn = state_in(given, model, None)
        energy = hamiltonian(model, tuple(first_states(drawn, brownian(4), 0, 1000)))
        deviations = []
        for temperature in (0.7, 1.0):
            law = law_of(model, drawn, temperature)
            mean, error = law.expectation(lambda y, model=model: hamiltonian(model, tuple(y)))
            assert error < 1e-12
            deviations.append(abs(energy.mean() - mean) / energy.std() * np.sqrt(len(energy)))
            if model is RIGID_BODY:
                edges = np.quantile(energy, np.linspace(0.0, 1.0, 13))
                edges[[0, -1]] += -1.0, 1.0
                wanted = len(energy) * law.probabilities(lambda y: hamiltonian(RIGID_BODY, tuple(y)), edges)
                assert wanted.sum() == pytest.approx(len(energy))
                chi_squared.append(((np.histogram(energy, edges)[0] - wanted) ** 2 / wanted).sum())
        assert deviations[0] < 4 and deviations[1] > 6
    assert chi_squared[0] < chi2(11).ppf(0.999) and chi_squared[1] > 60
    with pytest.raises(ValueError, match="surfaces of two dimensions"):
        law.probabilities(lambda y: y[0], EDGES)


# --- other surfaces --------------------------------------------------------------------------------------------------


def test_a_cylinder_of_maxwell_bloch():
    """y_1 is normal, and the angle has the density of von Mises."""
    law = law_of(MaxwellBloch(), (1.0, 0.0, 1.5), 0.5)
    assert law.expectation(lambda y: y[0] ** 2)[0] == pytest.approx(0.5)
    assert law.expectation(lambda y: y[2])[0] == pytest.approx(-1.5 * iv(1, 3) / iv(0, 3))
    np.testing.assert_allclose(law.probabilities(lambda y: y[0], EDGES), np.diff(ndtr(EDGES * 2**0.5)), atol=1e-5)


@pytest.mark.parametrize("name", ["e(2)", "heavy top", "Manakov", "bracket with parameters", "spin in a cavity"])
def test_the_law_balances_along_hamiltonian_fields(name):
    """E X_g f = E f X_g H / T, since fields have no divergence; on the surface through the state."""
    model, c, T = made(SYSTEMS[name][0]).record, SYSTEMS[name][1], 1.5
    d = c.shape[2]
    point = tuple(np.linspace(0.4, 1.1, d).tolist())
    law, rng = law_of(model, point, T), np.random.default_rng(1)
    law.levels = law.levels[:4]
    states = law._weighted(*next(law._parts(law.levels[0])))[0]
    for values, of_point in zip(casimirs(model, tuple(states)), casimirs(model, point), strict=True):
        np.testing.assert_allclose(values, of_point, rtol=1e-11, atol=1e-12)
    g, (b, A) = rng.standard_normal(d), (rng.standard_normal(d), rng.standard_normal((d, d)))

    def along(y, gradient):  # gradient . B g
        return (gradient * np.einsum("ijk,j,kn->in", c, g, y)).sum(axis=0)

    def f(y):
        return b @ y + 0.5 * (y * (A @ y)).sum(axis=0)

    def energy_slope(y):
        step = 1e-5 * np.einsum("ijk,j,kn->in", c, g, y)
        return (law.energy(y + step) - law.energy(y - step)) / 2e-5

    moved = law.expectation(lambda y: along(y, b[:, np.newaxis] + 0.5 * (A + A.T) @ y))
    weighted = law.expectation(lambda y: f(y) * energy_slope(y))
    size = max(abs(moved[0]), 0.1)
    assert moved[0] == pytest.approx(weighted[0] / T, abs=1e-7 * size + moved[1] + weighted[1])
    assert moved[1] < 1e-6 * size and abs(moved[0]) > 1e-2


# --- chains and rings ------------------------------------------------------------------------------------------------

CHAIN = (
    "{{algebra: so(3)^n, sizes: {{n: {}}}, variables: ['x(i), y(i), z(i) for i = 1..n'],"
    " hamiltonian: '{}', noises: [z(1)]}}"
)
HEISENBERG = "-sum(x(i)*x(mod(i,n)+1) + y(i)*y(mod(i,n)+1) + z(i)*z(mod(i,n)+1) for i = 1..{})"


def test_fishers_chain():
    """Per bond u = -L, L = coth K - 1/K, the specific heat K^2 (1 - L^2 - 2 L / K), and correlations L^r."""
    T, n = 0.5, 4
    model, K, L = made(CHAIN.format(n, HEISENBERG.format(n - 1))).record, 1 / T, langevin(1 / T)
    law = law_of(model, (0.0, 0.6, 0.8) * n, T)
    energy, error = law.expectation(lambda y: hamiltonian(model, tuple(y)))
    square, _ = law.expectation(lambda y: hamiltonian(model, tuple(y)) ** 2)
    assert energy == pytest.approx(-(n - 1) * L, rel=1e-11) and error < 1e-11
    assert (square - energy**2) / T**2 == pytest.approx((n - 1) * K**2 * (1 - L**2 - 2 * L / K), rel=1e-9)
    for r in (1, 2, 3):
        assert law.expectation(lambda y, r=r: (y[:3] * y[3 * r : 3 * r + 3]).sum(axis=0))[0] == pytest.approx(L**r)
    assert law.expectation(lambda y: np.exp(y[1]))[0] == pytest.approx(np.sinh(1.0))
    angle, weight = np.polynomial.legendre.leggauss(30)
    pair = (weight * np.exp(K * angle) * angle**4).sum() / (weight * np.exp(K * angle)).sum()
    assert law.expectation(lambda y: (y[3:6] * y[6:9]).sum(axis=0) ** 4)[0] == pytest.approx(pair)


def test_a_ring_without_symmetry_against_sampling():
    """Spins of other lengths, in a field and with anisotropy of one: weights of states that are drawn uniformly."""
    field = "sum(x(i)*x(mod(i,n)+1) + y(i)*y(mod(i,n)+1)/2 + x(i)*z(mod(i,n)+1)/3 for i = 1..n) + z(1)^2 - y(3)"
    model = made(CHAIN.format(4, field)).record
    lengths = np.array([1.0, 0.7, 1.2, 0.9])
    law = law_of(model, np.outer(lengths, (0.0, 0.6, 0.8)).ravel(), 2.0)
    u = np.random.default_rng(5).standard_normal((4, 3, 400_000))
    y = (u / np.linalg.norm(u, axis=1, keepdims=True) * lengths[:, np.newaxis, np.newaxis]).reshape(12, -1)
    energy = hamiltonian(model, tuple(y))
    weight = np.exp(-energy / 2.0)
    weight /= weight.sum()
    for f in (
        lambda y: hamiltonian(model, tuple(y)),
        lambda y: hamiltonian(model, tuple(y)) ** 2,
        lambda y: y[0] * y[5] + y[2] ** 2,
        lambda y: np.tanh(y[0] + y[9]),
    ):
        mean = weight @ f(y)
        spread = np.sqrt((weight**2) @ (f(y) - mean) ** 2)
        assert abs(law.expectation(f)[0] - mean) < 4 * spread
    assert abs(energy.mean() - weight @ energy) > 100 * np.sqrt((weight**2) @ energy**2)


# --- what is not known -----------------------------------------------------------------------------------------------


UNDEFINED_AT_0 = "{bracket: {a b: c}, variables: [a, b, c], hamiltonian: a^2, noises: [b], casimirs: [1/c]}"


def test_laws_that_are_not_known_are_refused_with_the_reason():
    ring = made(CHAIN.format(4, HEISENBERG.format(4))).record
    for model, point, temperature, reason in (
        (RIGID_BODY, INITIAL, 0, "the temperature is 0"),
        (RIGID_BODY, (0.0, 0.0, 0.0), 1.0, "one state"),
        (MaxwellBloch(), (1.0, 0.0, 1.0), -1.0, "not integrable"),
        (MaxwellBloch(), (1.0, 0.0, 1.0), np.inf, "not integrable"),
        (MaxwellBloch(), (1.0, 0.0, 0.0), 1.0, "one state"),
        (made(SYSTEMS["Toda"][0]).record, (1.0,) * 7, 1.0, "does not keep Lebesgue measure"),
        (made(SYSTEMS["sl(2)"][0]).record, (1.0,) * 3, 1.0, "no planes over spheres"),
        (made(SYSTEMS["gl(3)"][0]).record, (1.0,) * 9, 1.0, "is not quadratic"),
        (made(UNDEFINED_AT_0).record, (1.0,) * 3, 1.0, "number 1 is not quadratic"),
        (made(SYSTEMS["heisenberg(2)"][0]).record, (1.0,) * 5, 1.0, "H is not quadratic where"),
        (
            made(CHAIN.format(4, "(x(1) + x(2) + x(3) + x(4))^2")).record,
            (0.0, 0.6, 0.8) * 4,
            1.0,
            "more than two others",
        ),
        (made(CHAIN.format(3, "x(1)^3*x(2) + x(3)")).record, (0.0, 0.6, 0.8) * 3, 1.0, "not quadratic"),
    ):
        with pytest.raises(ValueError, match=reason):
            law_of(model, point, temperature)
    law = law_of(ring, (0.0, 0.6, 0.8) * 4, 1.0)
    assert isinstance(law, ChainLaw)
    with pytest.raises(ValueError, match="on many spheres"):
        law.expectation(lambda y: y[0] * y[3] * y[6])


@pytest.mark.parametrize(
    ("formula", "temperature"),
    [("1/y3", 1.0), pytest.param("log(1 - y3)", 0.5, marks=pytest.mark.slow), ("y3^2 + y1", 1e-7)],
)
def test_laws_that_quadrature_does_not_resolve_are_refused(formula, temperature):
    singular = made(f"{{algebra: so(3), hamiltonian: {formula}, noises: [y1]}}").record
    law = law_of(singular, (0.6, 0.0, 0.8), temperature)
    with pytest.raises(ValueError, match="not integrable or too narrow"):
        law.expectation(lambda y: y[2])
    assert mean_divergence(singular, temperature, (0.6, 0.0, 0.8)) is None
