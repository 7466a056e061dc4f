"""The Gibbs law by quadrature and by transfer matrices: closed forms, its balance along Hamiltonian fields, sampling."""

import numpy as np
import pytest
from helpers import INITIAL, RIGID_BODY
from scipy.special import iv, ndtr
from scipy.stats import chi2
from yaml_cases import SYSTEMS, given, made, structure

from spi.ensemble.increments import brownian
from spi.ensemble.protocol import casimirs, hamiltonian
from spi.ensemble.random_states import first_states
from spi.exact import gibbs, leaves
from spi.exact.chains import Chain
from spi.exact.gibbs import law_of
from spi.exact.surfaces import quadratic
from spi.models import MaxwellBloch
from spi.specs.initial_laws import random_state

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
    np.testing.assert_allclose(law.probabilities(lambda y: y[2], EDGES), np.diff(below) / (below[-1] - below[0]), atol=2e-6)
    if not K:
        np.testing.assert_allclose(law.probabilities(lambda y: y[0], EDGES), 0.1, atol=2e-5)


def test_states_that_are_drawn_have_its_law():
    """On a sphere and on two that are coupled: means, and chi squared of the histogram of H; not of another T."""
    for model, point in ((RIGID_BODY, INITIAL), (SPINS, (0.0, 0.6, 0.8, 1.0, 0.0, 0.0))):
        drawn = random_state({"law": "gibbs", "through": point, "temperature": 0.7}, model, None)
        y = first_states(drawn, brownian(3), 0, 4000)
        energy = hamiltonian(model, tuple(y))
        edges = np.quantile(energy, np.linspace(0.0, 1.0, 13))
        edges[[0, -1]] += -1.0, 1.0
        counts, deviations = np.histogram(energy, edges)[0], []
        for temperature in (0.7, 0.8):
            law = law_of(model, drawn, temperature)
            mean, error = law.expectation(lambda y, model=model: hamiltonian(model, tuple(y)))
            wanted = len(energy) * law.probabilities(lambda y, model=model: hamiltonian(model, tuple(y)), edges)
            assert error < 1e-12 and wanted.sum() == pytest.approx(len(energy))
            deviations.append(abs(energy.mean() - mean) / energy.std() * np.sqrt(len(energy)))
            deviations.append(((counts - wanted) ** 2 / wanted).sum())
        assert deviations[0] < 4 and deviations[1] < chi2(11).ppf(0.999)
        assert deviations[2] > 6 and deviations[3] > 60


# --- other surfaces --------------------------------------------------------------------------------------------------


def test_a_cylinder_of_maxwell_bloch():
    """y_1 is normal, and the angle has the density of von Mises."""
    law = law_of(MaxwellBloch(), (1.0, 0.0, 1.5), 0.5)
    assert law.expectation(lambda y: y[0] ** 2)[0] == pytest.approx(0.5)
    assert law.expectation(lambda y: y[2])[0] == pytest.approx(-1.5 * iv(1, 3) / iv(0, 3))
    np.testing.assert_allclose(law.probabilities(lambda y: y[0], EDGES), np.diff(ndtr(EDGES * 2**0.5)), atol=1e-5)


@pytest.mark.parametrize("name", ["e(2)", "heavy top", "Manakov with cross terms", "bracket with parameters", "spin in a cavity"])
def test_the_law_balances_along_hamiltonian_fields(name):
    """E X_g f = E f X_g H / T, since fields have no divergence; on the surface through the state."""
    model, _ = made(SYSTEMS[name][0]).record, SYSTEMS[name][1]
    c, T = SYSTEMS[name][1], 1.5
    d = c.shape[2]
    point = tuple(np.linspace(0.4, 1.1, d).tolist())
    law, rng = law_of(model, point, T), np.random.default_rng(1)
    law.levels = law.levels[:6]
    y = next(part for part in law._parts(law.levels[0]))
    states = law._weighted(*y)[0]
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
