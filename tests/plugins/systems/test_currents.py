"""The current of energy of systems whose H is a sum of terms with places."""

from fractions import Fraction

import numpy as np
import pytest

from spi.plugins.systems.currents import energy_current

RING = {
    "algebra": "so(3)^n",
    "sizes": {"n": "8"},
    "variables": "x(i), y(i), z(i) for i = 1..n",
    "parameters": {"Jx": "1", "Jy": "4/5", "Jz": "1/2"},
    "hamiltonian": "-sum(Jx*x(i)*x(mod(i,n)+1) + Jy*y(i)*y(mod(i,n)+1) + Jz*z(i)*z(mod(i,n)+1) + x(i)/3 + z(i)^2/5"
    " for i = 1..n)",
}


def test_currents_of_systems_from_yaml():
    """Of FPUT -(p_i + p_(i+1)) V'(q_(i+1) - q_i) / 2 by bond."""
    chain = {
        "bracket": {"q(i) p(i) for i = 1..n": "1"},
        "sizes": {"n": "6"},
        "variables": ["q(i) for i = 1..n", "p(i) for i = 1..n"],
        "hamiltonian": "sum(p(i)^2/2 + (q(mod(i,n)+1)-q(i))^2/2 + (q(mod(i,n)+1)-q(i))^4/4 for i = 1..n)",
    }
    q, p = np.random.default_rng(2).standard_normal((2, 6))
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
