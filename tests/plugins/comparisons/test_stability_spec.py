"""The word that a stability study sweeps: specs, what describes their results, and mistakes in them."""

import math

import pytest
from stability_cases import EPS, RIGID, plans_of

from spi.specs import SpecError
from spi.storage.stored import Description


def test_what_differs_from_value_to_value_is_not_described(spec):
    """A swept eps is no eps of the scheme; one that is the same for all values is."""
    swept = plans_of(spec(EPS).cases, "ap_splitting")
    about = Description.common([plan.description() for plan in swept])
    assert about.eps is None and about.parameters["sigma"] == (1.0, 1.0, 0.5)
    assert (about.case, about.variant, about.swept) == ("main", "ap_splitting", None)
    assert [plan.scheme.eps for plan in swept] == [0.0, 0.6]
    fixed = spec(RIGID, overrides=["schemes=[ap_splitting, splitting]", "eps=0.6"]).cases
    each = [[plan.description() for plan in plans_of(fixed, scheme)] for scheme in fixed[0].schemes]
    told = [*map(Description.common, each)]
    assert [one.eps for one in told] == [0.6, None] and not any("sigma" in one.parameters for one in told)
    assert [one.scheme_label for one in told] == ["AP splitting", "splitting"]


WORD, SIGMA, START = "{s: [0.5, 2]}", "[s, s, s/2]", "[cos(1.1), 0, sin(1.1)]"


def test_overrides_and_profiles_replace_the_word_or_its_values(spec):
    assert spec(RIGID, overrides=["sweep.s=[3]"]).cases[0].sweep.parameters == {"s": (3.0,)}
    (case,) = spec(RIGID, overrides=["sweep={t: [3]}", "model.sigma=[t, 1, 2*t]"]).cases
    assert (case.sweep.places, case.model.sigma) == ({"t": 3.0}, (3.0, 1.0, 6.0))
    quick = spec(RIGID + "profiles:\n  quick: {sweep: {s: [7]}}\n", profile="quick").cases
    assert [c.model.sigma[0] for c in quick] == [7.0]
    with pytest.raises(SpecError, match=r"^s\.yaml: --set sweep: the parameter 't' is not used; .*"):
        spec(RIGID, overrides=["sweep={t: [3]}", "model.sigma=[1, 1, 1]"])


def test_the_word_stands_for_its_values(spec):
    first, second = spec(RIGID, WORD, "{s: [-1, 0.25]}", SIGMA, "[2*s^2, abs(s), 0]", START, "[s, -s, s^2]").cases
    assert (first.model.sigma, first.initial) == ((2.0, 1.0, None), (-1.0, 1.0, 1.0))
    assert (second.model.sigma, second.initial) == ((0.125, 0.25, None), (0.25, -0.25, 0.0625))
    assert first.model.inertia == second.model.inertia == (2.0, 1.0, 2 / 3)
    assert [c.eps for c in spec(EPS).cases] == [(0.0,), (0.6,)]
    assert [c.eps for c in spec(EPS, "eps: s", "eps: [2*s+1]").cases] == [(1.0,), (2.2,)]


def test_the_word_is_no_part_of_other_words_or_numbers(spec):
    """`e` is neither the e of 1e-3 nor that of exp."""
    case = spec(RIGID, WORD, "{e: [0.5]}", SIGMA, "[2*e, 1e-3*exp(e), 1.e-3]").cases[0]
    assert case.model.sigma == (1.0, 1e-3 * math.exp(0.5), 1e-3)
    case = spec(RIGID, WORD, "{s_1: [0.5]}", SIGMA, "[s_1, sin(s_1), 1]", START, "[s_1*s_1, 0, 1]").cases[0]
    assert case.model.sigma == (0.5, math.sin(0.5), 1.0)
    assert case.initial == (0.25, 0.0, 1.0)


def test_the_hash_is_that_of_what_decides_results(spec):
    base = spec(RIGID).hash
    assert spec(RIGID, "A title", "Another title").hash == base
    assert spec(RIGID, WORD, "{s: [1/2, 2e0]}").hash == base
    others = [
        spec(RIGID, WORD, "{s: [0.5, 3]}").hash,
        spec(RIGID, WORD, "{s: [2, 0.5]}").hash,
        spec(RIGID, WORD, "{s: [0.5]}").hash,
        spec(RIGID, SIGMA, "[s, s, s]").hash,
        spec(RIGID, START, "[cos(1.1), s, sin(1.1)]").hash,
        spec(EPS).hash,
        spec(EPS, "[0, 0.6]", "[0, 0.5]").hash,
    ]
    assert len({base, *others}) == 1 + len(others)
