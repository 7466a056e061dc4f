"""The accuracy of the motions of systems written in YAML, against mpmath, and of Casimir functions over many steps."""

import math

import mpmath
import numpy as np
import pytest
from helpers import COMPILED, LANES, SCHEMES, take_steps
from yaml_cases import SYSTEMS, given, made

from spi.compiler.inlining import uncompiled
from spi.ensemble.protocol import casimirs, noise_flow
from spi.numerics.angles import ANY_ANGLES
from spi.numerics.elementary import expm1, sinh_coshm1
from spi.plugins.systems.numerics.motions import times

mpmath.mp.dps = 50  # of this file


def units(found, exact):
    """The distance in units of the last place of the exact value."""
    return abs(mpmath.mpf(float(found)) - exact) / mpmath.mpf(math.ulp(float(abs(exact))))


#: Both signs of arguments from the smallest to the largest for which the exponential is finite.
ARGUMENTS = [
    sign * x
    for generator in [np.random.default_rng(7)]
    for sign in (1.0, -1.0)
    for x in [
        *(2.0**-e for e in (1000, 60, 54, 53, 30, 10, 5, 2, 1)),
        *generator.uniform(0.0, 1.0, 150),
        *generator.uniform(0.0, 40.0, 100),
        *np.exp(generator.uniform(-30.0, 6.5, 150)),
    ]
]


def test_expm1():
    with uncompiled(), mpmath.workdps(400):
        assert max(units(expm1(float(x)), mpmath.expm1(mpmath.mpf(float(x)))) for x in ARGUMENTS) < 2.0
        assert expm1(0.0) == 0.0 and math.isnan(expm1(math.nan))


def test_sinh_coshm1():
    with uncompiled(), mpmath.workdps(700):
        for x in map(float, ARGUMENTS):
            s, v = sinh_coshm1(x)
            exact = mpmath.mpf(x)
            assert units(s, mpmath.sinh(exact)) < 2.5, x
            if abs(x) > 1e-150:  # below it cosh x - 1 is no normal number
                assert units(v, 2 * mpmath.sinh(exact / 2) ** 2) < 4.0, x


def test_products_with_numbers_of_two_parts():
    """c x is right to a unit in the last place, and the rest matters: the error of c would show."""
    with uncompiled():
        c = mpmath.sqrt(3)
        high = float(c)
        rest = float(c - high)
        worst = max(
            units(times(high, rest, x), c * x) for x in np.random.default_rng(3).uniform(1.0, 2.0, 300).tolist()
        )
        assert worst <= 1.0
        assert max(float(abs(high * mpmath.mpf(x) - c * x) / x) for x in (1.0, 1.5)) > 1e-17


BOOSTS = given(3, {(1, 2, 3): 1, (2, 3, 1): -1, (3, 1, 2): -1})  # {y1, y2} = y3, {y2, y3} = -y1, {y3, y1} = -y2
Y = (0.3, -0.7, 1.1)


def exact_motion(functional, t):
    """exp(t M) y to 50 digits, for the M of the field of a linear function."""
    M = mpmath.matrix(3)
    for i, j, k in zip(*np.nonzero(BOOSTS), strict=True):
        M[i, k] += int(BOOSTS[i, j, k]) * functional[j]
    with mpmath.workdps(80):
        return mpmath.expm(t * M, method="taylor") * mpmath.matrix(Y)


def relative_error(name, functional, t):
    system = made(f"{{algebra: 'so(2,1)', hamiltonian: y1^2, noises: ['{name}']}}")
    exact = exact_motion([mpmath.mpf(c) for c in functional], t)
    with uncompiled():
        found = noise_flow(system.record, 0, t, Y, ANY_ANGLES)
    return float(mpmath.norm(mpmath.matrix(found) - exact) / mpmath.norm(exact))


ROOT2 = mpmath.sqrt(2)
NEARLY = 1 + mpmath.mpf("1e-6"), 1 - mpmath.mpf("1e-6"), 1 - mpmath.mpf("1e-11")


HYPERBOLIC = ("2*y1 + y2/3 + y3", (2, mpmath.mpf(1) / 3, 1))
ELLIPTIC = ("y1 + y2/3 + 2*y3", (1, mpmath.mpf(1) / 3, 2))


@pytest.mark.parametrize(
    ("motion", "times", "tolerance"),
    [
        # the third power of the matrix vanishes; were it multiplied by t^3, its roundings would be 1e-10 at t = 10^6
        (("y1 + y3", (1, 0, 1)), (1e-9, 1.0, 1e3, 1e6), 1e-15),
        (("3*y1 + 4*y2 + 5*y3", (3, 4, 5)), (1e-9, 1.0, 1e3, 1e6), 1e-15),
        (("y1 + y2 + sqrt(2)*y3", (1, 1, ROOT2)), (1e-9, 1.0, 1e3, 1e6), 1e-15),
        # the eigenvalues nearly agree, so that projectors onto eigenspaces would cancel to half of the digits
        (("y1 + (1+1e-6)*y3", (1, 0, NEARLY[0])), (1e-9, 0.1, 30.0, 1e3), 1e-14),
        (("y1 + (1-1e-6)*y3", (1, 0, NEARLY[1])), (1e-9, 0.1, 30.0, 1e3), 1e-14),
        (("y1 + (1-1e-11)*y3", (1, 0, NEARLY[2])), (1e-9, 0.1, 30.0, 1e3), 1e-14),
        (("y1 + y2 + (1+1e-6)*sqrt(2)*y3", (1, 1, ROOT2 * NEARLY[0])), (1e-9, 0.1, 30.0, 1e3), 1e-14),
        (HYPERBOLIC, (1e-9, 1.0, 30.0, 200.0), 1e-14),
        # as the angle is rounded: by half a unit of its last place
        (ELLIPTIC, (1.0,), 1e-15),
        (ELLIPTIC, (1e3,), 2e-13),
        (ELLIPTIC, (1e6,), 2e-10),
    ],
)
def test_motions_by_the_field_of_a_linear_function(motion, times, tolerance):
    assert max(relative_error(*motion, t) for t in times) < tolerance


SPLITTING = SCHEMES["splitting"].record
STEPS, H = 100_000, 1e-3

#: A tilted rotation, hyperbolic rotations by small angles, and the heavy top.
#: More noise would drive the second to infinity.
LONG = {
    "tilted rotation": (
        "{algebra: so(3), hamiltonian: '(y1 + y2/3 + sqrt(2)*y3)^2', noises: [y1 - y3/7]}",
        (1, 0.3, -0.6),
    ),
    "hyperbolic": ("{algebra: 'so(2,1)', hamiltonian: y1^2/2 + y3^2, noises: [y3/1000]}", (0.3, 0.2, 0.9)),
    "heavy top": (SYSTEMS["heavy top"][0], (1.0, 0.5, 0.3, 0.6, 0.1, 0.8)),
}


def changes(record, y0, generator):
    """Of each Casimir function and lane, the change over all steps in units of rounding errors of the largest term."""
    y = np.array(y0)[:, np.newaxis] * np.linspace(0.9, 1.1, LANES)
    before = np.array(casimirs(record, tuple(y)))
    for _ in range(10):
        dW = math.sqrt(H) * generator.standard_normal((STEPS // 10, type(record).noises, LANES))
        y, _ = take_steps(SPLITTING, record, H, dW, y)
    size = np.array(casimirs(record, tuple(np.abs(y))))
    return (np.array(casimirs(record, tuple(y))) - before) / (2.0**-53 * size)


@pytest.mark.share(1)
@pytest.mark.skipif(not COMPILED, reason="too many steps without the compiler")
@pytest.mark.parametrize("name", LONG)
def test_casimir_functions_only_walk(name):
    """A walk of the roundings of so many steps; a drift would be larger by their square root, 300."""
    text, y0 = LONG[name]
    found = changes(made(text).record, y0, np.random.default_rng(11))
    walk = math.sqrt(STEPS)
    assert np.all(np.abs(found.mean(axis=1)) < 3.0 * walk), found.mean(axis=1) / walk
    assert np.all(np.abs(found) < 12.0 * walk), np.abs(found).max() / walk
