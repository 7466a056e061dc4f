"""Orders of compositions of the user's own, by strong and weak errors, with and without sampling."""

import numpy as np
import pytest
from helpers import INITIAL, LANES, RIGID_BODY, compiled_only, final_states, take_steps
from scipy.integrate import solve_ivp
from strong_cases import case_of as strong_case
from strong_cases import study
from weak_cases import FUNCTIONS, has_order, results_of
from weak_cases import case_of as weak_case

from spi.ensemble.protocol import structure
from spi.exact.kolmogorov import expectations
from spi.schemes.splitting import has_antithetic_path, splitting
from spi.schemes.stages import compositions, flows
from spi.schemes.theory import strong_order

HALVES = "compositions={halves: [noise 1/2, drift 1, noise 1/2 backwards]}"  # whose kernel other tests need as well
PALINDROME = "[drift 1/2, noise 1 symmetric, drift 1/2 backwards]"
CROOKED = "[drift 1/2, noise 1 symmetric, drift 1/2]"  # negative control: its drift is not symmetric


@compiled_only
@pytest.mark.parametrize(("sigma", "order", "other"), [((1.0, 0.0, 0.0), 1.0, 0.5), ((1.0, 1.0, 1.0), 0.5, 1.0)])
def test_strong_orders_of_noise_in_halves(sigma, order, other):
    """1 with one noise and 1/2 with three, as for the splitting scheme, whose reference it shares in the limit.

    Strengths 0 rather than None, so that one compiled kernel serves both; theory is asked with None.
    """
    own = [HALVES, "schemes=[halves]", f"model.sigma={list(sigma)}"]
    case = strong_case(*own, "steps=2^-4 .. 2^-9", "reference_step=2^-13", "truncate_noise=false", "samples=512")
    assert strong_order(case.row("halves"), case.model, case.initial, case.noise) == order
    case = case.model_copy(update={"model": case.model._replace(sigma=sigma)})
    found, _ = study(case, "halves")
    low, high = found["order_low"], found["order_high"]
    assert low <= order <= high and high - low < 0.15
    assert not low <= other <= high
    assert found["casimir_drift"].max() < 1e-12


@pytest.mark.slow
@compiled_only
def test_all_schemes_are_on_one_path():
    """With the splitting scheme as the reference errors still tend to 0, which they do not on another path."""
    own = [HALVES, "schemes=[halves]", "model.sigma=[1, 0, 0]"]
    steps = ["steps=2^-4 .. 2^-9", "reference_step=2^-13", "truncate_noise=false", "samples=256"]
    found, _ = study(strong_case(*own, *steps, "reference_scheme=splitting"), "halves")
    low, high = found["order_low"], found["order_high"]
    assert 0.8 < low <= high < 1.2


def without_sampling(rows, **options):
    """The weak errors of sin(2 pi y_k) in sum and of y1^2 at 2^-2, ..., 2^-7, and their numerical errors."""
    case = weak_case(f"compositions={{own: {rows}}}", "schemes=[own]", "steps=2^-2 .. 2^-7", "reference_step=2^-8")
    words = compositions(case.row("own").composition, case.model)
    return expectations(case.model, words, case.initial, 1.0, case.steps, list(FUNCTIONS.values()), **options)


@pytest.mark.slow
def test_weak_orders_without_sampling():
    palindrome, crooked = (without_sampling(rows) for rows in (PALINDROME, CROOKED))
    for found, expected in ((palindrome, 4), (crooked, 2)):
        assert np.all(np.abs(found.weak_error) > 20 * found.weak_error_bound)
        ratio = found.weak_error[:, :-1] / found.weak_error[:, 1:]
        np.testing.assert_allclose(ratio[:, -1], expected, rtol=0.02)
    assert np.all(np.abs(palindrome.limit - crooked.limit) <= palindrome.limit_bound + crooked.limit_bound)
    # The expansion of the palindrome is even: extrapolated once it has order 4, where other schemes would have 3.
    once = (4 * palindrome.weak_error[:, 1:] - palindrome.weak_error[:, :-1]) / 3
    np.testing.assert_allclose(once[:, 1] / once[:, 2], 16, rtol=0.1)


@pytest.mark.slow
@compiled_only
def test_sampling_agrees_with_expectations_without_sampling():
    """The independent halves of the kernel are those of the backward operators."""
    rows = (flows("drift", fraction=0.5), flows("noise", "symmetric"), flows("drift", "backwards", 0.5))
    others = {
        "whole": (rows[0], flows("noise"), rows[2]),
        "crooked": (rows[0], rows[1], flows("drift", fraction=0.5)),
    }
    h, functions = 0.5, list(FUNCTIONS.values())
    y = final_states(splitting(*rows), h=h, steps=2, blocks=2**14)[0]
    values = np.array([phi(y) for phi in functions])
    mean, stderr = values.mean(axis=1), values.std(axis=1, ddof=1) / np.sqrt(values.shape[1])

    def off(rows):
        found = expectations(RIGID_BODY, compositions(rows, RIGID_BODY), INITIAL, 1.0, [h], functions, accuracy=1e-5)
        return np.abs(mean - found.value[:, 0]) / np.hypot(stderr, found.value_bound[:, 0])

    assert off(rows).max() < 4.5
    assert min(off(other).max() for other in others.values()) > 10  # negative controls


@pytest.mark.slow
@compiled_only
def test_a_palindrome_has_antithetic_paths():
    """The variance of a level falls like h^2, and its errors have order 2 and are those found without sampling."""
    own = [f"compositions={{own: {PALINDROME}, crooked: {CROOKED}}}", "schemes=[own, crooked]"]
    case = weak_case(*own, "steps=2^-1 .. 2^-4", "reference_step=2^-6", "seconds=2", "functions=y1^2")
    found, attributes = results_of(case, "own", "multilevel")
    assert attributes["antithetic"] and not has_antithetic_path(case.row("crooked").record)
    assert np.all(np.abs(found["level_variance_rate"] - 2) < 0.4)
    assert has_order(found, 2) and not has_order(found, 1)
    exact = expectations(
        case.model, compositions(case.row("own").composition, case.model), INITIAL, 1.0,
        [*case.steps, case.reference_step], [FUNCTIONS["square"]], accuracy=1e-5,
    )  # fmt: skip
    differences = exact.value[:, :-1] - exact.value[:, -1:]
    found_differences = found["error"] * (1 - (case.reference_step / np.array(case.steps)) ** 2)
    assert np.all(np.abs(found_differences - differences) < 4.5 * np.hypot(found["error_stderr"], 2e-5))


@pytest.mark.share(3)
@pytest.mark.parametrize(
    ("rows", "order"),
    [
        ("[noise 1, drift 1]", 1),
        (PALINDROME, 2),
        (CROOKED, 1),
        ("[noise 1/2, drift 1, noise 1/2 backwards]", 1),
        ("[noise 1/2, drift 1 symmetric, noise 1/2 backwards]", 2),
        ("[drift 1/2 symmetric, noise 1 coin, drift 1/2 symmetric]", 2),
        ("[drift 1/2 symmetric, noise 1, drift 1/2 symmetric]", 1),
        ("[drift 1/2, noise 1 coin, drift 1/2 backwards]", 2),
        ("[drift 5/4 symmetric, noise 1 symmetric, drift -1/4 symmetric]", 1),
    ],
)
def test_weak_orders_that_theory_states(rows, order):
    """By the coefficients of products; and by errors without sampling."""
    case = weak_case(f"compositions={{own: {rows}}}", "schemes=[own]", "steps=[2^-5, 2^-6]", "reference_step=2^-8")
    assert case.row("own").weak_order == order
    words = compositions(case.row("own").composition, case.model)
    found = expectations(case.model, words, case.initial, 1.0, case.steps, [FUNCTIONS["square"]], accuracy=1e-8)
    assert abs(np.log2(found.weak_error[0, 0] / found.weak_error[0, 1]) - order) < 0.1


def test_theory_is_silent_without_noise():
    own = ["compositions={own: [noise 1, drift 1]}", "schemes=[own]"]
    assert np.isnan(weak_case(*own, "model.sigma=[0, 0, 0]").row("own").weak_order)
    assert weak_case(*own, "model.sigma=[0, 0, 1]").row("own").weak_order == 1


FIRST = 1 / (2 - 2 ** (1 / 3))
STRANG = splitting(flows("drift", "symmetric"), flows("noise"))
TRIPLE_JUMP = splitting(
    flows("drift", "symmetric", FIRST),
    flows("drift", "symmetric", 1 - 2 * FIRST),
    flows("drift", "symmetric", FIRST),
    flows("noise"),
)


@pytest.mark.parametrize(("scheme", "order"), [(STRANG, 2), (TRIPLE_JUMP, 4)], ids=["strang", "triple jump"])
def test_the_triple_jump_has_order_4_without_noise(scheme, order):
    model = RIGID_BODY._replace(sigma=(None, None, None))

    def field(t, y):
        return structure(model, tuple(y), tuple(y / np.array(model.inertia)))

    exact = solve_ivp(field, (0.0, 1.0), INITIAL, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    begin = np.repeat(np.reshape(INITIAL, (3, 1)), LANES, axis=1)
    ends = [take_steps(scheme, model, 1 / n, np.zeros((n, 3, LANES)), begin)[0][:, 0] for n in (8, 16, 32)]
    errors = [np.linalg.norm(end - exact) for end in ends]
    np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), order, atol=0.1)
