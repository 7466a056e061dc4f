"""Currents, starts from the Gibbs law, correlations in space and time, and systems from YAML moved as spins."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from states import finished

from spi import views
from spi.ensemble.protocol import one_path
from spi.kinds.trajectory import study as trajectory
from spi.plugins.dynamics.kinds.statistics import study
from spi.plugins.spins.models import Anisotropy, Spins, Terms
from spi.plugins.spins.models.tables import bond_matrices, tables
from spi.plugins.spins.models.whole import Sampled
from spi.plugins.systems.currents import energy_current
from spi.storage import Part, Results


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


RING = {
    "algebra": "so(3)^n",
    "sizes": {"n": "8"},
    "variables": "x(i), y(i), z(i) for i = 1..n",
    "parameters": {"Jx": "1", "Jy": "4/5", "Jz": "1/2"},
    "hamiltonian": "-sum(Jx*x(i)*x(mod(i,n)+1) + Jy*y(i)*y(mod(i,n)+1) + Jz*z(i)*z(mod(i,n)+1) + x(i)/3 + z(i)^2/5"
    " for i = 1..n)",
}


def test_currents_of_systems_from_yaml():
    """Of a ring of spins that of the model; of FPUT -(p_i + p_(i+1)) V'(q_(i+1) - q_i) / 2 by bond."""
    rng = np.random.default_rng(2)
    y = rng.standard_normal((8, 3))
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    model = Spins("ring", (8,), (Terms((1.0, 0.8, 0.5)),), (1 / 3, 0.0, 0.0), Anisotropy(0.2))
    assert energy_current(RING)(y.ravel()) == pytest.approx(model.observables()["energy_current"](y.ravel()), rel=1e-12)
    chain = {
        "bracket": {"q(i) p(i) for i = 1..n": "1"},
        "sizes": {"n": "6"},
        "variables": ["q(i) for i = 1..n", "p(i) for i = 1..n"],
        "hamiltonian": "sum(p(i)^2/2 + (q(mod(i,n)+1)-q(i))^2/2 + (q(mod(i,n)+1)-q(i))^4/4 for i = 1..n)",
    }
    q, p = rng.standard_normal((2, 6))
    stretch = np.roll(q, -1) - q
    expected = -0.5 * ((p + np.roll(p, -1)) * (stretch + stretch**3)).sum()
    assert energy_current(chain)(np.concatenate([q, p])) == pytest.approx(expected, rel=1e-12)
    assert energy_current({"algebra": "so(3)", "hamiltonian": "y1^2"}) is None


STRETCH = "(q(mod(i,n)+1) - q(i))"


@pytest.mark.parametrize("offset", [0.0, 1e4, 1e8])
@pytest.mark.parametrize(
    "hamiltonian",
    [
        f"sum(p(i)^2/2 + {STRETCH}^2/2 + {STRETCH}^4/4 for i = 1..n)",
        f"sum(p(i)^2/2 + k*({STRETCH}^2/2 + {STRETCH}^4/4) for i = 1..n)",
        f"k*sum(p(i)^2/(2*k) + {STRETCH}^2/2 + {STRETCH}^4/4 for i = 1..n)",
    ],
)
def test_currents_keep_their_digits_far_from_the_origin(hamiltonian, offset):
    """-sum (p_i + p_(i+1)) V'(r_i) / 2 in exact fractions of the states, which a common shift does not change."""
    q, p = np.random.default_rng(3).standard_normal((2, 6)) + np.array([[offset], [0.0]])
    chain = {"bracket": {"q(i) p(i) for i = 1..n": "1"}, "sizes": {"n": "6"}, "parameters": {"k": "1/3"}}
    found = energy_current(chain | {"variables": "q(i), p(i) for i = 1..n", "hamiltonian": hamiltonian})
    k = Fraction(1, 3) if "k" in hamiltonian else Fraction(1)
    r = [Fraction(q[(i + 1) % 6]) - Fraction(q[i]) for i in range(6)]
    exact = -sum((Fraction(p[i]) + Fraction(p[(i + 1) % 6])) * k * (r[i] + r[i] ** 3) / 2 for i in range(6))
    assert found(np.stack([q, p], axis=1).ravel()) == pytest.approx(float(exact), rel=1e-13)


def test_terms_of_sums_have_places():
    """x_i (x_(i+1) + x_(i-1)) is two bonds, and a factor of all terms changes no place."""
    rest = {key: value for key, value in RING.items() if key != "hamiltonian"} | {"parameters": {"k": "1/3"}}
    terms = "sum({} + x(i)/3 + z(i)^2/5 for i = 1..n)"
    bonds = "x(i)*x(mod(i,n)+1) + y(i)*y(mod(i,n)+1)"
    ways = [
        f"k*{terms.format(bonds)}",
        terms.format(f"k*({bonds})").replace("+ x(i)/3 + z(i)^2/5", "+ k*(x(i)/3 + z(i)^2/5)"),
        f"k*{terms.format(' + '.join(f'{c}(i)*({c}(mod(i,n)+1) + {c}(mod(i-2,n)+1))/2' for c in 'xy'))}",
    ]
    y = np.random.default_rng(4).standard_normal(24)
    first, *others = [energy_current(rest | {"hamiltonian": way})(y) for way in ways]
    assert abs(first) > 0.01 and np.allclose(others, first, rtol=1e-12, atol=0.0)


def test_start_from_the_gibbs_law():
    """Energy and correlations of an open chain, and the quadrupole of free spins, exactly known."""
    states = np.random.default_rng(3).standard_normal((24, 64 * 64))
    law = Sampled(Spins("chain", (8,), (Terms(1.0),)), 0.5, 300)
    y = law.moved(law.states(states), 1, 0, 0).reshape(8, 3, -1)
    langevin = 1 / np.tanh(2.0) - 0.5
    for r in (1, 3):
        products = (y[:-r] * y[r:]).sum(axis=1).mean(axis=0)
        assert abs(products.mean() - langevin**r) < 4 * products.std() / 64
        assert abs(products.mean() - 1.1 * langevin**r) > 4 * products.std() / 64
    law = Sampled(Spins("chain", (8,), (Terms(0.0),), anisotropy=Anisotropy(1.0), mu=2.0, alpha=0.1), 0.5, 300)
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
    fig = views.figure(Results({"kind": "statistics", "title": ""}, (replace(found, panels=("structure",)).group(),)))
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


YAML = """
title: t
kind: trajectory
model:
  algebra: so(3)^n
  lattice: true
  sizes: {n: 8}
  variables: "x(i), y(i), z(i) for i = 1..n"
  hamiltonian: "-sum(x(i)*x(mod(i,n)+1) + 0.8*y(i)*y(mod(i,n)+1) + z(i)*z(mod(i,n)+1)/2 + x(i)/3 + z(i)^2/5 for i=1..n)"
initial: {spins: random}
final_time: 2
step: 1/8
schemes: [splitting_symmetric]
panels: [hamiltonian]
"""
MODEL = """\
  name: spins
  lattice: ring
  size: [8]
  bonds: {exchange: [1, 0.8, 0.5]}
  field: [1/3, 0, 0]
  anisotropy: {uniaxial: 0.2}
initial"""


def test_lattice_from_yaml_is_the_model(spec):
    """The same bits of the states and of H."""
    keys = YAML[YAML.index("  algebra") : YAML.index("initial") + len("initial")]
    plans = [
        trajectory.plan(spec(text).cases[0], Part("splitting_symmetric")) for text in (YAML, YAML.replace(keys, MODEL))
    ]
    ours, theirs = (plan.results(finished(plan)) for plan in plans)
    np.testing.assert_array_equal(ours.y, theirs.y)
    np.testing.assert_array_equal(ours.hamiltonian, theirs.hamiltonian)
    currents = [plan.case.model.observables()["energy_current"](ours.y.T) for plan in plans]
    np.testing.assert_allclose(*currents, rtol=1e-13, atol=1e-14)
    square = YAML.replace("x(i), y(i), z(i) for i = 1..n", "x(i,j), y(i,j), z(i,j) for i = 1..3, j = 1..3").replace(
        "n: 8", "n: 9"
    )
    square = square.replace(
        square[square.index("-sum") : square.index('"\ninitial')],
        "-sum(x(i,j)*x(mod(i,3)+1,j) + y(i,j)*z(i,mod(j,3)+1) for i = 1..3, j = 1..3)",
    )
    terms = ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    bonds = tuple(Terms(matrix=matrix, types=(k,)) for k, matrix in enumerate(terms))
    named = [m.observables() for m in (spec(square).cases[0].model, Spins("square", (3, 3), bonds))]
    state = np.random.default_rng(1).standard_normal(27)
    for name in ("H", "energy_current1", "energy_current2"):
        np.testing.assert_allclose(*(of[name](state) for of in named), rtol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("x(i)/3", "x(i)^3", "has '-x(1)^3'"),
        ("x(i)/3", "i*x(i)^2", "different anisotropies"),
        ("z(i)^2/5", "x(i)*y(i)*z(i)", "other degrees than 1 and 2"),
        ("so(3)^n", "so(4)", "must be so(3)^n beside lattice"),
        ("  sizes", "  noises: x(1)\n  sizes", "are not alike for all spins"),
    ],
)
def test_what_is_no_lattice(error, old, new, told):
    assert told in error(YAML, old, new)


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
