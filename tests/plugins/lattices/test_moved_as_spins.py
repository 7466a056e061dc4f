"""Systems on so(3)^n that the flows of spins move: they are the model to the last bit, or are refused with a reason."""

import numpy as np
import pytest
from states import finished
from test_currents import RING

from spi.kinds.trajectory import study as trajectory
from spi.plugins.spins.models import Anisotropy, Spins, Terms
from spi.plugins.systems.currents import energy_current
from spi.storage import Part


def test_the_current_of_a_generated_model_is_that_of_spins():
    y = np.random.default_rng(2).standard_normal((8, 3))
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    model = Spins("ring", (8,), (Terms((1.0, 0.8, 0.5)),), (1 / 3, 0.0, 0.0), Anisotropy(0.2))
    assert energy_current(RING)(y.ravel()) == pytest.approx(model.observables()["energy_current"](y.ravel()), rel=1e-12)


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
