"""Currents, starts from the Gibbs law, and correlations in space and time."""

from dataclasses import replace

import numpy as np
import pytest
from states import finished

from spi import views
from spi.ensemble.protocol import one_path
from spi.kinds.trajectory import study as trajectory
from spi.plugins.dynamics.kinds.statistics import study
from spi.plugins.spins.models import Anisotropy, Spins, Terms
from spi.plugins.spins.models.tables import bond_matrices, tables
from spi.plugins.spins.models.whole import SampledGibbs
from spi.storage import Part, StoredResults


def balance(model: Spins, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(places, rates of change) of the energies of bonds and sites, and of mu s of the sites, of an open lattice."""
    of, lattice, sites = tables(model, np.inf), model.sites, np.arange(len(y))
    couplings, (i, j) = bond_matrices(model)[lattice.types], lattice.bonds.T
    cells = np.stack(np.unravel_index(sites // len(model.cell.sites), model.size), axis=1)
    x = cells + np.array(model.cell.fractions)[lattice.of_cell]
    gradients = np.zeros((len(i) + len(y), len(y), 3))
    bond = np.arange(len(i))
    gradients[bond, i] = -np.einsum("bij,bj->bi", couplings, y[j])
    gradients[bond, j] = -np.einsum("bji,bj->bi", couplings, y[i])
    axis = np.array(model.anisotropy.axis) / np.linalg.norm(model.anisotropy.axis)
    own = 2 * model.anisotropy.uniaxial * (y @ axis)[:, np.newaxis] * axis + 2 * model.anisotropy.cubic * y**3
    gradients[len(i) + sites, sites] = -of.moment[:, np.newaxis] * np.array(model.field) - own
    torque = np.cross(y, gradients.sum(axis=0))
    rates = np.einsum("eka,ka->e", gradients, torque / of.moment[:, np.newaxis])
    return np.concatenate([(x[i] + x[j]) / 2, x]), rates, x, torque


@pytest.mark.parametrize(
    ("model", "spins"),
    [
        (
            Spins(
                "chain",
                (7,),
                (Terms((1.0, 0.8, 0.3), (0.1, 0.2, 0.3)),),
                (0.1, 0.2, 0.3),
                Anisotropy(0.4, (1, 1, 0), 0.2),
            ),
            "",
        ),
        (Spins("chain", (7,), (Terms((1.0, 1.0, 0.3), (0.0, 0.0, 0.3)),), (0.0, 0.0, 0.3), Anisotropy(0.4)), "z"),
        (Spins("honeycomb", (4, 5), (Terms(1.0),), (0.0, 0.0, 0.4), mu=(1.0, 2.0), boundary="open"), "z"),
        (Spins("triangular", (4, 3), (Terms(1.0),), boundary="open"), "xyz"),
    ],
)
def test_currents_balance_densities(model, spins):
    """The current is the derivative of the sum of x e, and of x mu s_c where that total is conserved."""
    y = np.random.default_rng(1).standard_normal((model.sites.sites, 3))
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    places, rates, x, torque = balance(model, y)
    assert abs(rates.sum()) < 1e-14 * abs(rates).sum()
    named = model.observables()
    for along in range(len(model.size)):
        number = along + 1 if len(model.size) > 1 else ""
        assert named[f"energy_current{number}"](y.ravel()) == pytest.approx(places[:, along] @ rates, rel=1e-12)
        for c, name in enumerate("xyz"):
            assert (f"spin_current_{name}{number}" in named) == (name in spins)
            if name in spins:
                expected = x[:, along] @ torque[:, c]
                assert named[f"spin_current_{name}{number}"](y.ravel()) == pytest.approx(expected, rel=1e-10, abs=1e-11)


def test_start_from_the_gibbs_law():
    """Energy and correlations of an open chain, and the quadrupole of free spins, exactly known."""
    states = np.random.default_rng(3).standard_normal((24, 64 * 64))
    law = SampledGibbs(Spins("chain", (8,), (Terms(1.0),)), 0.5, 300)
    y = law.moved(law.states(states), 1, 0, 0).reshape(8, 3, -1)
    langevin = 1 / np.tanh(2.0) - 0.5
    for r in (1, 3):
        products = (y[:-r] * y[r:]).sum(axis=1).mean(axis=0)
        assert abs(products.mean() - langevin**r) < 4 * products.std() / 64
        assert abs(products.mean() - 1.1 * langevin**r) > 4 * products.std() / 64
    law = SampledGibbs(Spins("chain", (8,), (Terms(0.0),), anisotropy=Anisotropy(1.0), mu=2.0, alpha=0.1), 0.5, 300)
    z = law.moved(law.states(states), 1, 0, 0).reshape(8, 3, -1)[:, 2]
    u = np.linspace(-1, 1, 200001)
    squares, weight = (z**2).mean(axis=0), np.exp(u**2 / 0.5)
    assert abs(squares.mean() - (u**2 * weight).sum() / weight.sum()) < 4 * squares.std() / 64


SPINS = """
title: t
kind: statistics
model: {name: spins, lattice: ring, size: [8], bonds: {exchange: 1}}
initial: {law: gibbs, temperature: 0.5, sweeps: 200}
final_time: 8
step: 1/8
every: 2
schemes: [splitting_symmetric]
samples: 256
functions: {J: energy_current}
time_correlations: {until: 4, window: none, spins: [x, y, z], about: [0, 0, 1]}
"""


def test_structure_factor(spec):
    """Equal times by Fisher's correlations of rings; magnons of the equation and of the step; sum rule of S."""
    plan = study.plan(spec(SPINS).cases[0], Part("splitting_symmetric"))
    found = plan.results(finished(plan))
    time, s = found.time, found.time.structure
    fig = views.figure(
        StoredResults({"kind": "statistics", "title": ""}, (replace(found, panels=("structure",)).group(),))
    )
    marks = [line for line in fig.axes[0].lines if line.get_linestyle() == "None"]
    assert [line.get_marker() for line in marks] == ["o", "+"] and len(fig.axes[0].lines) == 2  # none between these q
    np.testing.assert_array_equal([line.get_ydata() for line in marks], [s.waves[:, 0], s.waves_of_step[:, 0]])
    np.testing.assert_allclose(s.waves[:, 0], 2 * (1 - np.cos(2 * np.pi * s.q)), atol=1e-7)
    assert 1e-4 < abs(s.waves_of_step - s.waves).max() < 2e-2
    np.testing.assert_allclose(s.wave_vector[:, 0], np.arange(5) / 8)
    x = np.linspace(-1, 1, 20001)
    bessel = [np.exp(2 * x) @ np.polynomial.legendre.Legendre.basis(k)(x) for k in range(12)]
    ratio = np.array(bessel) / bessel[0]  # eigenvalues of the transfer operator, with weights 2 l + 1
    k = np.arange(11)
    norm = ((2 * k + 1) * ratio[:11] ** 8).sum()
    pairs = ((k + 1) * (ratio[:11] ** 7 * ratio[1:12] + ratio[1:12] ** 7 * ratio[:11])).sum() / norm
    assert abs(s.between[1, 0] - pairs) < 4 * s.between_stderr[1, 0] < 0.04
    assert s.between[0, 0] == pytest.approx(1, abs=1e-12)
    over_all = (2 * s.factor.sum(axis=1) - s.factor[:, 0] - s.factor[:, -1])[[0, -1]]  # with negative frequencies
    np.testing.assert_allclose(over_all * (time.omega[1] / (2 * np.pi)), s.mode[[0, -1], 0], rtol=1e-10)
    currents = time.correlation[0]
    np.testing.assert_allclose(time.integral[0, 1], 0.25 * (currents[0] + currents[1]) / 2, rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ("until: 9", "must be between"),
        ("through: [[0], [0.3]]", "none of the lattice"),
        ("through: [[0, 0], [1/2, 0]]", "must have 1 numbers each"),
    ],
)
def test_faults_of_time_correlations(error, change, told):
    assert told in error(SPINS, "until: 4" if "until" in change else "window: none", change)


CURRENT = """
title: t
kind: statistics
model: {name: spins, lattice: ring, size: [8], bonds: {exchange: [1, 4/5, 1/2]}}
initial: {law: gibbs, temperature: 1/2, sweeps: 300}
final_time: 16
step: 1/8
every: 4
schemes: [splitting_symmetric]
samples: 4096
functions: {J: energy_current}
time_correlations: {until: 4}
"""


def test_current_of_an_xyz_ring_by_another_program(spec):
    """Cov(J(0), J(t)) by Metropolis's algorithm and Runge and Kutta's method, both written here, from other states."""
    couplings, rng, paths = np.array([1.0, 0.8, 0.5])[:, np.newaxis], np.random.default_rng(4), 4096
    s = rng.standard_normal((8, 3, paths))
    s /= np.linalg.norm(s, axis=1, keepdims=True)
    for sweep in range(400):
        for i in range(8):
            there = s[i] + rng.standard_normal((3, paths)) * (0.5 if sweep % 2 else 2.0)
            there /= np.linalg.norm(there, axis=0)
            gain = ((there - s[i]) * couplings * (s[i - 1] + s[(i + 1) % 8])).sum(axis=0)
            s[i] = np.where(rng.random(paths) < np.exp(np.minimum(2 * gain, 0)), there, s[i])

    def slope(s):
        return np.cross(couplings * (np.roll(s, 1, axis=0) + np.roll(s, -1, axis=0)), s, axis=1)

    def current(s):
        cross = np.cross(couplings * np.roll(s, -1, axis=0), couplings * np.roll(s, 1, axis=0), axis=1)
        return -(s * cross).sum(axis=(0, 1))

    first, h, values = current(s), 1 / 32, {}
    for n in range(1, 129):
        k1 = slope(s)
        k2 = slope(s + h / 2 * k1)
        k3 = slope(s + h / 2 * k2)
        s = s + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(s + h * k3))
        if n % 16 == 0:
            values[n // 16] = first * current(s)
    values[0] = first**2
    plan = study.plan(spec(CURRENT).cases[0], Part("splitting_symmetric"))
    time = plan.results(finished(plan)).time
    for lag in (0, 2, 4, 8):
        error = np.hypot(values[lag].std() / 64, time.correlation_stderr[0, lag])
        assert abs(values[lag].mean() - time.correlation[0, lag]) < 4 * error < 0.06
    assert time.correlation[0, 0] - time.correlation[0, 8] > 0.2


LARGE = """
title: t
kind: trajectory
model: {name: spins, lattice: square, size: [64, 32], bonds: {exchange: 1}, alpha: 0.5, by: sites}
temperature: 0.3
initial: {spins: random}
final_time: 48
step: 1/4
every: 64
schemes: [splitting_metropolis]
panels: [hamiltonian]
"""


def test_a_large_lattice_along_its_path(spec):
    """More noises than paths may have: the bits of the mover of one lattice, also where it goes on."""
    plan = trajectory.plan(spec(LARGE).cases[0], Part("splitting_metropolis"))
    assert plan.case.in_parts and len(plan.case.initial) == 6144
    mover = one_path(plan.case.model, plan.scheme, 0.25)
    states, _, _ = mover.moved(np.array(plan.case.initial), 0, 192, 64, 1, 0)
    np.testing.assert_array_equal(plan.results(finished(plan)).y[1:], states)


def test_a_large_lattice_needs_a_scheme_of_flows(error):
    assert "paths have at most 4096" in error(LARGE, "[splitting_metropolis]", "[euler_maruyama]")
