"""The study of work and precision: its errors are those of the other studies, and its times those of whole paths."""

import numpy as np
import pytest
import work_study_cases
from helpers import COMPILED, LANES
from states import finished
from work_study_cases import STRONG, WEAK, Clock, group_of, same

from spi.ensemble.loop import thread_count
from spi.kinds.plans import State
from spi.kinds.strong import study as strong
from spi.plugins.comparisons.kinds.work_precision import study as work_precision
from spi.schemes import SCHEMES
from spi.storage import Part

# fixtures
spec, few_steps = work_study_cases.spec, work_study_cases.few_steps


@pytest.mark.usefixtures("few_steps")
@pytest.mark.parametrize("scheme", ["euler_maruyama", "splitting"])
def test_strong_errors_are_those_of_the_strong_study(spec, scheme):
    found = group_of(spec(STRONG + "repeats: 5\n"), scheme)
    expected = group_of(spec(STRONG, "strong"), scheme)
    assert (found.case, found.variant, found.estimator) == ("main", scheme, "")
    for name in ("error", "error_stderr", "resolved", "nonfinite", "casimir_drift"):
        axes, values = expected.variables[name]
        assert found.variables[name][0] == axes and same(found.variables[name][1], values)
    for name, values in found.coordinates.items():
        assert same(values, expected.coordinates[name])
    assert set(found.coordinates) == {"h", "casimir"}
    for name in ("expected_order", "samples"):
        assert same(found.attributes[name], expected.attributes[name])
    for name in ("scheme", "scheme_label"):
        assert found.attributes[name] == expected.attributes[name]
    assert (found.attributes["measure"], found.attributes["repeats"]) == ("strong", 5)
    low, median, high = (found.variables[f"seconds_per_path{end}"][1] for end in ("_low", "", "_high"))
    assert low.shape == median.shape == high.shape == (3,)
    assert np.all((low >= 0) & (low <= median) & (median <= high))
    steps = 1 / found.coordinates["h"]
    np.testing.assert_allclose(found.variables["ns_per_step"][1], 1e9 * median / steps, rtol=1e-12)


@pytest.mark.usefixtures("few_steps")
@pytest.mark.parametrize("estimator", ["kolmogorov", "multilevel"])
def test_weak_errors_are_those_of_the_weak_study(spec, estimator):
    """In modulus, of the only function; a bound of an error takes the place of a standard error."""
    if not COMPILED and estimator == "multilevel":
        pytest.skip("too many steps without the compiler")
    text = WEAK.format(estimators=estimator)
    found = group_of(spec(text, overrides=["schemes=[splitting]"]), "splitting")
    expected = group_of(spec(text, "weak", overrides=["schemes=[splitting]"]), "splitting")
    assert (found.variant, found.estimator, expected.estimator) == ("splitting", "", estimator)
    exact = estimator == "kolmogorov"
    of_weak = {name: values for name, (_, values) in expected.variables.items()}
    spread = "error_bound" if exact else "error_stderr"
    assert same(found.variables["error"][1], np.abs(of_weak["error"][0]))
    assert same(found.variables[spread][1], of_weak[spread][0])
    assert same(found.variables["resolved"][1], of_weak["resolved"][0])
    assert {axes for axes, _ in found.variables.values()} == {("h",), ()} and set(found.coordinates) == {"h"}
    for name in ("order", "order_low", "order_high", "points_in_fit"):
        assert same(found.variables[name][1], of_weak[name][0])
    found = found.attributes
    assert (found["measure"], found["repeats"]) == ("weak", 15)
    assert (found["estimator"], found["functions"]) == (estimator, ("y1^2",))


def test_each_scheme_has_the_first_estimator_that_can_do_it(spec):
    def parts(estimators):
        overrides = ["schemes=[splitting, euler_maruyama, splitting_order2]"]
        return work_precision.parts(spec(WEAK.format(estimators=estimators) + STRONG, overrides=overrides).cases[0])

    names = ("splitting", "euler_maruyama", "splitting_order2")
    assert parts("kolmogorov, multilevel") == [
        Part(name, "multilevel" if name == "euler_maruyama" else "kolmogorov") for name in names
    ]
    assert parts("multilevel, kolmogorov") == [Part(name, "multilevel") for name in names]
    assert parts("plain, kolmogorov, multilevel") == [Part(name, "plain") for name in names]
    case = spec(STRONG).cases[0]
    assert strong.parts(case) == [Part("euler_maruyama"), Part("splitting")]
    assert work_precision.parts(case) == strong.parts(case)
    for part in work_precision.parts(case):
        errors, extra = strong.plan(case, part).cost(), []
        for repeats in (3, 7):  # beside one that warms up
            cost = work_precision.plan(case.model_copy(update={"repeats": repeats}), part).cost()
            assert cost._replace(seconds=errors.seconds) == errors
            extra.append(cost.seconds - errors.seconds)
        assert extra[1] == pytest.approx(2 * extra[0]) and extra[0] > 0


def test_default_targets_are_the_powers_of_ten_within_the_errors(spec, monkeypatch):
    for errors, expected in (
        ([0.2, 0.03, 0.004], (0.1, 0.01)),
        ([1.0, 0.1, 0.01], (1.0, 0.1, 0.01)),
        ([40.0, 0.9e-3], (10.0, 1.0, 0.1, 0.01, 1e-3)),
        ([0.05, 0.02], (0.01,)),  # none within: the next one below
        ([], (0.1,)),
    ):
        assert work_precision._targets(np.array(errors)) == pytest.approx(expected, rel=1e-15)
    monkeypatch.setattr(work_precision, "_seconds_per_path", lambda jobs: np.ones(len(jobs)))
    given = group_of(spec(STRONG + "targets: [0.02, 1/7]\n"), "splitting")
    assert given.attributes["targets"] == (0.02, 1 / 7)
    default = group_of(spec(STRONG), "splitting")
    errors = default.variables["error"][1][default.variables["resolved"][1]]
    assert default.attributes["targets"] == tuple(work_precision._targets(errors))
    assert errors.max() >= default.attributes["targets"][0] > errors.max() / 10


def times_of(case, part):
    """What a plan measures, (repeats, step sizes), without the errors."""
    plan = work_precision.plan(case, part)
    return np.array([task.run()["times"] for task in plan.tasks(State(plan))])


CASES = [STRONG, WEAK.format(estimators="multilevel")]


@pytest.mark.parametrize("text", CASES, ids=["strong", "weak"])
def test_whole_paths_are_timed_in_turns_on_one_thread(spec, monkeypatch, text):
    case = spec(text + "repeats: 4\n", overrides=["final_time=3", "truncate_noise=true"]).cases[0]
    before = thread_count()
    clock = Clock(monkeypatch)
    found = times_of(case, Part("splitting", "multilevel" if case.functions else ""))
    assert thread_count() == before
    assert found.shape == (4, 3) and np.array_equal(found, 2.0**-20 * np.array([[12, 24, 48]] * 4))
    assert len(clock.calls) == 3 * (4 + 1)  # each once before, so that nothing is compiled while it is timed
    for number, call in enumerate(clock.calls):
        h = case.steps[number % 3]
        assert (call.grid.reference_step, call.grid.reference_steps) == (h, round(3 / h))
        assert call.grid.doublings.tolist() == [0] and call.grid.truncate
        assert call.scheme == SCHEMES["splitting"].record and call.threads == 1
        # about 2^20 steps, in whole blocks
        assert call.samples % LANES == 0 and 2**20 - LANES * 48 < call.samples * round(3 / h) <= 2**20


def test_quartiles_are_those_of_the_repetitions(spec, monkeypatch):
    case = spec(STRONG + "repeats: 5\n", overrides=["steps=[2^-2]"]).cases[0]
    Clock(monkeypatch, rates=(1000.0, 5.0, 1.0, 4.0, 2.0, 3.0))  # the first, which is slow, does not count
    plan = work_precision.plan(case, Part("splitting"))
    found = plan.results(finished(plan)).group().variables
    for name, rate in (("_low", 2.0), ("", 3.0), ("_high", 4.0)):
        assert found[f"seconds_per_path{name}"] == (("h",), [2.0**-20 * rate * 4])
    assert found["ns_per_step"][1] == pytest.approx([1e9 * 2.0**-20 * 3.0], rel=1e-15)


@pytest.mark.parametrize("fail_at", [0, 1, 5])
def test_the_number_of_threads_is_restored_when_something_fails(spec, monkeypatch, fail_at):
    case, before = spec(STRONG).cases[0], thread_count()
    Clock(monkeypatch, fail_at=fail_at)
    with pytest.raises(KeyboardInterrupt):
        times_of(case, Part("splitting"))
    assert thread_count() == before


def test_with_a_reference_scheme_the_scheme_itself_is_timed(spec, monkeypatch):
    """It would compile another kernel to do without; but no step is to be made by the reference scheme."""
    case = spec(STRONG + "reference_scheme: splitting\n", overrides=["schemes=[euler_maruyama]"]).cases[0]
    clock = Clock(monkeypatch)
    times_of(case, Part("euler_maruyama"))
    for call in clock.calls:
        assert call.scheme == SCHEMES["euler_maruyama"].record and call.grid.by_reference.tolist() == [0]
        assert call.grid.reference_scheme == SCHEMES["splitting"].record
    assert len(clock.calls) == 3 * 16


@pytest.mark.usefixtures("few_steps")
@pytest.mark.parametrize("text", CASES, ids=["strong", "weak"])
def test_whole_paths_are_integrated(spec, text):
    """What a repetition leaves behind is the end of its paths."""
    case = spec(text).cases[0]
    part, h = work_precision.parts(case)[1], case.steps[-1]
    assert part.scheme == "splitting"
    seen, integrate = [], work_precision.integrate
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(work_precision, "integrate", lambda *arguments: (seen.append(arguments), integrate(*arguments)))
        paths, run = work_precision.plan(case, part).job(h)
        run()
    states, observer, report = seen[0][2], seen[0][5], seen[0][6]
    assert paths == LANES == seen[0][8]
    assert np.isfinite(report).all()
    if case.functions:
        y = states.reshape(3, LANES)
        np.testing.assert_allclose((y**2).sum(axis=0), 1.0, rtol=1e-14)
        assert y[0].std() > 0.05
    else:
        drift = observer.extremes[0, 0, 0]
        assert np.all((drift >= 0) & (drift < 1e-14)) and drift.any() and np.isfinite(states).all()
        assert not observer.rows.size  # nothing but the end is looked at
