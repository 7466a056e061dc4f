"""Lattices of spins: flows against the field of H by finite differences, conservation, laws known in closed form."""

import itertools
from types import SimpleNamespace

import mpmath
import numba
import numpy as np
import pytest
from scipy.linalg import expm

from spi.drawing import style
from spi.ensemble.increments import brownian
from spi.ensemble.loop import grid, integrated
from spi.ensemble.protocol import (
    add_block_drift,
    at_temperature,
    block_drift_flow,
    block_friction_flow,
    block_work,
    frictions,
    hamiltonian,
    in_kernels,
    one_path,
    pieces,
)
from spi.ensemble.scheme_protocol import REPORT
from spi.expressions import as_numpy, parse_expression
from spi.kinds import one_path as alone
from spi.models.delegation import thermal
from spi.numerics.rng import LANES, draw_increments
from spi.plugins.dynamics.kinds.statistics.fits import decay
from spi.plugins.spins.models import Anisotropy, Spins, Terms, Transport, whole
from spi.plugins.spins.models.flows import NEAR, towards, towards_near, versines_of_noise
from spi.plugins.spins.models.lattices import LATTICES, lattice
from spi.plugins.spins.models.tables import moves
from spi.running.load import load
from spi.running.remarks import warnings
from spi.schemes import SCHEMES, of_model
from spi.schemes.splitting import splitting
from spi.schemes.stages import flows
from spi.storage import Part
from spi.storage.stored import Description

CASES = {
    "heisenberg": Spins("ring", (6,), (Terms(1.3),), field=(0.3, 0.2, -0.5), mu=1.5),
    "xyz": Spins("ring", (5,), (Terms((1.0, -0.5, 0.7)),), anisotropy=Anisotropy(0.4, (1.0, 1.0, 0.0), 0.3)),
    "chiral": Spins("square", (4, 3), (Terms(1.0, 0.6),), alpha=0.3),
    "ferrimagnet": Spins(
        "honeycomb",
        (2, 2),
        (Terms((1.0, 1.0, 0.3), (0.2, 0.4, 0.1)), Terms(0.5, types=(1,))),
        mu=(1.0, 2.0),
        alpha=0.3,
        anisotropy=Anisotropy(0.4, (1.0, 1.0, 0.0), 0.3),
        field=(0.0, 0.0, 1.0),
    ),
    "bcc": Spins("bcc", (2, 2, 3), (Terms(1.0),), mu=(1.0, 2.0)),
    "triangular": Spins("triangular", (3, 4), (Terms(-1.0, 0.2),)),
}


def spins_of(seed: int, sites: int, lanes: int = LANES) -> np.ndarray:
    """(sites, 3, lanes) of length 1."""
    s = np.random.default_rng(seed).standard_normal((sites, 3, lanes))
    return s / np.linalg.norm(s, axis=1, keepdims=True)


def drift(record, s: np.ndarray) -> np.ndarray:
    """mu s' = b x s + alpha (b - (s . b) s) of a state (sites, 3), b by finite differences of H."""
    b = np.zeros_like(s)
    for i, a in np.ndindex(*s.shape):
        e = np.zeros_like(s)
        e[i, a] = 1e-5
        b[i, a] = (hamiltonian(record, (s - e).ravel()) - hamiltonian(record, (s + e).ravel())) / 2e-5
    damping = record.alpha * (b - (b * s).sum(axis=1, keepdims=True) * s)
    return (np.cross(b, s) + damping) / record.moment[:, np.newaxis]


def stepped(record, t: float, s: np.ndarray) -> np.ndarray:
    """The palindrome of all flows over the time t."""
    y, work = s.ravel().copy(), np.zeros(block_work(record))
    for k in range(pieces(record)):
        block_drift_flow(record, k, t / 2, LANES, y, work)
    for k in [*range(frictions(record)), *range(frictions(record))[::-1]]:
        block_friction_flow(record, k, t / 2, LANES, y, work)
    for k in range(pieces(record) - 1, -1, -1):
        block_drift_flow(record, k, t / 2, LANES, y, work)
    return y.reshape(s.shape)


@pytest.mark.parametrize("by", ["bonds", "sites"])
@pytest.mark.parametrize("name", CASES)
def test_flows_add_up_to_the_field(name, by):
    """To first order in t, in every term; with another sign of one term they would not."""
    model = CASES[name]._replace(by=by)
    assert model.fault() is None
    record = in_kernels(model)
    s = spins_of(1, record.d // 3)
    field, out = drift(record, s[:, :, 0]), np.zeros(s.size)
    add_block_drift(record, 1.0, LANES, s.ravel(), out, np.zeros(block_work(record)))
    assert abs(out.reshape(s.shape)[:, :, 0] - field).max() < 1e-9
    h = 1e-4
    by_flows = (stepped(record, h, s) - stepped(record, -h, s))[:, :, 0] / (2 * h)
    assert abs(by_flows - field).max() < 1e-6
    other = in_kernels(model._replace(bonds=(model.bonds[0]._replace(exchange=-0.5), *model.bonds[1:])))
    assert abs(by_flows - drift(other, s[:, :, 0])).max() > 1e-2


@pytest.mark.parametrize(("name", "by"), [*itertools.product(["heisenberg", "bcc", "triangular"], ["bonds", "sites"])])
def test_what_long_paths_conserve(name, by):
    """By bonds the total of mu s without a field, by sites H; lengths and reversibility in both."""
    model = CASES[name]._replace(by=by, field=(0.0, 0.0, 0.0))
    model = model._replace(bonds=(model.bonds[0]._replace(dm=0.0),))
    record = in_kernels(model)
    s = spins_of(2, record.d // 3)
    y = s
    for _ in range(200):
        y = stepped(record, 0.5, y)
    assert abs((y**2).sum(axis=1) - 1).max() < 1e-14
    total = abs(np.tensordot(record.moment, y - s, axes=1)).max()
    energy = abs(hamiltonian(record, y[:, :, 3].ravel()) - hamiltonian(record, s[:, :, 3].ravel()))
    conserved, other = (total, energy) if by == "bonds" else (energy, total)
    assert conserved < 1e-12 < 1e-4 < other
    there = y
    for t in [0.5] * 8 + [-0.5] * 8:
        y = stepped(record, t, y)
    assert abs(y - there).max() < 1e-11


def test_a_pair_has_its_period():
    """2 pi / (J |s_1 + s_2|), in one step by bonds; half a period is far away."""
    record = in_kernels(Spins("chain", (2,), (Terms(0.7),)))
    s = spins_of(3, 2)
    s[:] = s[:, :, :1]
    period = 2 * np.pi / (0.7 * np.linalg.norm(s[:, :, 0].sum(axis=0)))
    assert abs(stepped(record, period, s) - s).max() < 1e-14
    assert abs(stepped(record, period / 2, s) - s).max() > 0.1


def test_matrices_are_sums_of_their_moves():
    for seed, matrix in enumerate([np.eye(3) * -2, np.diag([1.0, 1, 0.3]), np.diag([1.0, 1, 0]), *np.ones((6, 3, 3))]):
        if seed > 2:
            matrix = np.random.default_rng(seed).standard_normal((3, 3))
        parts = moves(matrix)
        total = np.zeros((3, 3))
        for part in parts:
            f = part.frame
            total += part.strength * (np.outer(f[:3], f[3:6]) if part.form == 2 else f.reshape(3, 3))
        assert np.allclose(total, matrix, atol=1e-14)
        assert len(parts) == [1, 2, 2, 3, 3, 3, 3, 3, 3][seed]


@pytest.mark.parametrize("name", LATTICES)
def test_colours_touch_nothing_twice(name):
    of = lattice(LATTICES[name], (4, 6, 3)[: len(LATTICES[name].vectors)], name != "chain")
    for colour in range(of.bond_colours.max() + 1):
        ends = of.bonds[of.bond_colours == colour].ravel()
        assert len(np.unique(ends)) == len(ends)
    assert (of.site_colours[of.bonds[:, 0]] != of.site_colours[of.bonds[:, 1]]).all()
    degree = {"chain": 1.5, "ring": 2, "square": 4, "triangular": 6, "honeycomb": 3, "cubic": 6, "bcc": 8}
    degree |= {"kagome": 4, "ring_j1_j2": 4, "square_j1_j2": 8, "honeycomb_j1_j2": 9}
    assert len(of.bonds) == degree[name] * of.sites / 2


def paths_and_report(model, temperature, scheme, h, steps, blocks, states, seed=1):
    """(states (sites, 3, paths), report by its columns) of paths that begin at `states` (sites, 3)."""
    at = thermal(model, temperature)
    record, entry = in_kernels(at), of_model(SCHEMES[scheme], at)
    times = grid(h, steps)
    y, report = integrated(entry.record, record, states.ravel(), times, brownian(seed), 0, blocks, blocks * LANES)
    y = y[:, 0, : record.d * LANES].reshape(blocks, -1, 3, LANES)
    return np.concatenate(list(y), axis=-1), dict(zip(REPORT, report.sum(axis=(0, 1)), strict=True))


def paths(*arguments, **keys):
    """The states of :func:`paths_and_report`."""
    return paths_and_report(*arguments, **keys)[0]


@pytest.mark.parametrize("by", ["bonds", "sites"])
def test_what_a_hundred_thousand_steps_conserve(by):
    """Of h = 1/2, on a ring of 6 spins: the total spin by bonds, H by sites, to 1e-13 a spin; all lengths to 1e-14."""
    model = Spins("ring", (6,), (Terms(1.0),), by=by)
    record, s = in_kernels(model), spins_of(11, 6)
    y = paths(model, np.inf, "splitting_symmetric", 0.5, 100_000, 1, s[:, :, 0])[:, :, 0]
    first = s[:, :, 0]
    assert abs(np.linalg.norm(y, axis=1) - 1).max() < 1e-14
    total = abs(y.mean(axis=0) - first.mean(axis=0)).max()
    energy = abs(hamiltonian(record, y.ravel().copy()) - hamiltonian(record, first.ravel().copy())) / 6
    conserved, other = (total, energy) if by == "bonds" else (energy, total)
    assert conserved < 1e-13 < 1e-4 < other


def mean_and_error(values: np.ndarray) -> tuple[float, float]:
    return values.mean(), values.std() / np.sqrt(values.size)


@pytest.mark.parametrize("alpha", [0.2, 0.5])
def test_free_spins_forget(alpha):
    """E s(t) . s(0) = exp(-2 alpha T t / mu), of which the step by one turn of a Gaussian vector has two orders."""
    model = Spins("chain", (1,), (), mu=1.5, alpha=alpha)
    first = spins_of(4, 1, 1)[:, :, 0]
    last = paths(model, 0.6, "splitting_symmetric", 0.125, 8, 128, first)
    mean, error = mean_and_error(np.einsum("ia,iap->p", first, last))
    exact = np.exp(-2 * alpha * 0.6 / 1.5)
    assert abs(mean - exact) < 4 * error < 0.05
    assert abs(mean - np.exp(-2 * alpha * 0.6)) > 5 * error


def test_turns_about_random_axes_have_the_means_of_noise():
    """Of spherical harmonics of degree l: exact for l = 1 and 2, and for others up to the cube of the variance."""
    errors = {}
    for v in (0.005, 0.01, 0.5, 2.0, 40.0):
        angles = np.arccos(1 - np.array(versines_of_noise(v)))
        for ell in range(1, 6):
            mean = np.mean((1 + 2 * np.cos(np.outer(np.arange(1, ell + 1), angles)).sum(axis=0)) / (2 * ell + 1))
            errors[ell, v] = mean - np.exp(-ell * (ell + 1) * v / 2)
    assert max(abs(error) for (ell, _), error in errors.items() if ell < 3) < 1e-14
    assert all(7 < errors[ell, 0.01] / errors[ell, 0.005] < 9 for ell in (3, 4, 5))


def test_free_spins_of_one_lattice():
    """E s(t) . s(0) = exp(-2 alpha T t / mu), and that of (s(t) . s(0))^2, at any step: here two turns of v = 1.2."""
    model = at_temperature(Spins("ring", (1 << 15,), (), mu=1.5, alpha=0.5), 1.8)
    mover = one_path(model, of_model(SCHEMES["splitting"], model).record, 1.0)
    first = spins_of(4, 1 << 15, 1)[:, :, 0]
    _, last, _ = mover.moved(first.ravel(), 0, 2, 0, 7, 0)
    along = np.einsum("ia,ia->i", first, last.reshape(-1, 3))
    for values, exact in ((along, np.exp(-2.4)), (along**2, (1 + 2 * np.exp(-7.2)) / 3)):
        mean, error = mean_and_error(values)
        assert abs(mean - exact) < 4 * error < 0.015


@pytest.mark.parametrize(("by", "mu"), [("bonds", (1.0,)), ("sites", (1.0, 3.0))])
def test_energies_of_chains(by, mu):
    """1/K - coth K a bond (Fisher 1964), whatever the moments, exact at large steps where flows are judged.

    Without that the mean is off at the same step.
    """
    cell = (
        LATTICES["chain"]
        if len(mu) == 1
        else LATTICES["chain"]._replace(
            sites=((0.0, 0.0, 0.0), (0.5, 0.0, 0.0)), bonds=((0, 1, (0, 0, 0)), (1, 0, (1, 0, 0)))
        )
    )
    size = (16 // len(mu),)
    model = Spins(cell, size, (Terms(1.0),), mu=mu, alpha=0.5, boundary="open", by=by)
    exact = 0.5 - 1 / np.tanh(2)
    up = np.tile([0.0, 0.0, 1.0], (16, 1))
    energies = {}
    for scheme in ("splitting_metropolis", "splitting"):
        s = paths(model, 0.5, scheme, 1.0, 64, 48, up)
        energies[scheme] = mean_and_error(-(s[:-1] * s[1:]).sum(axis=1).mean(axis=0))
    mean, error = energies["splitting_metropolis"]
    assert abs(mean - exact) < 4 * error < 0.01
    mean, error = energies["splitting"]
    assert abs(mean - exact) > 20 * error


@pytest.mark.parametrize("scheme", ["splitting_symmetric", "splitting_metropolis"])
@pytest.mark.parametrize("by", ["bonds", "sites"])
def test_one_large_lattice(by, scheme):
    """The lattice in parts moves as the whole in one lane without noise; with noise the bits are those of any threads.

    Paths stop and go on at multiples of 128 steps.
    """
    model = Spins("cubic", (8, 8, 8), (Terms(1.0, 0.2),), field=(0.0, 0.1, 0.2), by=by)
    s = spins_of(5, 512, 1)[:, :, 0]
    lasts = []
    for alpha in (0.0, 0.3):
        damped = model._replace(alpha=alpha)
        entry = of_model(SCHEMES["splitting_symmetric"], damped)
        _, last, _ = one_path(damped, entry.record, 0.125).moved(s.ravel(), 0, 16, 0, 1, 0)
        whole = paths(damped, np.inf, "splitting_symmetric", 0.125, 16, 1, s)[:, :, 0]
        assert abs(last - whole.ravel()).max() < 1e-13
        lasts.append(last)
    assert abs(lasts[0] - lasts[1]).max() > 0.1
    at = at_temperature(model._replace(alpha=0.3), 0.8)
    mover = one_path(at, of_model(SCHEMES[scheme], at).record, 0.25)
    if mover is None:
        assert (by, scheme) == ("bonds", "splitting_metropolis")
        return
    before, results = numba.get_num_threads(), []
    for threads, stops in ((1, (256,)), (min(2, before), (256,)), (1, (128, 128))):
        numba.set_num_threads(threads)
        y, n = s.ravel(), 0
        for steps in stops:
            _, y, _ = mover.moved(y, n, steps, 0, 7, 0)
            n += steps
        results.append(y)
    numba.set_num_threads(before)
    assert all(np.array_equal(results[0], other) for other in results[1:])
    assert not np.array_equal(results[0], mover.moved(s.ravel(), 0, 256, 0, 8, 0)[1])
    assert abs(np.linalg.norm(results[0].reshape(-1, 3), axis=1) - 1).max() < 1e-14


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread only")
def test_small_lattices_have_one_thread(monkeypatch):
    """Of a step of less than 0.2 ms threads would wait for one another most of the time."""
    used = []
    monkeypatch.setattr(whole, "move_lattice", lambda *_: (used.append(numba.get_num_threads()), (0, 0.0))[1])
    for length in (8, 32):
        model = at_temperature(Spins("cubic", (length,) * 3, (Terms(1.0),), alpha=1.0, by="sites"), 1.0)
        mover = one_path(model, of_model(SCHEMES["splitting_metropolis"], model).record, 0.5)
        mover.moved(np.zeros(3 * length**3), 0, 16, 0, 1, 0)
        threads = numba.get_num_threads()
        times = threads if length == 8 else 1
        assert alone.move_seconds(mover, 1000) == pytest.approx(1e-6 * mover.ns * times)
    assert used == [1, threads]


def test_schemes_that_one_lattice_does_not_have():
    """Coins, loops, shared increments and judged drift are for paths."""
    model = at_temperature(Spins("ring", (128,), (Terms(1.0),), alpha=0.3), 0.8)
    half = flows("noise", fraction=1 / 2, shared=True)
    names = "splitting_order2", "splitting_joint", "splitting_areas", "splitting_metropolis", "midpoint"
    records = [SCHEMES[name].record for name in names] + [splitting(half, flows("drift"), half)]
    assert [one_path(model, record, 0.1) for record in records] == [None] * 6
    assert one_path(model, splitting(flows("noise", shared=True), flows("drift")), 0.1) is not None


def report_of_one(model, scheme, h, steps, state):
    """(last state (sites, 3), report by its columns) of one large lattice."""
    mover = one_path(model, of_model(SCHEMES[scheme], model).record, h)
    _, last, report = mover.moved(np.ravel(state), 0, steps, 0, 1, 0)
    return last.reshape(-1, 3), dict(zip(REPORT, report[0], strict=True))


def test_angles_of_one_large_lattice_and_of_paths():
    """Of free spins in the field B the angle of a step is B h; from 1.6e6 on, where sines fail, nothing is finite."""
    flat = np.tile([1.0, 0.0, 0.0], (128, 1))
    for field, angle in ((2.0, 0.5), (10.0, 2.5), (6e6, 1.5e6), (8e6, 2e6)):
        model = Spins("ring", (128,), (), field=(0.0, 0.0, field))
        last, report = report_of_one(model, "splitting", 0.25, 1, flat)
        assert report["largest_angle"] == (angle if angle > np.pi / 4 else 0.0)
        states = paths(model, np.inf, "splitting", 0.25, 1, 1, flat)
        assert np.isfinite(last).all() == (angle < 1.6e6)
        assert np.isfinite(states).all(axis=(0, 1)).tolist() == [angle < 1.6e6] * LANES  # of each path
        if angle < 1.6e6:
            turned = np.array([np.cos(angle), np.sin(angle), 0.0])
            assert abs(last - turned).max() < 1e-9 and abs(states - turned[:, np.newaxis]).max() < 1e-9
    about = Spins("ring", (1 << 12,), (), noise=Transport(1.0, axis=(0.0, 0.0, 1.0)))
    _, report = report_of_one(about, "splitting", 1.0, 4, np.tile([1.0, 0.0, 0.0], (1 << 12, 1)))
    assert 3.4 < report["largest_angle"] < 5.8  # of 16,384 standard normals: P < 1e-4 beyond either bound


def test_accepted_turns_of_one_large_lattice():
    """All of free spins; of bonds a share that falls with the step, as that of 64 paths of the same ring."""
    up, steps = np.tile([0.0, 0.0, 1.0], (128, 1)), 64
    _, report = report_of_one(
        at_temperature(Spins("ring", (128,), (), alpha=0.5, by="sites"), 1.0), "splitting_metropolis", 1.0, steps, up
    )
    judged = 3 * 128 * steps
    assert report["noise_judged"] == report["noise_accepted"] == judged
    model = Spins("ring", (128,), (Terms(1.0),), alpha=0.5, by="sites")
    shares = []
    for h in (0.25, 1.0):
        _, report = report_of_one(at_temperature(model, 0.5), "splitting_metropolis", h, steps, up)
        assert (report["noise_judged"], report["drift_judged"], report["drift_accepted"]) == (judged, steps, steps)
        shares.append(report["noise_accepted"] / judged)
    _, of_paths = paths_and_report(model, 0.5, "splitting_metropolis", 1.0, steps, 1, up)
    assert of_paths["noise_judged"] == LANES * judged
    assert abs(shares[1] - of_paths["noise_accepted"] / of_paths["noise_judged"]) < 0.01
    assert 0.5 < shares[1] < shares[0] - 0.05 < 0.95


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"size": (4, 4)}, "size"),
        ({"size": (1,)}, "lattice"),
        ({"bonds": (Terms(1.0, types=(3,)),)}, "bonds"),
        ({"mu": (1.0, 2.0)}, "mu"),
        ({"alpha": 0.1, "noise": Transport(0.2)}, "noise"),
        ({"lattice": LATTICES["ring"]._replace(bonds=((0, 2, (1, 0, 0)),))}, "lattice"),
    ],
)
def test_faults(changes, key):
    assert Spins("ring", (4,), (Terms(1.0),)).fault() is None
    assert Spins("ring", (4,), (Terms(1.0),))._replace(**changes).fault()[0] == key


def test_observables_by_name():
    """Of states without arithmetic of the program: fields from differences of H, correlations from H."""
    model = Spins("ring", (6,), (Terms(1.3),), field=(0.0, 0.0, 0.4), mu=1.5)
    named, record = model.observables(), in_kernels(model)
    s = spins_of(6, 6)
    states = s.reshape(18, LANES)
    field = 1.5 * 0.4 * s[:, 2].sum(axis=0)
    energy = named["H"](states)
    np.testing.assert_allclose(energy, [hamiltonian(record, np.ascontiguousarray(y)) for y in states.T], rtol=1e-14)
    np.testing.assert_allclose(named["corr1"](states), -(energy + field) / (6 * 1.3), atol=1e-14)
    np.testing.assert_allclose(named["corr3"](states), (s * np.roll(s, 3, axis=0)).sum(axis=1).mean(axis=0), atol=1e-14)
    np.testing.assert_allclose(named["mz"](states), 1.5 * s[:, 2].mean(axis=0))
    staggered = s[::2, 0].sum(axis=0) - s[1::2, 0].sum(axis=0)
    np.testing.assert_allclose(named["nx"](states), 1.5 * staggered / 6)
    assert "corr4" not in named and "nx" not in model._replace(size=(5,)).observables()
    first = s[:, :, 0]
    turning = drift(record, first) * record.moment[:, np.newaxis]  # b x s
    b = 1.3 * (np.roll(first, 1, axis=0) + np.roll(first, -1, axis=0)) + np.array([0, 0, 0.6])
    expected = (turning**2).sum() / (2 * (first * b).sum())
    assert named["spin_temperature"](states)[0] == pytest.approx(expected, rel=1e-7)
    for model in CASES.values():
        states = spins_of(8, in_kernels(model).d // 3)[:, :, :2].reshape(-1, 2)
        energies = [hamiltonian(in_kernels(model), np.ascontiguousarray(y)) for y in states.T]
        np.testing.assert_allclose(model.observables()["H"](states), energies, rtol=1e-12)


@pytest.mark.parametrize("exponent", [1e-9, 0.01, 0.3, 0.5, 3.0, 40.0])
def test_damped_flow(exponent):
    """The closed form in 50 digits; both ways where the shorter one is accurate, and only there."""
    s, n = spins_of(7, 2, 1)[:, :, 0].tolist()
    with mpmath.workdps(50):
        u = mpmath.fdot(s, n)
        c, q = mpmath.cosh(exponent), mpmath.sinh(exponent)
        exact = [float((x + ((c - 1) * u + q) * m) / (c + u * q)) for x, m in zip(s, n, strict=True)]
    arguments = (*n, exponent, *s)  # |b| is 1
    assert np.allclose(towards(*arguments), exact, rtol=0, atol=1e-15)
    assert (abs(np.array(towards_near(*arguments)) - exact).max() < 1e-15) == (exponent <= NEAR)


def test_topological_charge():
    """A whole number of any state of a periodic lattice; 1 of a map that covers the sphere once."""
    model = Spins("square", (24, 24), (Terms(1.0),))
    charge = model.observables()["charge"]
    values = charge(spins_of(9, 576).reshape(1728, LANES))
    np.testing.assert_allclose(values, np.round(values), atol=1e-10)
    x, y = np.meshgrid(np.arange(24) - 11.5, np.arange(24) - 11.5, indexing="ij")
    r = np.hypot(x, y)
    polar = np.pi * np.maximum(1 - r / 11, 0)
    whirl = np.stack([np.sin(polar) * x / r, np.sin(polar) * y / r, np.cos(polar)], axis=-1)
    assert abs(charge(whirl.reshape(-1))) == pytest.approx(1, abs=1e-12)
    assert "charge" not in Spins("honeycomb", (4, 4), (Terms(1.0),)).observables()


def field_of(s, dW, h, alpha=0.3):
    """h f + sum_k sigma_k dW_k f_k of a ring, in NumPy."""
    b = np.roll(s, 1, axis=0) + np.roll(s, -1, axis=0) + np.array([0.3, 0.2, -0.5])
    return np.cross(h * b + dW, s) + h * alpha * np.cross(s, np.cross(b, s))


@pytest.mark.parametrize("scheme", ["heun_renormalised", "midpoint"])
def test_steps_of_other_programs(scheme):
    """A step against NumPy: of Heun's scheme, each spin back to length 1, and of the equation of the midpoint rule."""
    model = at_temperature(Spins("ring", (6,), (Terms(1.0),), field=(0.3, 0.2, -0.5), alpha=0.3), 0.5)
    first, h = spins_of(3, 6, 1)[:, :, 0], 0.125
    last = paths(model.model, 0.5, scheme, h, 1, 1, first, 5)
    w = np.empty((18, 4, LANES))
    for k in range(18):
        where = np.uint64(5), np.uint64(0), np.uint64(k), np.uint64(0), np.uint64(0)
        draw_increments(*where, 1.0, np.empty(256, np.uint64), w[k].ravel(), LANES)
    dW = (np.sqrt(2 * 0.3 * 0.5 * h) * w[:, 0]).reshape(6, 3, LANES)
    for lane in (0, 63):
        z, noise = last[:, :, lane], dW[:, :, lane]
        if scheme == "midpoint":
            np.testing.assert_allclose(z - first, field_of((first + z) / 2, noise, h), atol=1e-13)
            assert abs(np.linalg.norm(z, axis=1) - 1).max() < 1e-14
        else:
            added = field_of(first, noise, h)
            new = first + (added + field_of(first + added, noise, h)) / 2
            np.testing.assert_allclose(z, new / np.linalg.norm(new, axis=1, keepdims=True), atol=1e-14)


def brown(k: float, degree: int = 60) -> np.ndarray:
    """Brown's operator over alpha T for the energy -K s_z^2, k = K/T, on Legendre polynomials of z (columns).

    d/dz (1 - z^2) d/dz + 2 k z (1 - z^2) d/dz.
    """
    ell = np.arange(degree + 1.0)
    times_z = np.diag((ell[:-1] + 1) / (2 * ell[:-1] + 1), -1) + np.diag(ell[1:] / (2 * ell[1:] + 1), 1)
    slope = np.diag(ell[1:] * (ell[1:] + 1) / (2 * ell[1:] + 1), 1)  # (1 - z^2) d/dz
    slope -= np.diag(ell[:-1] * (ell[:-1] + 1) / (2 * ell[:-1] + 1), -1)
    return np.diag(-ell * (ell + 1)) + 2 * k * times_z @ slope


def test_switching_by_legendre_polynomials():
    """The rates of Brown's equation, and the means of the experiment: E s_z from s_z = 1."""
    rates = [np.sort(-np.linalg.eigvals(brown(k)).real)[1] for k in (1, 2, 5, 10)]
    np.testing.assert_allclose(rates, [1.3062796687, 0.8076818777, 0.1354063297, 0.0028821667], atol=1e-10)
    experiment = load("uniaxial_switching")
    for case, k in zip(experiment.cases, (1, 2, 5), strict=True):
        for t in case.t:
            mean = expm(0.5 * t * brown(k))[:, 1].sum()
            formula = parse_expression(case.reference["z"], 1, ("t",))
            assert abs(as_numpy(formula)(np.full((1, 1), t))[0] - mean) < 1e-6


def test_rates_of_switching_by_legendre_polynomials():
    """What the experiment claims, and what faster modes do to a fit to the covariance of s_z under the Gibbs law."""
    z, weight = np.polynomial.legendre.leggauss(80)
    experiment = load("switching_rates")
    for case, k in zip(experiment.cases, (1, 2, 5), strict=True):
        (claim,), given, between = case.claims, case.time_correlations, case.every * case.step
        rate = 0.5 * np.sort(-np.linalg.eigvals(brown(k)).real)[1]
        assert claim.quantity == "time_rate" and abs(claim.number - rate) < 5e-6 and claim.tolerance < 0.02 * rate
        law = weight * np.exp(k * z**2)
        of_degrees = (z * law) @ np.polynomial.legendre.legvander(z, 60) / law.sum()
        lags = np.arange(round(given.until / between) + 1)
        covariance = np.array([of_degrees @ expm(0.5 * between * n * brown(k))[:, 1] for n in lags])[np.newaxis]
        fitted = [decay(covariance[:, begin:])[0, 0] / between for begin in (round(given.fit_from / between), 0)]
        assert 0 < fitted[0] - rate < min(3e-4, claim.tolerance / 5)
        assert fitted[1] - rate > 1e-3
    assert fitted[1] - rate > 2 * claim.tolerance  # of the highest barrier


def test_weak_order_2_of_noisy_spins():
    """The slope of the error of E s_z(1) at three steps, against Brown's equation; beside it one of order 1."""
    model = Spins("ring", (8,), (), anisotropy=Anisotropy(2.0), alpha=0.5)
    exact, up, slopes = expm(0.5 * brown(2))[:, 1].sum(), np.tile([0.0, 0.0, 1.0], (8, 1)), {}
    for scheme in ("splitting_symmetric", "splitting"):
        errors = []
        for h in (0.5, 0.25, 0.125):
            mean, stderr = mean_and_error(paths(model, 1.0, scheme, h, round(1 / h), 2048, up)[:, 2].mean(axis=0))
            errors.append(mean - exact)
            assert stderr < abs(errors[-1]) / 6
        slopes[scheme] = np.log2(np.array(errors[:-1]) / errors[1:])
    assert all(abs(slopes["splitting_symmetric"] - 2) < 0.2) and all(slopes["splitting"] < 1.3)


def test_figures_call_the_final_time_so():
    """Of spins T is the temperature, also where there is none; of a rigid body it is the final time."""
    told = []
    for name in ("skyrmion", "rigid_body_qualitative"):
        case = load(name).cases[0]
        about = Description.describe(case, case.row(case.schemes[0]), Part(case.schemes[0]))
        told.append(style.facts(SimpleNamespace(about=about, samples=1), "samples"))
    assert [facts["final_time"].split("=")[0] for facts in told] == [r"$\mathrm{final\ time}", "$T"]
    assert told[0]["samples"] == "1 sample"


def test_a_temperature_below_zero_is_told():
    (line,) = warnings(load("skyrmion", overrides=["temperature=-0.1"]))
    assert line.startswith("warning: temperature is -0.1, below 0")
    assert warnings(load("skyrmion", overrides=["temperature=0.1"])) == warnings(load("skyrmion")) == []
