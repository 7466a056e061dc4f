"""What came out of an experiment, in one sentence for each kind."""

import numpy as np
from equilibrium_results import equilibrium, equilibrium_group
from stability_results import stability, stability_group
from strong_results import strong, strong_group
from trajectory_results import trajectories, trajectory_group
from weak_results import at_eps, weak, weak_group
from work_results import work_group, work_results

from spi.kinds import KINDS
from spi.report import views
from spi.storage.records import Order
from spi.storage.stored import by_case

NAN = float("nan")


def told(results):
    cases = by_case(views.readings(results))
    (sentence,) = [KINDS[results.attributes["kind"]].table.told(case) for case in cases]
    assert sentence[0].isupper() and sentence.endswith(".") and "\n" not in sentence
    return sentence


def test_strong():
    groups = [strong_group(scheme, scheme_label=scheme) for scheme in ("euler_maruyama", "splitting")]
    unresolved = strong_group("midpoint", order=Order(NAN, NAN, NAN, 0))
    assert told(strong(*groups, unresolved)) == (
        "The strong order is 0.500 [0.480, 0.520] for euler_maruyama and 0.500 [0.480, 0.520] for splitting "
        "(all expected 1/2); it is not resolved everywhere for midpoint; "
        "the Casimir functions stay within 8.0e-16 with euler_maruyama, splitting and midpoint."
    )
    groups[0].attributes.update(expected_order=1.0)
    assert "for euler_maruyama (expected 1) and 0.500 [0.480, 0.520] for splitting (expected 1/2);" in told(
        strong(*groups)
    )
    assert told(strong(unresolved)).startswith("No strong order is resolved; the Casimir")


def path(scheme, y, casimirs, panels=("populations",)):
    return trajectory_group(scheme, np.linspace(0.0, 1.0, 5), y, casimirs, panels=panels, scheme_label=scheme)


def test_trajectory():
    y, whole = np.linspace([-0.5, 1.0], [0.5, 2.0], 5), np.ones((5, 1))
    lost = np.where(np.arange(5)[:, None] >= 3, np.nan, y + 1)
    moved = np.linspace([1.0], [1.5], 5)
    groups = path("euler_maruyama", y, moved), path("splitting", y + 1, whole), path("midpoint", lost, 0 * lost[:, :1])
    assert told(trajectories(*groups)) == (
        "The Casimir functions stay exactly constant with splitting, drift by 0.5 with euler_maruyama and diverged "
        "with midpoint; the path diverged with midpoint at t = 0.75; all populations stay positive with "
        "splitting and midpoint; the smallest population is -0.5 with euler_maruyama."
    )
    assert told(trajectories(path("splitting", y, np.ones((5, 0)), ("hamiltonian",)))) == (
        "The Hamiltonian goes from 1.25 to 1.25."
    )


def test_weak_orders_are_those_of_the_best_estimator():
    both = weak(weak_group("splitting", "multilevel", functions=1), weak_group("splitting", "kolmogorov", functions=1))
    ends = [one.orders[0].high - one.orders[0].low for one in views.readings(both)]
    best = views.readings(both)[int(np.argmin(ends))].orders[0]
    assert f"is {best.order:.3f} [{best.low:.3f}, {best.high:.3f}] for splitting (expected 1); sampled" in told(both)
    assert "differ by at most so many standard errors: 1.0 for splitting." in told(both)
    several = weak(at_eps("ap_splitting", 0.1), at_eps("ap_splitting", 0.01))
    assert told(several) == "The weak order is 1.00 for AP splitting (expected 1)."


def test_work_precision_tells_of_an_error_that_most_schemes_reach():
    sentence = told(work_results(cases=("one",), schemes=("euler_maruyama", "midpoint", "splitting")))
    assert sentence.startswith("An error of 1e-1 takes 265 ns per path with splitting, 1.83 times as long with Euler")
    results = work_results(cases=("one",), schemes=("euler_maruyama", "splitting"))
    groups = [group._replace(attributes=group.attributes | {"targets": (1e-9,)}) for group in results.groups]
    assert told(results._replace(groups=groups)).startswith("No requested error is reached; the strong order is ")
    cheap = work_group("one", "splitting")
    few = [group._replace(attributes=group.attributes | {"targets": (1.5e-2,)}) for group in results.groups[:1]] + [
        cheap
    ]
    cheap.attributes.update(targets=(1.5e-2,))
    assert "; Euler-Maruyama did not reach it; the strong" in told(results._replace(groups=few))


def test_stability():
    assert told(stability(stability_group("splitting"), stability_group("euler_maruyama"))) == (
        "Of 48 pairs of sigma and h, accurate are splitting at 24 and Euler-Maruyama at 8; paths diverged with "
        "Euler-Maruyama at 12; the Casimir functions stay within 1.2e-14 with splitting and diverged with "
        "Euler-Maruyama."
    )
    assert "; no path diverged; " in told(stability(stability_group("splitting")))


def test_long_time():
    assert told(equilibrium(equilibrium_group("splitting"), equilibrium_group("euler_maruyama"))) == (
        "After 2^26 = 6.7e+07 steps the root mean square error of the Casimir functions is 8.8e-13 with splitting "
        "(growing as n^0.50) and diverged with Euler-Maruyama (growing as n^1.00); the means of the stationary law are "
        "off by at most so many standard errors: 2.1 with splitting."
    )
