"""The headline of results: the quantities that a record names, each with its interval, in one line for every kind."""

import numpy as np
import pytest
from filled_results import filled
from strong_results import strong, strong_group
from trajectory_results import trajectories, trajectory_group
from weak_results import at_eps, weak, weak_group

from spi import storage
from spi.kinds import KINDS
from spi.plugins.report.views.sections import section, typeset
from spi.printing import sweeps
from spi.statistics.claims import Quantity
from spi.statistics.curves import Curve
from spi.storage import Order
from spi.storage.stored import Description

NAN = float("nan")


@pytest.fixture
def headline(tmp_path):
    """headline(results) -> that of their only case, as a report has it."""

    def of(results):
        storage.write(path := tmp_path / "results.h5", results)
        ((title, text),) = section(path, storage.read(path), "e1").answers
        assert not title and text[0].isupper() and text.endswith(".") and "\n" not in text
        return text

    return of


@pytest.mark.parametrize("kind", KINDS)
def test_a_spec_may_expect_what_a_record_names(kind):
    names = KINDS[kind].results.Record.headline
    assert names and KINDS[kind].keys.Case.quantities.keys() >= set(names)


def test_orders_and_the_error_at_the_smallest_step(headline):
    group, lost = strong_group("splitting"), strong_group("midpoint", order=Order(NAN, NAN, NAN, 0))
    text = headline(strong(group, lost))
    assert text.startswith("Order: 0.500 [0.480, 0.520] (theory 1/2) with splitting, noise first (slpI); not resolved ")
    assert f". Error at h = 2^{round(np.log2(group.coordinates['h'].min()))}: " in text and text.count(" ± ") == 2
    assert headline(strong(lost)).startswith("Order: not resolved (theory 1/2) with ")


def test_of_weak_errors_those_of_each_estimator_and_eps_with_the_first_function(headline):
    both = headline(weak(weak_group("splitting", "multilevel"), weak_group("splitting", "kolmogorov")))
    assert both.count("multilevel") == both.count("kolmogorov") == 3 and both.count(" of ") == 3
    assert headline(weak(at_eps("ap_splitting", 0.1), at_eps("ap_splitting", 0.01))).count("eps = 0.01") == 3


def test_what_is_exact_or_lost_has_no_interval(headline):
    y, kept = np.linspace([-0.5, 1.0], [0.5, 2.0], 5), np.ones((5, 1))
    lost = np.where(np.arange(5)[:, None] >= 3, NAN, kept)
    paths = [("splitting", kept), ("midpoint", lost)]
    groups = [trajectory_group(name, np.linspace(0.0, 1.0, 5), y, c, scheme_label=name) for name, c in paths]
    assert headline(trajectories(*groups)).startswith(
        "Casimir drift: 0 with splitting; inf with midpoint. Hamiltonian drift: "
    )


def test_drifts_of_a_path_that_diverged_are_those_until_then(headline):
    t, kept = np.linspace(0.0, 1.0, 5), np.array([[1.0], [1.5], [NAN], [9.0], [NAN]])
    y = np.where(np.arange(5)[:, None] >= 3, NAN, np.linspace([-0.5, 1.0], [0.5, 2.0], 5))
    lost = trajectory_group("midpoint", t, y, kept, scheme_label="midpoint")
    whole = trajectory_group("splitting", t, np.ones((5, 2)), np.ones((5, 1)), scheme_label="splitting")
    assert headline(trajectories(whole, lost)) == (
        "Casimir drift: 0 with splitting; 0.5 until it diverged at t = 0.75 with midpoint. "
        "Hamiltonian drift: 0 with splitting; 0.25 until it diverged at t = 0.75 with midpoint."
    )


def test_each_kind_defines_what_it_measures():
    for name, kind in KINDS.items():
        shown = typeset(kind.results.Record.measures)
        assert shown.endswith(".") and "$" not in shown and "\\" not in shown, name
    assert "<math" in typeset("a $x^2$") and "<code>\\frac{</code>" in typeset(r"$\frac{$ costs \$")


def test_where_a_curve_is_zero_its_parameter_is_named():
    about = Description.of(strong_group("splitting"))
    numbers = {1.0: 3.0, 4.0: -3.0, 9.0: -8.0}
    points = tuple(
        Quantity("largest_exponent", about, value, value - 0.5, value + 0.5, swept=("beta", at))
        for at, value in numbers.items()
    )
    assert ", zero at beta = 2.50 ± 0.18 on a line between values" in sweeps.headline(
        [Curve("largest_exponent", "", about, points)]
    )
    never = [point._replace(value=abs(point.value), low=0.1, high=9.0) for point in points]
    assert "zero" not in sweeps.headline([Curve("largest_exponent", "", about, tuple(never))])


@pytest.mark.needs("dynamics")
def test_the_largest_step_size_for_an_accuracy(headline):
    """The smallest of all functions: the bias of H is 0.1 h^2, and that of the other is below it at h = 1/4."""
    from long_results import equilibrium, equilibrium_group

    held = equilibrium_group("splitting", accuracy=1e-3)
    assert headline(equilibrium(held)) == "Largest h for means to 0.001: 0.10 with splitting (H: by the fitted bias)."
    held = equilibrium_group("splitting", accuracy=1e-2)
    assert ": 0.25 with splitting (square: no bias is seen there)." in headline(equilibrium(held))


def test_an_answer_names_the_expectation_and_its_time():
    asked = {"functions": ("phi",), "formulas": ("y1^2",), "value": np.array([0.16]), "half": np.array([1e-3])}
    asked |= {"bias": np.array([1e-4]), "stderr": np.array([4e-4]), "chosen": None, "compared": None}
    group = filled("answer", **asked)
    group.attributes["final_time"] = 2.0
    one = KINDS["answer"].results.Record.of(group)
    assert list(one.answers([one])) == ["E y1^2 at t = 2 is 0.1600 ± 0.0010 (95 %)."]
    assert one.titled("Weak errors (answer)", [one]) == "E y1^2 at t = 2" and one.titled("My own", [one]) == "My own"
    group.arrays["half"][:] = NAN
    lost = KINDS["answer"].results.Record.of(group)
    assert list(lost.answers([lost])) == ["E y1^2 at t = 2 is 0.16, not resolved."]


@pytest.mark.needs("dynamics")
def test_of_long_times(headline):
    from long_results import growth, growth_group

    assert headline(growth(growth_group("splitting"))).startswith("Casimir worst at h = ")


@pytest.mark.needs("comparisons")
def test_of_comparisons(headline):
    """Over a parameter from its first value to its last."""
    from stability_results import stability, stability_group
    from work_results import work_results

    text = headline(stability(stability_group("splitting")))
    assert text.startswith("Largest accurate h (error <= 0.1 |y_0|) from sigma = 0.1 to sigma = 30: ")
    text = headline(work_results(cases=("one",), schemes=("euler_maruyama", "splitting")))
    assert text.startswith("An error of 0.1 costs least with splitting: ") and ", h = 2^" in text
