"""Lattices of YAML in a field that depends on time, against plain NumPy that is made from their H."""

import numpy as np
import pytest

from spi import storage
from spi.running.run import run

#: A ring of five spins with couplings, an anisotropy, and a field that turns, by pi/2 from site to site.
SPEC = """\
kind: trajectory
model:
  algebra: so(3)^n
  lattice: true
  sizes: {n: 5}
  parameters: {w: 2, b: 1.3}
  initial_time: 0.7
  variables: "x(i), y(i), z(i) for i = 1..n"
  hamiltonian: >-
    -sum(x(i)*x(mod(i,n)+1) + 0.8*y(i)*y(mod(i,n)+1) + z(i)^2/5 + b*cos(w*t + pi*i/2)*x(i)
    + (b*sin(w*t) + exp(-t))*y(i) + x(i)/3 for i=1..n)
initial: {spins: random}
final_time: 1
step: 2^-4
schemes: [splitting_symmetric]
functions: {b: 1.3*cos(2*t + pi/2), product: t*y1}
panels: [components]
"""
START = 0.7


def slope(t, s):
    """s' = b x s, b = -grad H."""
    phase = np.pi * np.arange(1, 6) / 2
    neighbours = np.roll(s, 1, axis=0) + np.roll(s, -1, axis=0)
    b = neighbours * [1, 0.8, 0] + [1 / 3, 0, 0] + s * [0, 0, 2 / 5]
    b[:, 0] += 1.3 * np.cos(2 * t + phase)
    b[:, 1] += 1.3 * np.sin(2 * t) + np.exp(-t)
    return np.cross(b, s)


def runge_kutta(s, steps=400, start=START):
    h = 1 / steps
    for t in start + h * np.arange(steps):
        a = slope(t, s)
        b = slope(t + h / 2, s + h / 2 * a)
        c = slope(t + h / 2, s + h / 2 * b)
        s = s + h / 6 * (a + 2 * b + 2 * c + slope(t + h, s + h * c))
    return s


def test_states_converge_with_order_2_and_functions_have_their_time(spec, tmp_path):
    errors = []
    for step in ("2^-4", "2^-5"):
        variables = storage.read(run(spec(SPEC, overrides=[f"step={step}"]), tmp_path, fresh=True)).groups[0].variables
        y = variables["y"][1].reshape(-1, 5, 3)
        t = np.linspace(0, 1, len(y))
        errors.append(abs(y[-1] - runge_kutta(y[0])).max())
        b, product = variables["value"][1]
        np.testing.assert_allclose(b, 1.3 * np.cos(2 * (t + START) + np.pi / 2), atol=1e-13)
        np.testing.assert_allclose(product, (t + START) * y[:, 0, 0], rtol=1e-14)
    assert errors[0] < 0.01 and 1.9 < np.log2(errors[0] / errors[1]) < 2.1
    assert abs(runge_kutta(y[0], start=0.0) - y[-1]).max() > 0.1  # the control: another initial time is another path


DRIVEN = "b*cos(w*t + pi*i/2)*x(i)\n    + (b*sin(w*t) + exp(-t))*y(i)"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("0.8*y(i)", "t*y(i)", "hamiltonian: has '-t*y(1)*y(2)', and beside lattice time is a factor of a field alone"),
        ("z(i)^2/5", "t*z(i)^2", "hamiltonian: has '-t*z(1)^2', and beside lattice time is a factor of a field alone"),
        ("x(i)/3", "cos(t - x(i))", "hamiltonian: has '-cos(t - x(1))'; lattice is for sums over pairs of spins"),
        ("exp(-t)", "tan(t)", "hamiltonian: has a field that is '"),
        (DRIVEN, "x(i)", "initial_time: is of no use, nothing depends on the time t"),
        (
            "initial_time: 0.7",
            'noises: ["z(i) for i = 1..n"]\n  sigma: ["t for i = 1..n"]',
            "sigma: depends on time; beside lattice only a field may, leave lattice out",
        ),
        (
            "initial_time: 0.7",
            'noises: ["t*z(i) for i = 1..n"]',
            "noises: depends on time; beside lattice only a field may, leave lattice out",
        ),
    ],
)
def test_what_is_refused(error, old, new, message):
    text = SPEC.replace("functions: {b: 1.3*cos(2*t + pi/2), product: t*y1}\n", "")
    assert message in error(text, old, new)
