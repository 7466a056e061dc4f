"""Signs and counts of spins against the text of docs/spins.md, in NumPy: chirality, spellings, no noise."""

import itertools

import numpy as np
import pytest
from helpers import take_steps
from scipy.special import ive
from test_spins import mean_and_error, paths, spins_of, stepped

from spi.ensemble.protocol import add_block_drift, block_work, hamiltonian, in_kernels
from spi.numerics.rng import LANES
from spi.plugins.spins.models import Anisotropy, Spins, Terms
from spi.plugins.spins.models.lattices import Cell
from spi.plugins.spins.models.whole import SampledGibbs
from spi.schemes import SCHEMES, of_model

X, Y, Z = np.eye(3)
D, J = np.array([0.3, -0.7, 0.2]), np.array([[1.0, 0.2, -0.1], [0.4, -0.5, 0.3], [0.0, 0.6, 0.7]])


def crossed(d):
    """The matrix A for which s . A s' is d . (s x s'), in Levi-Civita's symbols."""
    return ((0.0, d[2], -d[1]), (-d[2], 0.0, d[0]), (d[1], -d[0], 0.0))


def test_the_energy_of_a_pair():
    """s1 = x, s2 = y, D = z: H = -1, in every spelling; along the bond as D = 1."""
    along_z = Cell(((0.0, 0.0, 0.0),), ((0.0, 0.0, 1.0),), ((0, 0, (1, 0, 0)),))
    state = np.concatenate([X, Y])
    for model in (
        Spins("chain", (2,), (Terms(dm=(0.0, 0.0, 1.0)),)),
        Spins("chain", (2,), (Terms(matrix=crossed(Z)),)),
        Spins(along_z, (2,), (Terms(dm=1.0),), boundary="open"),
    ):
        assert hamiltonian(in_kernels(model), state) == model.observables()["H"](state) == -1.0
        assert hamiltonian(in_kernels(model), np.concatenate([Y, X])) == 1.0


MODELS = {
    "dm": Spins("ring", (5,), (Terms(0.8, tuple(D), matrix=tuple(map(tuple, J))),), mu=1.5, alpha=0.3),
    "matrix": Spins(
        "ring", (5,), (Terms(matrix=tuple(map(tuple, J + 0.8 * np.eye(3) + crossed(D)))),), mu=1.5, alpha=0.3
    ),
}


def field_of(s):
    """b = -grad H of the ring: of the bonds to the next site and from the one before, as docs/spins.md says it."""
    after, before = np.roll(s, -1, axis=0), np.roll(s, 1, axis=0)
    exchange = 0.8 * (after + before) + after @ J.T + before @ J
    return exchange + np.cross(after, D) + np.cross(D, before)  # D . (s x s') = s . (s' x D) = s' . (D x s)


@pytest.mark.parametrize(("name", "by"), [*itertools.product(MODELS, ("bonds", "sites"))])
def test_every_formula_with_a_chirality(name, by):
    """H, the equation with damping by its field and by its flows, and the current of energy, of every spelling."""
    model = MODELS[name]._replace(by=by)
    record, s = in_kernels(model), spins_of(1, 5)
    first = s[:, :, 0]
    after = np.roll(first, -1, axis=0)
    bonds = -(0.8 * (first * after).sum(axis=1) + (first @ J * after).sum(axis=1) + np.cross(first, after) @ D)
    assert hamiltonian(record, first.ravel()) == pytest.approx(bonds.sum(), rel=1e-13)
    assert model.observables()["H"](first.ravel()) == pytest.approx(bonds.sum(), rel=1e-13)
    b = field_of(first)
    slope = (np.cross(b, first) + 0.3 * (b - (b * first).sum(axis=1, keepdims=True) * first)) / 1.5
    out = np.zeros(s.size)
    add_block_drift(record, 1.0, LANES, s.ravel(), out, np.zeros(block_work(record)))
    np.testing.assert_allclose(out.reshape(s.shape)[:, :, 0], slope, atol=1e-13)
    by_flows = (stepped(record, 1e-4, s) - stepped(record, -1e-4, s))[:, :, 0] / 2e-4
    np.testing.assert_allclose(by_flows, slope, atol=1e-7)
    # energies e of bonds, which exchange {e, e'} with the next bond, the site between them turning as the other says
    backwards = first @ J + 0.8 * first + np.cross(D, first)  # the field of the bond before at the second of its sites
    forwards = after @ J.T + 0.8 * after + np.cross(after, D)  # that of the bond behind at its first site
    exchanged = -(first * np.cross(np.roll(backwards, 1, axis=0), forwards)).sum(axis=1) / 1.5
    # the current counts each pair once, by the distance 1 of the middles of its bonds
    assert abs(model.observables()["energy_current"](first.ravel())) == pytest.approx(abs(exchanged.sum()), rel=1e-12)


def means_of_bonds(temperature, sites):
    """(E z . (s x s'), E s . s') of an open chain, J = 1, D = z/2: T times derivatives of ln Z.

    By the transfer operator in z, with the angles integrated: J cos + D sin = (J^2 + D^2)^(1/2) cos of a turned angle.
    """
    z, weight = np.polynomial.legendre.leggauss(240)
    size = np.sqrt(np.outer(1 - z**2, 1 - z**2)) / temperature

    def log_partition(j, d):
        strength = np.hypot(j, d)
        exponent = j * np.outer(z, z) / temperature + strength * size - strength / temperature
        operator, vector, total = np.exp(exponent) * ive(0, strength * size), np.ones(len(z)), 0.0
        for _ in range(sites - 1):
            vector = operator @ (weight * vector)
            total, vector = total + np.log(vector.max()), vector / vector.max()
        return total + np.log(weight @ vector) + (sites - 1) * strength / temperature

    def derivative(j, d):
        change = log_partition(1 + j, 0.5 + d) - log_partition(1 - j, 0.5 - d)
        return temperature * change / (2 * (j + d) * (sites - 1))

    return derivative(0, 1e-4), derivative(1e-4, 0)


def test_a_cold_chain_turns_the_right_way():
    """D/J = 1/2 along z, T = 0.01: from site to site by about +arctan 1/2 about z."""
    exact, along = means_of_bonds(0.01, 8)
    assert exact == pytest.approx(0.43929, abs=1e-5)
    model = Spins("chain", (8,), (Terms(1.0, (0.0, 0.0, 0.5)),), alpha=0.5)
    law, rest = SampledGibbs(model, 0.01, 400), np.arctan(0.5) * np.arange(8)
    states = np.tile(np.stack([np.cos(rest), np.sin(rest), 0 * rest], axis=1).reshape(-1, 1), (1, 512))
    s = law.moved(states, 1, 0, 0).reshape(8, 3, -1)
    mean, error = mean_and_error(np.cross(s[:-1], s[1:], axis=1)[:, 2].mean(axis=0))
    assert abs(mean - exact) < 4 * error < 0.006
    mean, error = mean_and_error((s[:-1] * s[1:]).sum(axis=1).mean(axis=0))
    assert abs(mean - along) < 4 * error < 0.006
    s = law.moved(states * np.tile([[1.0], [-1.0], [1.0]], (8, 1)), 1, 0, 0).reshape(8, 3, -1)  # wound the other way
    assert np.cross(s[:-1], s[1:], axis=1)[:, 2].mean() > 0


@pytest.mark.parametrize(
    ("scheme", "sites"),
    [("splitting", 3), ("euler_maruyama", 1), ("heun_renormalised", 1), ("heun_renormalised", 3), ("midpoint", 1)],
)
def test_one_spin_without_noise(scheme, sites):
    """From x, B = 2 along z: (cos 4, sin 4, 0) at t = 2, within the order; with alpha z = tanh(alpha B t)."""
    model = Spins("chain", (sites,), (), field=(0.0, 0.0, 2.0))
    order, few = {"splitting": (None, 256), "euler_maruyama": (1.0, 64)}.get(scheme, (2.0, 256))
    ends, exact = {}, np.array([np.cos(4), np.sin(4), 0.0])

    def after(model, steps):
        if scheme == "splitting":
            s = paths(model, np.inf, scheme, 2 / steps, steps, 1, np.tile(X, (sites, 1)))
        else:  # whose loop over time no other test needs
            record, y = of_model(SCHEMES[scheme], model).record, np.tile(X, sites)[:, np.newaxis].repeat(LANES, axis=1)
            s, _ = take_steps(record, in_kernels(model), 2 / steps, np.zeros((steps, 0, LANES)), y)
            s = s.reshape(sites, 3, LANES)
        assert (s == s[:1, :, :1]).all()
        return s[0, :, 0]

    for steps in (few, 2 * few):
        ends[steps] = abs(after(model, steps) - exact).max()
    damped = after(model._replace(alpha=0.25), few)
    assert ends[2 * few] < {None: 1e-13, 1.0: 0.1, 2.0: 1e-4}[order]
    assert order is None or abs(np.log2(ends[few] / ends[2 * few]) - order) < 0.2
    exact = np.array([np.cos(4) / np.cosh(1), np.sin(4) / np.cosh(1), np.tanh(1)])
    assert abs(damped - exact).max() < (0.1 if order == 1.0 else 3e-4)


def sphere():
    """(directions (n, 3), weights) of a quadrature."""
    z, weight = np.polynomial.legendre.leggauss(24)
    phi, r = np.arange(20) * (2 * np.pi / 20), np.sqrt(1 - z**2)
    points = np.stack([np.outer(r, np.cos(phi)), np.outer(r, np.sin(phi)), np.outer(z, np.ones(20))], axis=-1)
    return points.reshape(-1, 3), np.repeat(weight, 20)


def test_the_temperature_of_spins_is_a_ratio_of_means():
    """E torque2 / E laplacian = T under exp(-H/T), with each term of H; the mean of the ratios is another number."""
    points, weight = sphere()
    one = Spins("chain", (1,), (), (0.3, 0.2, 0.7), Anisotropy(0.6, (1.0, 1.0, 0.0), -0.8), mu=2.0)
    two = Spins("chain", (2,), (Terms(0.5, (0.3, -0.2, 0.6)),), (0.1, 0.4, -0.2))
    first, second = (np.repeat(points, len(points), axis=0), np.tile(points, (len(points), 1)))
    for model, states, w in (
        (one, points.T, weight),
        (two, np.concatenate([first, second], axis=1).T, np.outer(weight, weight).ravel()),
    ):
        named, temperature = model.observables(), 0.8
        law = w * np.exp(-named["H"](states) / temperature)
        torques, laplacian = (law @ named[name](states) for name in ("torque2", "laplacian"))
        assert torques / laplacian == pytest.approx(temperature, rel=1e-5)
        assert torques / laplacian != pytest.approx(0.81, rel=1e-3)
        mean = law @ named["spin_temperature"](states) / law.sum()
        assert abs(mean - temperature) > 0.05
