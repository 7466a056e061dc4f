"""Orders of compositions of the user's own, by strong and weak errors, with and without sampling."""

import numpy as np
import pytest
from helpers import INITIAL, LANES, RIGID_BODY, compiled_only, take_steps
from scipy.integrate import solve_ivp
from strong_cases import case_of as strong_case
from strong_cases import study
from weak_cases import FUNCTIONS
from weak_cases import case_of as weak_case

from spi.ensemble.protocol import structure
from spi.exact.expectations import expectations
from spi.schemes import strong_order
from spi.schemes.splitting import splitting
from spi.schemes.stages import compositions, flows

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
