"""The headline of results: the quantities that a record names, each with its interval, in one line for every kind."""

import numpy as np
import pytest
from equilibrium_results import equilibrium, equilibrium_group
from stability_results import stability, stability_group
from strong_results import strong, strong_group
from trajectory_results import trajectories, trajectory_group
from weak_results import at_eps, weak, weak_group
from work_results import work_results

from spi import storage
from spi.kinds import KINDS
from spi.report.sections import section
from spi.storage.records import Order

NAN = float("nan")


@pytest.fixture
def headline(tmp_path):
    """headline(results) -> that of their only case, as a report has it."""

    def of(results):
        storage.write(path := tmp_path / "results.h5", results)
        ((title, text),) = section(path, storage.read(path), "e1").headlines
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
    assert text.startswith("Order: 0.500 [0.480, 0.520] with splitting, noise first (slpI); not resolved with ")
    assert f". Error at h = 2^{round(np.log2(group.coordinates['h'].min()))}: " in text and text.count(" ± ") == 2
    assert headline(strong(lost)).startswith("Order: not resolved with ")


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


def test_other_kinds(headline):
    """Over a parameter from its first value to its last."""
    text = headline(stability(stability_group("splitting")))
    assert text.startswith("Error at h = 2^") and " at sigma = " in text and " to " in text
    assert headline(equilibrium(equilibrium_group("splitting"))).startswith("Casimir worst at h = ")
    text = headline(work_results(cases=("one",), schemes=("euler_maruyama", "splitting")))
    assert text.startswith("Order: ") and ". Error at h = 2^" in text
