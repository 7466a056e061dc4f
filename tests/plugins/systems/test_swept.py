"""Swept parameters and sizes of a system."""

import pytest

pytestmark = pytest.mark.needs("dynamics")

STATISTICS = """\
kind: statistics
model: {algebra: so(3), variables: [P1, P2, P3], parameters: {a: 1}, hamiltonian: a*P1^2/2, noises: [P1], sigma: [0.5]}
sweep: {a: [1, 2]}
initial: [1, 1, 0]
functions: {scaled: P1/a}
reference: {scaled: "exp(-t)/a"}
final_time: 1
step: 2^-4
schemes: [splitting]
samples: 10
"""


def test_a_parameter_of_a_system_and_formulas_beside_it(spec):
    first, second = spec(STATISTICS).cases
    assert (first.model.a, second.model.a) == (1.0, 2.0) and type(first.model) is type(second.model)
    assert [case.reference["scaled"] for case in (first, second)] == ["exp(-t)/(1)", "exp(-t)/(2)"]
    assert second.functions == {"scaled": "P1/(2)"}
    found = spec(STATISTICS, "sweep: {a:", "sweep: {sigma:", "P1/a", "P1", "exp(-t)/a", "exp(-sigma^2*t)")
    assert [case.reference["scaled"] for case in found.cases] == ["exp(-(1)^2*t)", "exp(-(2)^2*t)"]
    assert [case.model.sigma for case in found.cases] == [(1.0,), (2.0,)]


RING = """\
kind: strong
model:
  algebra: so(3)^n
  sizes: {n: 2}
  variables: "x(i), y(i), z(i) for i = 1..n"
  hamiltonian: "sum(x(i)^2 for i = 1..n)"
  noises: "z(i) for i = 1..n"
  sigma: "1 for i = 1..n"
initial: ["1, 0, 0 for i = 1..n"]
sweep: {n: [2, 3]}
final_time: 1
steps: 2^-2 .. 2^-3
reference_step: 2^-4
schemes: [splitting]
samples: 64
"""


def test_a_size_of_a_system_by_its_name(spec):
    """Each value has states of its own dimension."""
    found = spec(RING)
    assert [(case.name, len(case.initial)) for case in found.cases] == [("n=2", 6), ("n=3", 9)]
