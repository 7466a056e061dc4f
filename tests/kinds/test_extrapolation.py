"""Richardson extrapolation of weak errors: weights, exponents, and the three estimators."""

from itertools import pairwise

import numpy as np
import pytest
from extrapolation_cases import COARSE, group_of, symmetric
from helpers import INITIAL, ONE_NOISE, RIGID_BODY, SCHEMES
from scipy.linalg import expm
from weak_cases import SPEC, case_of, has_order

from spi.exact.expectations import expectations
from spi.kinds.weak import study as weak
from spi.kinds.weak.results import WeakErrors
from spi.models import RigidBodySharedNoise
from spi.running.run import load
from spi.schemes import SCHEMES as ALL_SCHEMES
from spi.schemes import composed, is_own_reverse, weak_exponents
from spi.schemes.splitting import LIE_TROTTER, ORDER_2, SYMMETRIC
from spi.schemes.stages import compositions, flows
from spi.specs import SpecError
from spi.statistics.claims import CONFIRMED, judge, quantities
from spi.statistics.estimators import Extrapolation, places, weights

CROOKED = (*SYMMETRIC.stages[:2], flows("drift", fraction=1 / 2))


@pytest.mark.parametrize("exponents", [(), (2,), (2, 4), (2, 4, 6), (1, 2, 3), (2, 3, 4), (0.5,)])
def test_weights_solve_the_vandermonde_system(exponents):
    """They add up to 1, and leave none of the powers."""
    n = len(exponents) + 1
    system = np.array([[2.0 ** (i * q) for i in range(n)] for q in (0, *exponents)])
    found = weights(exponents)
    np.testing.assert_allclose(found, np.linalg.solve(system, np.eye(n)[0]), rtol=1e-12, atol=1e-15)
    if exponents == (2,):
        np.testing.assert_allclose(found, [4 / 3, -1 / 3], rtol=1e-15)


def test_steps_that_can_be_extrapolated():
    steps = [1.0, 0.5, 0.25, 0.0625]
    assert places(steps, 0).tolist() == [[0], [1], [2], [3]]
    assert places(steps, 1).tolist() == [[1, 0], [2, 1]]
    assert places(steps, 2).tolist() == [[2, 1, 0]]
    assert places(steps, 3).shape == (0, 4)
    h = np.array(steps)
    values = 7.0 + 3 * h**2 - h**4
    once, twice = (Extrapolation.of(steps, exponents) for exponents in ((2.0,), (2.0, 4.0)))
    assert h[once.chosen].tolist() == [0.5, 0.25]
    np.testing.assert_allclose(once.combined(values), 7 + 4 * h[1:3] ** 4, rtol=1e-14)
    np.testing.assert_allclose(twice.combined(values), 7, rtol=1e-14)
    np.testing.assert_allclose(once.combined_bounds(np.ones(4)), 5 / 3)
    assert np.array_equal(Extrapolation.of(steps, ()).combined(values), values)


def test_exponents_follow_from_the_rows():
    def exponents(row, model=RIGID_BODY):
        return weak_exponents(row, model, 3)

    assert exponents(SCHEMES["splitting_symmetric"]) == exponents(composed("own", SYMMETRIC.stages, 2.0)) == (2, 4, 6)
    assert exponents(SCHEMES["splitting_order2"]) == (2, 3, 4)
    assert exponents(SCHEMES["splitting_order2"], ONE_NOISE) == (2, 4, 6)  # one noise is in the same order reversed
    assert exponents(SCHEMES["splitting"]) == exponents(SCHEMES["euler_maruyama"]) == (1, 2, 3)
    assert exponents(composed("crooked", CROOKED, 1.0)) == (1, 2, 3)
    shared = RigidBodySharedNoise((2.0, 1.0, 2 / 3), (1.0, 2.0, 3.0))
    assert exponents(SCHEMES["splitting_symmetric"], shared) is None  # its flows are not exact
    assert exponents(ALL_SCHEMES["ap_splitting"]) is exponents(composed("own", SYMMETRIC.stages, float("nan"))) is None


@pytest.mark.parametrize("rows", [SYMMETRIC.stages, ORDER_2.stages, LIE_TROTTER.stages, CROOKED])
@pytest.mark.parametrize("model", [RIGID_BODY, ONE_NOISE], ids=["three noises", "one noise"])
def test_what_equals_itself_reversed_is_undone_by_the_step_backwards(rows, model):
    """P(-h) P(h) = 1 with matrices in place of the generators of the flows, and only then."""
    generator = np.random.default_rng(3)
    matrices = {(part, k): generator.standard_normal((4, 4)) for part in ("drift", "noise") for k in range(3)}

    def step(h):
        found = np.zeros((4, 4))
        for probability, word in compositions(rows, model):
            product = np.eye(4)
            for part, k, share in word:
                product = product @ expm(share * h * matrices[part, k])
            found += probability * product
        return found

    undone = np.abs(step(-0.3) @ step(0.3) - np.eye(4)).max() < 1e-12
    assert undone == is_own_reverse(rows, model)


#: The errors that the issue of this key gives, from a program of its own: levels -> step size -> error.
TABLE = {
    0: {2**-1: 2.3e-2, 2**-2: 6.1e-3, 2**-3: 1.6e-3, 2**-4: 3.9e-4, 2**-5: 9.8e-5},
    1: {2**-2: 5.5e-4, 2**-3: 3.6e-5, 2**-4: 2.3e-6, 2**-5: 1.5e-7},
    2: {2**-3: 2.2e-6, 2**-4: 3.6e-8, 2**-5: 5.7e-10},
    3: {2**-4: 1.2e-9, 2**-5: 4.5e-12},
}


def test_orders_4_6_and_8_without_sampling():
    case = symmetric("functions=sin(2*pi*y1)", "steps=2^0 .. 2^-5", "reference_step=2^-6", "extrapolate=[0, 1, 2, 3]",
                     "estimators=[kolmogorov]", "accuracy=1e-9")  # fmt: skip
    parts = weak.parts(case)
    assert [part.extrapolate for part in parts] == [0, 1, 2, 3]
    assert [part.variant for part in parts] == ["splitting_symmetric"] + [
        f"splitting_symmetric_extrapolated_{levels}" for levels in (1, 2, 3)
    ]
    plain, *_ = groups = [group_of(case, "kolmogorov", levels) for levels in range(4)]
    for levels, group in enumerate(groups):
        found, h, order = group.arrays, group.coordinates["h"].tolist(), 2 * (levels + 1)
        assert h == list(case.steps[levels:]) and found["resolved"].all()
        assert group.attributes["expected_order"] == order
        assert abs(found["order"][0] - order) < 0.05
        assert found["order_high"][0] - found["order_low"][0] < 0.15
        assert has_order(found, order) or levels == 3  # whose interval from three points is too narrow by 0.02
        for step, error in TABLE[levels].items():
            assert found["error"][0, h.index(step)] == pytest.approx(error, rel=0.05)
        largest = np.abs(weights((2, 4, 6)[:levels])).sum() * plain.arrays["error_bound"].max()
        assert np.all(found["error_bound"] <= largest * 1.000001)
    tell = [WeakErrors.of(group) for group in groups]
    expect = "expect={splitting_symmetric: {extrapolate 0: {order: 2 +- 0.05}, extrapolate 1: {order: 4 +- 0.05}}}"
    claimed = symmetric("functions=sin(2*pi*y1)", *COARSE, "extrapolate=[0, 1]", "estimators=[kolmogorov]", expect)
    verdicts = judge(claimed.claims, quantities(tell))
    assert [one.verdict for one in verdicts] == [CONFIRMED, CONFIRMED] and verdicts[1].found.about.extrapolate == 1
    swapped = [one._replace(scopes=other.scopes) for one, other in pairwise([*claimed.claims, claimed.claims[0]])]
    assert CONFIRMED not in [one.verdict for one in judge(swapped, quantities(tell))]


def test_a_scheme_that_is_not_symmetric_gains_one_order_at_a_time():
    """The scheme of order 2 feels its coins where the noise is strong; weights of even powers do not help it."""
    model, steps = RIGID_BODY._replace(noise_inertia=(2.0, 4.0, 6.0)), [2.0**-k for k in range(2, 7)]
    word = compositions(ORDER_2.stages, model)
    found = expectations(model, word, INITIAL, 1.0, steps, [lambda y: y[0] ** 2], accuracy=1e-9)

    def order(exponents):
        error = np.abs(Extrapolation.of(steps, exponents).combined(found.weak_error[0]))
        return np.log2(error[-2] / error[-1])

    known = weak_exponents(SCHEMES["splitting_order2"], model, 2)
    assert order(known) == pytest.approx(4, abs=0.1)
    assert order((2, 4)) == pytest.approx(3, abs=0.1)  # negative control


def test_means_of_casimirs_stay_exact():
    """The weights add up to 1."""
    case = symmetric("functions=y1^2 + y2^2 + y3^2", "steps=2^0 .. 2^-3", "extrapolate=3", "estimators=[kolmogorov]")
    found = group_of(case, "kolmogorov", 3).arrays
    np.testing.assert_allclose(found["expectation"], sum(x * x for x in case.initial), rtol=1e-13)


def test_without_the_key_a_spec_is_what_it_was():
    plain, zero, twice = (load(SPEC, overrides=keys) for keys in ([], ["extrapolate=0"], ["extrapolate=2"]))
    assert plain.hash == zero.hash != twice.hash
    assert "extrapolate" not in plain.effective["cases"]["main"]


def test_a_layer_with_fewer_levels_drops_the_claims_about_the_others():
    keys = ["extrapolate=[0, 1]", "schemes=[splitting_order2]"]
    expect = "expect={splitting_order2: {extrapolate 0: {order: 2}, extrapolate 1: {order: 3}}}"
    assert [claim.scopes for claim in case_of(*keys, expect).claims] == [("extrapolate 0",), ("extrapolate 1",)]
    assert [claim.scopes for claim in case_of(*keys, expect, "extrapolate=1").claims] == [("extrapolate 1",)]
    with pytest.raises(SpecError, match="extrapolate 2: is not a known quantity"):
        case_of(*keys, "expect={splitting_order2: {extrapolate 2: {order: 4}}}")
